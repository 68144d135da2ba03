"""The public function: load a mesh, find the parts of it or of each of its nodes, finish them, report."""

from __future__ import annotations

import math
import os
import warnings
from dataclasses import dataclass, replace
from pathlib import Path
from typing import IO, Any, TypeAlias

import numpy as np
import trimesh
from numpy.typing import ArrayLike

from rlacd.decomposition import Decomposition
from rlacd.errors import DecompositionWarning, OptionError
from rlacd.find_parts import Reached, Repaired, find_parts
from rlacd.finish.finish import Finished, finish, whole
from rlacd.fit import Unit
from rlacd.io.read.contents import USUAL, Fineness
from rlacd.io.read.load import load_mesh
from rlacd.options import Options
from rlacd.options.fields import check_callback
from rlacd.options.keywords import taking
from rlacd.options.lengths import LONGEST_SIDE
from rlacd.options.names import UNITS, file_name, mesh_name
from rlacd.options.navigable import NavigableSpace
from rlacd.policies import make_policy
from rlacd.report import Provenance
from rlacd.run import ProgressCallback, Run
from rlacd.solid.input_mesh import InputMesh
from rlacd.solid.obstacle import Obstacle
from rlacd.solid.provenance import owners

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
        The hulls, in the input's frame and unit (metres, if `unit` is given; their ``units`` say it, if it is known),
        and a report.

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
    """What a decomposition found of an input, which with other options need not be found again."""

    reached: Reached | None = None
    """The parts: with other `detail`, they are only finished again."""
    repaired: Repaired | None = None


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
        if apart:
            from rlacd.extras.nodes.each_node import each_node

            done = each_node(source, asked, run)
        else:
            done = _as_one(source, asked, run, memory or Memory())
    report = replace(
        done.report,
        name=Path(file_name(mesh)).stem or "mesh",
        provenance=tuple(Provenance(hull.metadata.get("node"), hull.metadata.get("body")) for hull in done.hulls),
        up=source.up,
        metres=source.metres,
        deviation_abs=source.deviation,
        seconds={**run.seconds, "total": run.elapsed},
    )
    surface = trimesh.Trimesh(source.vertices, source.faces, process=False)
    if source.metres is not None:
        for each in (surface, *done.hulls):
            each.units = _trimesh_unit(source.metres)
    return Decomposition(done.hulls, report, surface, done.balls, source)


def _trimesh_unit(metres: float) -> str:
    """What trimesh calls a unit."""
    return next((name for name, length in UNITS.items() if length == metres), f"{metres!r} * meters")


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
        memory.reached = whole(find_parts(source, options, run, memory.repaired), source, options, run)
    reached = memory.reached
    run.begin_finishing()
    done = finish(reached._replace(options=replace(reached.options, detail=options.detail)), run)
    if (node_of := source.node_of) is not None:
        places = run.if_in_time(lambda: owners(done.hulls, source.vertices, source.faces, node_of), lambda: [])
        for hull, place in zip(done.hulls, places, strict=False):
            hull.metadata |= {"node": source.nodes[place].name, "node_index": place}
    return done


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
