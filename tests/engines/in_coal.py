"""Pinocchio and Coal, which answer questions on distances and do not simulate: URDF."""

from pathlib import Path

import coal
import numpy as np
import pinocchio
from harness import kept, run


def take(file):
    folder = str(Path(file).parent)
    model = pinocchio.buildModelFromUrdf(file, pinocchio.JointModelFreeFlyer())
    geometry = pinocchio.buildGeomFromUrdf(model, file, pinocchio.GeometryType.COLLISION, package_dirs=[folder])
    said = []
    for shape in geometry.geometryObjects:
        assert isinstance(shape.geometry, coal.BVHModelOBBRSS)  # as it is read
        shape.geometry.buildConvexRepresentation(False)
        convex = shape.geometry.convex
        triangles = map(convex.polygons, range(convex.num_polygons))
        faces = [[triangle[k] for k in range(3)] for triangle in triangles]
        said.append(kept(np.array(convex.points()), faces, model.inertias[1].mass))
    return said


run("Pinocchio and Coal", "coal", take, None)
