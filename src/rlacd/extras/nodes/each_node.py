"""Every node of a scene decomposed for itself, and hulls of nodes that do not touch kept from touching."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from functools import partial

import numpy as np

from rlacd.clear import Body, CrowdedError, Surface, at_rest, kept_clear, may_touch, warnings_of
from rlacd.errors import MissingExtraError
from rlacd.extras.nodes.joint_report import joint_report
from rlacd.extras.nodes.twins import Similarity, twins
from rlacd.find_parts import Problem, Reached, find_parts
from rlacd.finish.finish import Finished, covers, finish, whole
from rlacd.finish.report import missed
from rlacd.fit import Unit
from rlacd.options import Options
from rlacd.run import Run
from rlacd.solid.frame import ROUNDING, Frame
from rlacd.solid.hull import Hull
from rlacd.solid.input_mesh import InputMesh
from rlacd.solid.obstacle import Obstacle
from rlacd.solid.topology import compacted


def each_node(source: InputMesh, options: Options, run: Run) -> Finished:
    """Decompose every node separately; lengths of the joint report are in the frame of the whole scene."""
    frame = Frame.of(compacted(source.vertices, source.faces)[0], source.unit)
    scale = frame.scale
    assert source.node_of is not None
    used = np.unique(source.node_of).tolist()
    meshes = [source.of_node(index) for index in used]
    each = [options.for_node(scale, Frame.of(mesh.vertices).scale) for mesh in meshes]
    of_one_size = options.relative_to == "scene" or options.threshold_abs is not None
    done = _finished_nodes(meshes, each, run, of_one_size=of_one_size)
    names = [source.nodes[place].name for place in used]
    said = [] if run.stopped_by is not None else _clear_of_each_other(names, meshes, each, done, run, source.unit)
    bodies = 0
    for place, one in zip(used, done, strict=True):
        for hull in one.hulls:
            body = hull.metadata["body"]
            whose = {"node": source.nodes[place].name, "node_index": place}
            hull.metadata |= whose | {"body": None if body is None else body + bodies}
        bodies += len(one.report.repair)
    report = joint_report(list(zip(names, (one.report for one in done), strict=True)), scale)
    said, distances = [*report.warnings, *said], report.hausdorff
    if distances.missed is not None:
        found = [hull for part in done for h in part.hulls if (hull := Hull.of(frame.to_frame(h.vertices))) is not None]
        left_out = missed(frame.to_frame(source.specks), found, frame, run)
        distances = replace(distances, missed=max(distances.missed, left_out.distance))
        said[len(report.warnings) : len(report.warnings)] = left_out.said
    told = (*source.warnings, *said)
    joint = replace(report, options=options.as_plain(), hausdorff=distances, warnings=told)
    return Finished([hull for one in done for hull in one.hulls], joint)


def _finished_nodes(
    meshes: Sequence[InputMesh], options: Sequence[Options], run: Run, *, of_one_size: bool
) -> list[Finished]:
    """Decompose and finish nodes; those that are one mesh in several places (of one size) take over what one reached.

    With meshes to avoid, places differ in more than that.
    """
    numbers = range(len(meshes))
    leaders = numbers if options[0].avoid else twins(meshes, of_one_size=of_one_size)
    reached: dict[int, Reached] = {}
    taken: dict[int, Similarity] = {}
    for number in sorted(numbers, key=lambda number: leaders[number] != number):
        mesh, own, leader = meshes[number], options[number], leaders[number]
        twin = None if leader == number or run.stopped_by else Similarity.between(meshes[leader], mesh)
        like = twin and _parts_of_twin(mesh, own, reached[leader], twin, run)
        if twin and like and run.if_in_time(partial(covers, like.parts, *like.solid.mesh, run), lambda: False):
            reached[number], taken[number] = like, twin
        else:
            reached[number] = whole(find_parts(mesh, own, run), mesh, own, run)
    run.begin_finishing()
    done: dict[int, Finished] = {}
    for number, one in reached.items():
        twin = taken.get(number)
        done[number] = finish(one, run) if twin is None else _finish_twin(one, done[leaders[number]], twin, run)
    return [done[number] for number in numbers]


def _clear_of_each_other(
    names: Sequence[str],
    meshes: Sequence[InputMesh],
    options: Sequence[Options],
    done: list[Finished],
    run: Run,
    unit: Unit,
) -> list[str]:
    """Decompose nodes again whose hulls touch though they do not; returns what to say of those that still do."""

    def body(number: int) -> Body:
        mesh, hulls = meshes[number], done[number].hulls
        surfaces = [Surface(hull.vertices, hull.faces) for hull in hulls]
        return Body(names[number], Surface(mesh.vertices, mesh.faces), surfaces)

    def redo(number: int, obstacles: Sequence[Obstacle], most: int) -> list[Surface] | None:
        own = replace(options[number], avoid=(*options[number].avoid, *obstacles))
        reached = find_parts(meshes[number], own, run)
        if run.stopped_by is not None or len(reached.parts) > most:
            return None
        done[number] = finish(reached, run)
        return body(number).hulls

    bodies, rest = [body(number) for number in range(len(names))], at_rest(names)
    try:
        if not may_touch(bodies):
            return []
        with run.stage("clear"):
            cleared = run.if_in_time(lambda: kept_clear(bodies, rest, redo), lambda: None)
    except (MissingExtraError, CrowdedError) as error:
        return [f"Nodes were not checked against each other: {error}"]
    if cleared is None:
        return ["There was no time to check nodes against each other."]
    return warnings_of(cleared, rest, unit.words)


def _parts_of_twin(source: InputMesh, options: Options, like: Reached, twin: Similarity, run: Run) -> Reached | None:
    """Take over what was reached for a mesh's twin; None if its parts do not meet the goal here, or on a stop.

    The mesh is repaired and the parts are tested, so that nothing is taken for granted but their number.
    """
    with run.until_stopped():
        problem = Problem.of(source, options, run)
        solid, goal, frame = problem.solid, problem.goal, like.solid.frame
        parts = twin.moved([frame.to_input(part.hull.vertices) for part in like.parts], problem.root, solid.frame)
        if parts is None or (options.max_hulls is None and not all(run.map(goal.is_met, parts))):
            return None
        found, same = like.found, twin.factor * like.goal.outward_deviation / frame.scale
        if found is not None and goal.outward_deviation / solid.frame.scale > (1 + ROUNDING) * same:
            found = replace(found, lower_bound=1)  # it holds for a tolerance that is smaller
        return Reached(solid, problem.options, goal, parts, found, problem.root)
    return None


def _finish_twin(reached: Reached, like: Finished, twin: Similarity, run: Run) -> Finished:
    """Finish what was taken over from a mesh's twin with the finished hulls of that, if they meet the goal here."""
    options, root = reached.options, reached.root
    assert root is not None, "parts are taken over to a solid"
    if not options.primitive_kinds and options.overlap == 0:
        corners = [np.asarray(hull.vertices) for hull in like.hulls]
        parts = twin.moved(corners, root, reached.solid.frame)
        if parts is not None and run.if_in_time(lambda: all(run.map(reached.goal.is_met, parts)), lambda: False):
            cleaned = reached._replace(parts=parts, before=(reached.parts,))
            return finish(cleaned, run, is_clean=True)
    return finish(reached, run)
