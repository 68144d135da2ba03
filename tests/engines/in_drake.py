"""Drake: SDFormat, with contacts by points."""

import itertools

import pydrake.all as drake
from harness import STEP, kept, run, state


def world(file, starts):
    builder = drake.DiagramBuilder()
    plant, scene = drake.AddMultibodyPlantSceneGraph(builder, STEP)
    friction = drake.CoulombFriction(0.8, 0.8)
    plant.RegisterCollisionGeometry(plant.world_body(), drake.RigidTransform(), drake.HalfSpace(), "floor", friction)
    bodies = []
    for _ in starts:
        parser = drake.Parser(plant)
        parser.SetAutoRenaming(True)
        (instance,) = parser.AddModels(file)
        bodies.append(plant.get_body(plant.GetBodyIndices(instance)[0]))
    plant.Finalize()
    return builder.Build(), plant, scene, bodies


def take(file):
    _, plant, scene, (body,) = world(file, [None])
    inspector = scene.model_inspector()
    said = []
    for geometry in plant.GetCollisionGeometriesForBody(body):
        shape, hull = inspector.GetShape(geometry), inspector.GetConvexHull(geometry)
        assert isinstance(shape, drake.Convex)
        points = [hull.vertex(index) for index in range(hull.num_vertices())]
        said.append(kept(points, triangles(hull.face_data()), body.default_mass()))
    return said


def triangles(polygons):
    """Split polygons, each the number of its corners and then these."""
    left, found = list(polygons), []
    while left:
        count = left.pop(0)
        (first, *rest), left = left[:count], left[count:]
        found += [[first, *pair] for pair in itertools.pairwise(rest)]
    return found


def fall(file, starts, steps):
    diagram, plant, _, bodies = world(file, starts)
    simulator = drake.Simulator(diagram)
    context = plant.GetMyMutableContextFromRoot(simulator.get_mutable_context())
    for body, start in zip(bodies, starts, strict=True):
        plant.SetFreeBodyPose(context, body, drake.RigidTransform(start))
    simulator.AdvanceTo(steps * STEP)
    said = []
    for body in bodies:
        pose = plant.EvalBodyPoseInWorld(context, body)
        speed = plant.EvalBodySpatialVelocityInWorld(context, body)
        w, x, y, z = pose.rotation().ToQuaternion().wxyz()
        said.append(state(pose.translation(), [x, y, z, w], speed.translational(), speed.rotational()))
    return said


run("Drake", "drake", take, fall)
