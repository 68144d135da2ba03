"""The public function: load a mesh, find the parts of it or of each of its nodes, finish them, report."""

from __future__ import annotations

import math
import os
import warnings
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import IO, Any, TypeAlias

import numpy as np
import trimesh
from numpy.typing import ArrayLike

from rlacd.decomposition import Decomposition
from rlacd.errors import DecompositionWarning, MissingExtraError, OptionError
from rlacd.find_parts import Reached, covered, find_parts, find_parts_of_twin
from rlacd.finish.finish import Finished, covers, finish, finish_twin, misses_some
from rlacd.finish.report import joint_report, missed
from rlacd.fit import Unit
from rlacd.io.read.contents import USUAL, Fineness
from rlacd.io.read.load import load_mesh
from rlacd.options import Options
from rlacd.options.fields import check_callback
from rlacd.options.keywords import taking
from rlacd.options.lengths import LONGEST_SIDE
from rlacd.options.names import UNITS, mesh_name
from rlacd.options.navigable import NavigableSpace
from rlacd.policies import make_policy
from rlacd.report import Provenance
from rlacd.run import ProgressCallback, Run
from rlacd.solid.frame import Frame
from rlacd.solid.hull import Hull
from rlacd.solid.input_mesh import InputMesh
from rlacd.solid.obstacle import Obstacle
from rlacd.solid.provenance import owners
from rlacd.solid.topology import compacted
from rlacd.solid.twins import Similarity, twins

MeshLike: TypeAlias = (
    "str | os.PathLike[str] | trimesh.Trimesh | trimesh.Scene | list[trimesh.Trimesh] | tuple[ArrayLike, ArrayLike]"
    " | ArrayLike | IO[bytes]"
)


@taking(Options)
def decompose(
    mesh: MeshLike,
    faces: ArrayLike | None = None,
    *,
    file_type: str | None = None,
    progress: ProgressCallback | None = None,
    **options: Any,
) -> Decomposition:
    """Decompose a mesh into few convex hulls that fit it tightly.

    Parameters
    ----------
    mesh : path, open file, bytes, trimesh.Trimesh, trimesh.Scene, list of trimesh.Trimesh, or vertices
        Any triangle mesh or file of one; it need not be closed, oriented or clean. A list is one object of several
        bodies.
    faces : array-like [F, 3], optional
        Of vertices ``[V, 3]`` given as `mesh`; ``(vertices, faces)`` is the same.
    file_type : str, optional
        The format of an open file or of bytes, such as ``"obj"``; by default what its name or its content tells.
    progress : callable, optional
        Called with a `Progress` between steps, and several times a second during long ones; when it returns False
        (or 0, but not None), the decomposition reached so far is returned as promptly as after a timeout.
    **options
        Given by their names.

    Returns
    -------
    Decomposition
        The hulls, in the input's frame and unit, and a report.

    Raises
    ------
    MeshError
        The input cannot be read or contains nothing to decompose.
    OptionError
        An option has the wrong type or is out of range, or another one overrides it; raised before any work is done.
        None is the same as leaving it out.

    Warns
    -----
    DecompositionWarning
        What ``report.warnings`` says, once a call.
    """
    done = decompose_quietly(mesh, faces, file_type=file_type, progress=progress, **options)
    if done.report.warnings:
        said = f"{done.name}: {' '.join(done.report.warnings)}"
        warnings.warn(said, DecompositionWarning, stacklevel=2)
    return done


@dataclass
class Memory:
    """The parts that a decomposition found: with other `detail`, the same input is only finished again."""

    reached: Reached | None = None


def decompose_quietly(
    mesh: MeshLike,
    faces: ArrayLike | None = None,
    *,
    file_type: str | None = None,
    progress: ProgressCallback | None = None,
    told_in: Unit | None = None,
    memory: Memory | None = None,
    **options: Any,
) -> Decomposition:
    """Decompose as `decompose` does, but warn of nothing.

    Lengths are told in a unit: by default that in which a length was given, else the input's own.
    """
    asked = Options.of(options)
    check_callback("progress", progress, "a `rlacd.Progress`")
    make_policy(asked.first_policy)  # reports a bad network before any work is done
    with Run(asked.threads, asked.timeout, progress) as run:
        with run.stage("load"):
            source, asked = in_metres(load_mesh(mesh, faces, file_type, _fineness(asked)), asked)
            source = replace(source, told_in=told_in or source.told_in)
            obstacles = tuple(_obstacle(one).scaled(source.factor) for one in asked.avoid)
        asked = replace(asked, avoid=obstacles)
        apart = asked.per_node and len(source.nodes) > 1
        if asked.per_node and not apart:
            alone = f"per_node had no effect: {source.name} was read as one node"
            source = replace(source, warnings=(*source.warnings, alone))
        done = _each_node(source, asked, run) if apart else _as_one(source, asked, run, memory or Memory())
    report = replace(
        done.report,
        name=Path(source.name).stem or "mesh" if isinstance(mesh, (str, os.PathLike)) else "mesh",
        provenance=tuple(Provenance(hull.metadata.get("node"), hull.metadata.get("body")) for hull in done.hulls),
        up=source.up,
        metres=source.metres,
        deviation_abs=source.deviation,
        seconds={**run.seconds, "total": run.elapsed},
    )
    surface = trimesh.Trimesh(source.vertices, source.faces, process=False)
    return Decomposition(done.hulls, report, surface, done.balls, source)


