"""Hulls to test with, and an exact judge of whether a mesh is one."""

from __future__ import annotations

import dataclasses
import json
import os
from collections.abc import Iterable, Sequence
from pathlib import Path

import numpy as np
import numpy.typing as npt
import trimesh

from fuzz.geometry import why_not_convex
from rlacd._native import convex_hull
from rlacd.decomposition import Decomposition
from rlacd.report import Report
from rlacd.solid.distance import hull_distances
from rlacd.solid.hull import Hull


def hull_of(points: npt.ArrayLike) -> trimesh.Trimesh:
    array = np.ascontiguousarray(points, dtype=np.float64)
    indices, faces, rank = convex_hull(array)
    assert rank == 3
    return trimesh.Trimesh(array[indices], faces, process=False)


def save_hulls(
    hulls: Sequence[trimesh.Trimesh],
    path: str | os.PathLike[str],
    *,
    stem: str = "mesh",
    file_type: str | None = None,
) -> Path:
    """Write hulls without the mesh they come from."""
    return Decomposition.of(list(hulls), trimesh.Trimesh(), name=stem).save(path, file_type=file_type)


def strict_json(report: Report) -> str:
    """The report as JSON; raises if a number is not finite."""
    return json.dumps(dataclasses.asdict(report), allow_nan=False, default=np.ndarray.tolist)


def random_hull(seed: int, count: int = 24) -> trimesh.Trimesh:
    return hull_of(np.random.default_rng(seed).normal(size=(count, 3)))


def moved(hull: trimesh.Trimesh, scale: float, shift: npt.ArrayLike) -> trimesh.Trimesh:
    return hull_of(hull.vertices * scale + np.asarray(shift))


def assert_same_hulls(one: Iterable[trimesh.Trimesh], *others: Iterable[trimesh.Trimesh]) -> None:
    """To the bit, in the same order."""
    first, *rest = ([(hull.vertices.tobytes(), hull.faces.tobytes()) for hull in hulls] for hulls in (one, *others))
    assert all(hulls == first for hulls in rest)


def assert_convex_hull(mesh: trimesh.Trimesh) -> None:
    """Closed, outward oriented, no face degenerate, and no vertex above any face: in exact arithmetic."""
    assert why_not_convex(np.asarray(mesh.vertices), np.asarray(mesh.faces), exactly=True) is None


def assert_covers(
    hulls: Iterable[trimesh.Trimesh], vertices: npt.ArrayLike, faces: npt.ArrayLike, within: float = 5e-3
) -> None:
    """Every hull is valid, and the input's surface is not farther from them than repair may move it."""
    points, triangles, valid = np.asarray(vertices, dtype=np.float64), np.asarray(faces, dtype=np.int32), []
    for hull in hulls:
        assert_convex_hull(hull)
        assert hull.volume > 0
        valid.append(Hull(np.asarray(hull.vertices), np.asarray(hull.faces, dtype=np.int32), hull.volume))
    assert valid
    longest = np.ptp(points, axis=0).max()
    assert hull_distances(valid, points, triangles, 1e-3 * longest, floor=0.0).under[0] <= within * longest / 2
