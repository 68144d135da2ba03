"""What the tests of repair share: damaged and joined meshes, and the check that a solid is closed."""

import manifold3d
import numpy as np
import trimesh

from rlacd.io.read.load import load_mesh
from rlacd.repair.repair import repair
from rlacd.repair.union import to_arrays

BOX = trimesh.creation.box(extents=(2, 2, 2))


def solid_of(mesh, **options):
    solid = repair(
        load_mesh(mesh if isinstance(mesh, tuple) else trimesh.Trimesh(mesh.vertices, mesh.faces, process=False)),
        **options,
    )
    check_closed(solid)
    return solid


def check_closed(solid):
    """By trimesh, which knows nothing of how the solid was made."""
    vertices, faces = to_arrays(solid.manifold)
    assert solid.manifold.status() == manifold3d.Error.NoError
    assert np.isfinite(vertices).all()
    mesh = trimesh.Trimesh(vertices, faces, process=False)
    assert mesh.is_watertight
    assert mesh.is_winding_consistent
    assert mesh.volume > 0


def steps(solid):
    return [body.step for body in solid.bodies]


def volume(solid):
    """In the input's unit."""
    return solid.manifold.volume() / solid.frame.scale**3


def moved(mesh, *offset):
    mesh = mesh.copy()
    mesh.apply_translation(offset)
    return mesh


def without(mesh, *faces):
    return trimesh.Trimesh(mesh.vertices, np.delete(mesh.faces, faces, axis=0), process=False)


def join(*meshes):
    return trimesh.util.concatenate([trimesh.Trimesh(m.vertices, m.faces, process=False) for m in meshes])


def with_hole(radius, subdivisions=5):
    """A ball of radius 1 without the faces near its pole."""
    ball = trimesh.creation.icosphere(subdivisions=subdivisions)
    near = np.linalg.norm(ball.triangles_center - ball.vertices[0] / np.linalg.norm(ball.vertices[0]), axis=1) < radius
    return without(ball, *np.flatnonzero(near)), ball.volume