def _fineness(options: Options) -> Fineness:
    """How near to curved surfaces triangles have to be: a tenth of the distance that the criterion allows."""
    space, factor = options.criterion, _factor(options, 1.0)
    if isinstance(space, NavigableSpace):
        bare, length = space.tolerance, space.tolerance_abs
    elif "threshold" in options.numbers:
        bare, length = options.threshold, options.threshold_abs
    else:
        return USUAL
    of_nodes = options.per_node and options.relative_to == "node"
    share = float(bare or 0.0) / LONGEST_SIDE
    return Fineness(share / 10, None if length is None else length / factor / 10, of_nodes)


def _obstacle(mesh: MeshLike | Obstacle) -> Obstacle:
    """Read a mesh that hulls are to avoid."""
    if isinstance(mesh, Obstacle):
        return mesh
    found = load_mesh(mesh)
    return Obstacle(mesh_name(mesh), found.vertices, found.faces.astype(np.int32))


def _as_one(source: InputMesh, options: Options, run: Run, memory: Memory) -> Finished:
    if memory.reached is None:
        memory.reached = _whole(find_parts(source, options, run), source, options, run)
    reached = memory.reached
    run.begin_finishing()
    done = finish(reached._replace(options=replace(reached.options, detail=options.detail)), run)
    if (node_of := source.node_of) is not None:
        places = run.if_in_time(lambda: owners(done.hulls, source.vertices, source.faces, node_of), lambda: [])
        for hull, place in zip(done.hulls, places, strict=False):
            hull.metadata |= {"node": source.nodes[place].name, "node_index": place}
    return done


def _whole(reached: Reached, source: InputMesh, options: Options, run: Run) -> Reached:
    """What was reached; a cover of the input if a stop left parts that miss some of it (see `misses_some`)."""
    return covered(source, options, run) if misses_some(reached, run) else reached


def _each_node(source: InputMesh, options: Options, run: Run) -> Finished:
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
        like = twin and find_parts_of_twin(mesh, own, reached[leader], twin, run)
        if twin and like and run.if_in_time(partial(covers, like.parts, *like.solid.mesh, run), lambda: False):
            reached[number], taken[number] = like, twin
        else:
            reached[number] = _whole(find_parts(mesh, own, run), mesh, own, run)
    run.begin_finishing()
    done: dict[int, Finished] = {}
    for number, one in reached.items():
        twin = taken.get(number)
        done[number] = finish(one, run) if twin is None else finish_twin(one, done[leaders[number]], twin, run)
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
    from rlacd.clear import Body, CrowdedError, Surface, at_rest, kept_clear, may_touch, warnings_of

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


def in_metres(source: InputMesh, options: Options) -> tuple[InputMesh, Options]:
    """Convert the input as the options say, and lengths with a unit to the input's.

    Raises
    ------
    OptionError
        The unit is to be that of the file, which does not say it; or a length has a unit, and the input none.
    """
    if options.unit == "file" and source.metres is None:
        raise OptionError(f"unit is 'file', but {source.name} does not say its unit; give mm, cm, m or in.")
    stated = source.metres
    if options.unit is not None:
        if stated is not None and not math.isclose(stated, UNITS.get(options.unit, stated)):
            said = (
                f"the unit of {source.name} is {stated:g} m, by its format or by what it says; --unit {options.unit} "
            )
            source = replace(source, warnings=(*source.warnings, f"{said}overrides that"))
        source = replace(source, metres=1.0)
    factor = _factor(options, stated or 1.0)
    source = source if factor == 1.0 else source.scaled(factor)
    told_in = Unit.typed(options.typed_unit, source.metres)
    return replace(source, told_in=told_in), options.in_unit(source.metres, source.name)


def _factor(options: Options, metres: float) -> float:
    """What coordinates of a file whose unit is so many metres are multiplied by."""
    unit = 1.0 if options.unit is None else UNITS.get(options.unit, metres)
    return unit if options.scale is None else options.scale * unit
