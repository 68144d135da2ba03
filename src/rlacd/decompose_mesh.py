"""The public function: load a mesh, find the parts of it or of each of its nodes, finish them, report."""

from __future__ import annotations

import math
import os
import warnings
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import IO, Literal, TypeAlias

import numpy as np
import trimesh
from numpy.typing import ArrayLike

from rlacd.decomposition import Decomposition
from rlacd.errors import DecompositionWarning, MissingExtraError, OptionError
from rlacd.find_parts import Reached, covered, find_parts
from rlacd.finish.finish import Finished, finish, misses_some
from rlacd.finish.report import joint_report, missed
from rlacd.io.read.contents import USUAL, Fineness
from rlacd.io.read.load import load_mesh
from rlacd.options import (
    ELSEWHERE,
    OPTION_NAMES,
    SIMPLE,
    DetailName,
    OpenName,
    Options,
    QualityName,
    RelativeTo,
    UnitName,
    VolumeOf,
)
from rlacd.options.fields import check_callback
from rlacd.options.keywords import suggesting
from rlacd.options.names import UNITS, PrimitiveKind, mesh_name
from rlacd.options.navigable import NavigableSpace
from rlacd.options.presets import PresetName
from rlacd.policies import Policy, make_policy
from rlacd.report import Provenance
from rlacd.run import ProgressCallback, Run
from rlacd.solid.frame import Frame
from rlacd.solid.hull import Hull
from rlacd.solid.input_mesh import InputMesh
from rlacd.solid.obstacle import Obstacle
from rlacd.solid.provenance import owners
from rlacd.solid.topology import used_points

MeshLike: TypeAlias = (
    "str | os.PathLike[str] | trimesh.Trimesh | trimesh.Scene | list[trimesh.Trimesh] | tuple[ArrayLike, ArrayLike]"
    " | ArrayLike | IO[bytes]"
)


