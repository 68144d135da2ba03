"""The batch's part in a pool process: one mesh, from its file to the files of its hulls."""

from __future__ import annotations

import os
import time
import warnings
from dataclasses import replace
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np
import trimesh

from rlacd.batch.job_spec import NETWORK, JobSpec
from rlacd.decompose_mesh import decompose, decompose_quietly
from rlacd.decomposition import Decomposition
from rlacd.errors import ImplausibleBodyWarning, MeshError, sentence_of
from rlacd.io.read.beside import lay_out
from rlacd.io.read.load import load_mesh
from rlacd.io.robots import is_robot
from rlacd.io.robots.read import STAGES, robot_or_none
from rlacd.io.robots.rewrite import rewrite, rewrite_quietly
from rlacd.io.robots.robot import Robot
from rlacd.options.robots import RobotOptions
from rlacd.plain_json import as_plain
from rlacd.pool import Blobs
from rlacd.pool.process import peak_memory
from rlacd.report import Report

SERVER = "rlacd.batch.server:MeshServer"

STAND_IN = "The mesh was given its convex hull instead of a decomposition."


class MeshServer:
    """Decomposes meshes; `staging` is a folder for temporary files."""

    def __init__(self, staging: Path) -> None:
        self._staging = staging

    def __call__(self, values: dict[str, Any], blobs: Blobs) -> tuple[dict[str, Any], dict[str, bytes]]:
        """Decompose a mesh; any error it causes becomes part of the answer.

        Parameters
        ----------
        values : dict
            ``spec``, as plain values; the mesh's ``path`` if it can be read from this machine; its ``name``, for
            messages; the ``stem`` of its result, a file or a folder; ``home``, the folder that this is moved to; and
            ``hull_only``, whether to compute the convex hull of all points instead, within the limits on hulls that the
            options set.
        blobs : dict of bytes
            The files of the mesh (`rlacd.io.read.beside.mesh_files`), if it cannot be read from this machine; and
            `JobSpec.network`.

        Returns
        -------
        dict
            ``report``; or ``error``, and ``unusable``, whether the mesh is at fault. Always ``seconds``, ``cpu`` and
            ``peak_mb``, the peak of this process so far.
        dict of bytes
            The files to write, by name; a file that refers to others comes last.
        """
        wall, cpu = time.perf_counter(), time.process_time()
        files: dict[str, bytes] = {}
        with TemporaryDirectory(dir=self._staging) as source, TemporaryDirectory(dir=self._staging) as made:
            laid = None if values["path"] else lay_out(blobs, Path(source))
            path = (laid or Path(values["path"])).absolute()  # as messages name it
            try:
                spec = self._spec(values["spec"], blobs)
                place, home = Path(made, values["stem"]), Path(values["home"])
                answer: dict[str, Any] = {"report": _write(spec, path, place, home, values["hull_only"])}
                files = _files_in(Path(made))
            except Exception as error:
                said = sentence_of(error).replace(f"{path.parent}{os.sep}", values["name"].removesuffix(path.name))
                said = said.replace(str(self._staging), "")
                answer = {"error": said, "unusable": isinstance(error, MeshError)}
        spent = {"seconds": round(time.perf_counter() - wall, 4), "cpu": round(time.process_time() - cpu, 4)}
        return {**answer, **spent, "peak_mb": peak_memory() // 2**20}, files

    def _spec(self, plain: dict[str, Any], blobs: Blobs) -> JobSpec:
        spec = JobSpec(**plain)
        if NETWORK not in blobs:
            return spec
        network = self._staging / f"{spec.weights}.npz"  # kept, so that it is read only once
        if not network.exists():
            network.write_bytes(blobs[NETWORK])
        return replace(spec, options={**spec.options, "policy": str(network)})


def _write(spec: JobSpec, mesh: Path, place: Path, home: Path, hull_only: bool) -> dict[str, Any]:
    """Decompose a mesh file and write its result to a place, which has no ending yet; returns facts about it."""
    stage = robot_or_none(mesh) if spec.ending in STAGES and mesh.suffix.lower() in STAGES else None
    if is_robot(mesh) or stage is not None:
        ending = mesh.suffix if stage is None else spec.ending
        return _robot(spec, stage or mesh, Path(f"{place}{ending}"), home, hull_only)
    result = _hull(spec, mesh) if hull_only else decompose_quietly(mesh, **spec.options)
    with warnings.catch_warnings(record=True) as doubts:
        warnings.simplefilter("always", ImplausibleBodyWarning)
        result.save(f"{place}{spec.ending or '/'}", **spec.written)
    facts = _summary(result.report)
    return facts | {"warnings": [*facts["warnings"], *(str(doubt.message) for doubt in doubts)]}


def _robot(spec: JobSpec, robot: Path | Robot, place: Path, home: Path, hull_only: bool) -> dict[str, Any]:
    """Rewrite a robot, or a stage as one file, with hulls in place of its collision meshes; returns facts."""
    options = {**_limits(spec), "max_hulls": 1, "quality": "fast"} if hull_only else spec.options
    if isinstance(robot, Path):
        done = rewrite_quietly(robot, place, home=home, **options)
    else:
        done = rewrite(robot, place, options, RobotOptions(), keep_input=True)
        robot = robot.source
    here = {str(place.parent): "the results", str(robot.absolute().parent): "the robot's folder"}
    warnings = [STAND_IN] if hull_only else []
    for warning in done.warnings:
        for path, name in here.items():
            warning = warning.replace(path, name)
        warnings.append(warning)
    reports = [result.report for link in done.links for result in link.results]
    each = [(missed, _missed(report)) for report in reports if (missed := report.hausdorff.missed) is not None]
    missed, in_words = max(each, default=(None, None))
    facts = {what: sum(getattr(report, what) for report in reports) for what in ("hulls", "triangles", "vertices")}
    fits = [fit for report in reports if (fit := report.fit) is not None and fit.is_length]
    if fits and all(fit.max is not None for fit in fits):
        facts[fits[0].name] = max(fit.max for fit in fits if fit.max is not None)
    return {
        **facts,
        "hausdorff": {"missed": missed},
        "missed": in_words,
        "complete": done.complete and not hull_only,
        "warnings": warnings,
    }


def _limits(spec: JobSpec) -> dict[str, Any]:
    """The options that hold for a convex hull too."""
    return {name: spec.options.get(name) for name in ("max_vertices", "max_faces", "preset", "threads")}


def _hull(spec: JobSpec, mesh: Path) -> Decomposition:
    """Make a single hull of all points, which works for point clouds too."""
    source = load_mesh(mesh)
    used = source.vertices[np.unique(source.faces)] if len(source.faces) else source.vertices
    around = decompose((used, np.empty((0, 3), dtype=np.int64)), max_hulls=1, quality="fast", **_limits(spec))
    surface = trimesh.Trimesh(source.vertices, source.faces, process=False)
    return Decomposition.of(around.hulls, surface, name=mesh.stem, complete=False, warnings=(STAND_IN,))


def _summary(report: Report) -> dict[str, Any]:
    """Collect the facts that do not depend on when and where the mesh is decomposed."""
    same = ("hulls", "triangles", "vertices", "complete", "hausdorff")
    kept = {what: as_plain(getattr(report, what)) for what in same}
    if report.fit is not None:
        kept[report.fit.name] = report.fit.max
    return {**kept, "missed": _missed(report), "warnings": [*report.warnings]}


def _missed(report: Report) -> str | None:
    """How far hulls miss the surface, in words; None if it is unknown."""
    missed = report.hausdorff.missed
    return None if missed is None else report.unit_in_frame.words(missed)


def _files_in(folder: Path) -> dict[str, bytes]:
    """Read all files, those in folders first: others refer to them."""
    paths = sorted(path for path in folder.rglob("*") if path.is_file())
    paths.sort(key=lambda path: -len(path.relative_to(folder).parts))
    return {path.relative_to(folder).as_posix(): path.read_bytes() for path in paths}