@suggesting(*ELSEWHERE)
def decompose(
    mesh: MeshLike,
    faces: ArrayLike | None = None,
    *,
    file_type: str | None = None,
    criterion: Literal["concavity", "distance", "volume"] | NavigableSpace | None = None,
    threshold: float | None = None,
    threshold_abs: float | None = None,
    volume_tolerance: float | None = None,
    volume_of: VolumeOf | None = None,
    max_hulls: int | None = None,
    max_vertices: int | None = None,
    max_faces: int | None = None,
    detail: DetailName = SIMPLE,
    primitives: bool | Sequence[PrimitiveKind] = (),
    overlap: float | None = None,
    overlap_abs: float | None = None,
    keep_open: float | None = None,
    keep_open_abs: float | None = None,
    avoid: Sequence[MeshLike] = (),
    merge: bool = True,
    policy: str | Policy | None = None,
    resolution: int = 100,
    open: OpenName = "auto",
    keep_cavities: bool = False,
    gap: float = 0.015,
    seed: int = 0,
    threads: int | None = None,
    timeout: float | None = None,
    quality: QualityName | None = None,
    budget: float | None = None,
    search_steps: int | None = None,
    preset: PresetName | None = None,
    per_node: bool = False,
    relative_to: RelativeTo | None = None,
    unit: UnitName | None = None,
    scale: float | None = None,
    progress: ProgressCallback | None = None,
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
    criterion : "concavity", "distance", "volume" or NavigableSpace, optional
        Decides when a part is tight enough. ``distance``: its surface and its hull's lie at most `threshold` apart.
        ``concavity``: so do they, and the hull adds little volume (CoACD's measure). ``volume``: its hull adds at most
        `volume_tolerance` of volume. `NavigableSpace`: its hull stays out of the space that a ball of a given size can
        reach. By default concavity, and distance with `threshold_abs`.
    threshold : float, optional
        Largest concavity or distance of a part, in CoACD's frame, where the input's longest side is 2: 0.05, the
        default, is 2.5 % of it. Between 0.001 and 2. All other lengths are shares of the longest side, or in the
        input's unit.
    threshold_abs : float, optional
        The same in the input's unit, instead of `threshold`.
    volume_tolerance : float, optional
        With the criterion ``volume``, the share of volume that a hull may add: 0.01, the default, is 1 %, as in V-HACD.
        Parts smaller than a thousandth of the whole's convex hull count as this large.
    volume_of : "part" or "whole", optional
        Whether it is a share of each part's own volume, the default, or of the whole solid's.
    max_hulls : int, optional
        Maximum number of hulls. It has no effect if the decomposition has no more anyway; otherwise the one with the
        least concavity among those found under coarser thresholds is returned, and ``report.warnings`` says by how
        much it exceeds the threshold. A larger limit never leads to a larger concavity.
    max_vertices, max_faces : int, optional
        Limits on the vertices and triangles of each hull. A limited hull contains its part and sticks out by at most
        the threshold (by 0.05 with the criterion ``volume``); concavity does not count the volume that a limit adds. A
        part without such a hull is cut on as `max_hulls` allows, but never beyond twice the hulls it takes without
        limits, and a convex body stays one hull. Where that does not do, a warning says how far hulls stick out.
    detail : "simple" or "full"
        ``simple``: hulls leave out corners that add little, so that they have few, as far as the part still meets the
        criterion. ``full``: the exact hulls of the parts.
    primitives : bool or sequence of str
        A part becomes a ``"sphere"``, ``"capsule"``, ``"box"`` or ``"cylinder"`` if one contains its hull and meets the
        criterion: the simplest whose volume is within a quarter of the least. Only those named;
        True allows all. Its hull is then a convex polyhedron around the primitive, and ``Decomposition.primitives``
        describes it. Models (MJCF, URDF, SDF, USD) hold primitives in place of such hulls.
    overlap : float, optional
        Hulls that touch overlap by this share of the longest side, so that nothing thin slips between them: one takes
        in a layer of the other. The threshold still holds; where it leaves no room, hulls overlap by less, and
        ``report.warnings`` says at how many seams. At most 0.25. With `per_node`, hulls of different nodes do not
        overlap.
    overlap_abs : float, optional
        The same in the input's unit, instead of `overlap`.
    keep_open : float, optional
        Passages stay open: in a hole, slot or mouth that holds a ball of at least `threshold` in radius, a ball of this
        share of its radius still fits between the hulls, at the same place. ``report.warnings`` counts those not
        kept and says what is left; ``report.passages`` lists them.
    keep_open_abs : float, optional
        Instead of a share, the radius of a ball in the input's unit that still passes wherever one 1 % larger does.
    avoid : list of meshes
        Meshes, each like `mesh`, in its frame and unit, that no hull enters: parts that would are cut finer, down to a
        hundredth of the threshold. Where the input itself crosses them, or limits on the hulls leave no way,
        ``report.warnings`` says so.
    merge : bool
        Unite parts whose joint hull still meets the threshold.
    policy : str or Policy, optional
        What chooses the cuts of the first pass: ``greedy``, the default; ``learned``, the default if parts are not
        merged; ``rl-acd``, ``greedy-SCORE``, ``navacd``, ``random-N``, the path of an .npz file of a network, or any
        object with a method ``choose``: see `rlacd.Policy`.
    resolution : int
        Cells along the longest side of the grid on which repair looks for enclosed spaces.
    open : "auto", "solid" or "thin"
        How to treat bodies with openings, such as cups and damaged scans. ``auto``: solid if nothing can get inside or
        if the openings look like missing faces; otherwise a shell as thin as its faces. ``solid``: hollows are filled.
        ``thin``: nothing is filled.
    keep_cavities : bool
        Closed cavities stay empty: those that an inner shell or closed bodies bound, and rooms that only narrow gaps
        lead to. By default they are filled, as nothing can get in; the mass leaves closed cavities out either way.
    gap : float
        Radius of a ball, as a share of the longest side: what it cannot get into through the openings counts as closed.
    seed : int
        Seed of all random choices; the same input, options and seed give the same bytes. Another seed starts from cuts
        by other planes: the best of several is often better than any one.
    threads : int, optional
        Number of threads; all processors by default. The result does not depend on it.
    timeout : float, optional
        Seconds after which the decomposition reached so far is returned, at most 1 s and 10 % late for inputs of up to
        a million triangles. It always covers the input, at worst with one hull for each body.
    quality : str, optional
        ``fast``: one pass of cuts; by distance and on navigable space, parts that can be divided among others are then
        eliminated, unless the policy stands for a published method (``navacd``, ``greedy-SCORE``). ``balanced``, the
        default if parts are merged: also a search for fewer parts, whose work is limited to a multiple of that of the
        pass. ``best``: the same, followed by a long search.
        No level is worse than the one before it: it finds fewer hulls, or equally many with no more volume before
        `detail` simplifies them.
    budget : float, optional
        Seconds the search may take, instead of the limits of the level; the result then depends on the speed of the
        machine. ``best`` has 5, and more if the search of ``balanced`` takes longer.
    search_steps : int, optional
        Steps the search may take, instead of the limits of the level (about 100 a second on one core). The result
        does not depend on the speed of the machine.
    preset : str, optional
        The engine the hulls are for: ``mujoco``, ``physx``, ``physx-gpu``, ``unity``, ``unreal``, ``newton``,
        ``bullet`` or ``godot``. Each of its limits applies unless `max_vertices` or `max_faces`, respectively, is
        given, and ``report.warnings`` says what the engine will not accept; see `rlacd.PRESETS`.
    per_node : bool
        Decompose each node of a scene separately, such as the doors and drawers of a cupboard, which move. The limits
        on hulls hold for each. Nodes that do not touch do not touch as hulls either, or a warning names them (extra
        ``clear``). Every hull's ``metadata`` names its node, with or without this.
    relative_to : "scene" or "node", optional
        With `per_node`, what `threshold` is relative to: the size of the whole scene, the default, or of each node.
    unit : "mm", "cm", "m", "in" or "file", optional
        The unit of the input, which is converted to metres; ``file`` takes what the file says. By default coordinates
        stay as they are.
    scale : float, optional
        Factor to multiply the input's coordinates by, also after a conversion by `unit`.
    progress : callable, optional
        Called with a `Progress` between steps, and several times a second during long ones; when it returns False
        (or 0, but not None), the decomposition reached so far is returned as promptly as after a timeout.

    Returns
    -------
    Decomposition
        The hulls, in the input's frame and unit, and a report.

    Raises
    ------
    MeshError
        The input cannot be read or contains nothing to decompose.
    OptionError
        An option has the wrong type or is out of range; raised before any work is done.

    Warns
    -----
    DecompositionWarning
        What ``report.warnings`` says, once a call.
    """
    given = locals()
    options = Options.of({name: given[name] for name in OPTION_NAMES})
    check_callback("progress", progress, "a `rlacd.Progress`")
    make_policy(options.first_policy)  # reports a bad network before any work is done
    with Run(options.threads, options.timeout, progress, options.seed) as run:
        with run.stage("load"):
            source = in_metres(load_mesh(mesh, faces, file_type, _fineness(options)), options)
            obstacles = tuple(_obstacle(one).scaled(source.factor) for one in options.avoid)
        options = replace(options, avoid=obstacles)
        apart = options.per_node and len(source.nodes) > 1
        if options.per_node and not apart:
            alone = f"per_node had no effect: {source.name} was read as one node"
            source = replace(source, warnings=(*source.warnings, alone))
        done = _each_node(source, options, run) if apart else _as_one(source, options, run)
    report = replace(
        done.report,
        name=Path(source.name).stem or "mesh" if isinstance(mesh, (str, os.PathLike)) else "mesh",
        provenance=tuple(Provenance(hull.metadata.get("node"), hull.metadata.get("body")) for hull in done.hulls),
        up=source.up,
        metres=source.metres,
        deviation_abs=source.deviation,
        seconds={**run.seconds, "total": run.elapsed},
    )
    if report.warnings:
        said = f"{report.name}: {' '.join(report.warnings)}"
        warnings.warn(said, DecompositionWarning, stacklevel=3)  # past the function that suggests names of options
    surface = trimesh.Trimesh(source.vertices, source.faces, process=False)
    return Decomposition(done.hulls, report, surface, done.balls, source)


def _fineness(options: Options) -> Fineness:
    """How near to curved surfaces triangles have to be: a tenth of the distance that the criterion allows."""
    space, factor = options.criterion, _factor(options, 1.0)
    if isinstance(space, NavigableSpace):
        share, length = space.tolerance, space.tolerance_abs
    elif "threshold" in options.numbers:
        share, length = options.threshold / 2, options.threshold_abs
    else:
        return USUAL
    of_nodes = options.per_node and options.relative_to == "node"
    return Fineness((share or 0.0) / 10, None if length is None else length / factor / 10, of_nodes)


def _obstacle(mesh: MeshLike | Obstacle) -> Obstacle:
    """Read a mesh that hulls are to avoid."""
    if isinstance(mesh, Obstacle):
        return mesh
    found = load_mesh(mesh)
    return Obstacle(mesh_name(mesh), found.vertices, found.faces.astype(np.int32))


def _as_one(source: InputMesh, options: Options, run: Run) -> Finished:
    reached = _whole(find_parts(source, options, run), source, options, run)
    run.begin_finishing()
    done = finish(reached, run)
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
    frame = Frame.of(used_points(source.vertices, source.faces))
    scale = frame.scale
    assert source.node_of is not None
    used = np.unique(source.node_of).tolist()
    meshes = [source.of_node(index) for index in used]
    each = [options.for_node(scale, Frame.of(mesh.vertices).scale) for mesh in meshes]
    reached = []
    for mesh, own in zip(meshes, each, strict=True):
        reached.append(_whole(find_parts(mesh, own, run), mesh, own, run))
    run.begin_finishing()
    done = [finish(one, run) for one in reached]
    names = [source.nodes[place].name for place in used]
    said = [] if run.stopped_by is not None else _clear_of_each_other(names, meshes, each, done, run)
    bodies = 0
    for place, one in zip(used, done, strict=True):
        for hull in one.hulls:
            body = hull.metadata["body"]
            whose = {"node": source.nodes[place].name, "node_index": place}
            hull.metadata |= whose | {"body": None if body is None else body + bodies}
        bodies += len(one.report.repair)
    report = joint_report(list(zip(names, (one.report for one in done), strict=True)), scale)
    said, distances = [*report.warnings, *said], report.hausdorff
    if distances.under is not None:
        found = [hull for part in done for h in part.hulls if (hull := Hull.of(frame.to_frame(h.vertices))) is not None]
        left_out = missed(frame.to_frame(source.specks), found, frame, run)
        distances = replace(distances, under=max(distances.under, left_out.distance))
        said[len(report.warnings) : len(report.warnings)] = left_out.said
    told = (*source.warnings, *said)
    joint = replace(report, options=options.as_plain(), hausdorff=distances, warnings=told)
    return Finished([hull for one in done for hull in one.hulls], joint)


def _clear_of_each_other(
    names: Sequence[str], meshes: Sequence[InputMesh], options: Sequence[Options], done: list[Finished], run: Run
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
    return warnings_of(cleared, rest, lambda length: f"{length:.4g}")


def in_metres(source: InputMesh, options: Options) -> InputMesh:
    """Convert the input as the options say.

    Raises
    ------
    OptionError
        The unit is to be that of the file, which does not say it.
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
    return source if factor == 1.0 else source.scaled(factor)


def _factor(options: Options, metres: float) -> float:
    """What coordinates of a file whose unit is so many metres are multiplied by."""
    unit = 1.0 if options.unit is None else UNITS.get(options.unit, metres)
    return unit if options.scale is None else options.scale * unit
