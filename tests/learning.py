"""A folder of small meshes to train on in tests, and the policy that both `decompose` and the environment are given."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from manifold3d import Manifold

from rlacd.planes.sweep import paper_planes, sweep, valid_planes
from rlacd.solid.component import Component, Plane
from tests.shapes import box, trimesh_of


def small_solids() -> dict[str, Manifold]:
    """An angle, a table, a cross, two links that nothing joins, and a box that needs no cut."""
    table = box((0, 0, 1), (2, 1.5, 1.1))
    for x in (0, 1.85):
        for y in (0, 1.35):
            table += box((x, y, 0), (x + 0.15, y + 0.15, 1))
    return {
        "angle": box((0, 0, 0), (2, 1, 0.3)) + box((0, 0, 0), (0.3, 1, 1.5)),
        "table": table,
        "cross": box((-1, -0.2, -0.2), (1, 0.2, 0.2)) + box((-0.2, -1, -0.2), (0.2, 1, 0.2)),
        "apart": box((0, 0, 0), (1, 1, 1)) + (box((3, 0, 0), (4, 1, 1)) - box((3.3, 0.3, 0), (4, 1, 1))),
        "box": box((0, 0, 0), (1, 2, 3)),
    }


def write_meshes(folder: Path) -> Path:
    """Write them, and a file that is no mesh."""
    (folder / "deeper").mkdir(parents=True)
    for name, solid in small_solids().items():
        place = folder / "deeper" if name == "table" else folder
        trimesh_of(solid).export(place / f"{name}.ply")
    (folder / "broken.ply").write_bytes(b"ply\nnothing of the kind")
    return folder


def greedy_plane(component: Component) -> int | None:
    """Number of the valid plane of least hull sum."""
    candidates = paper_planes(component)
    scored = sweep(component, candidates)
    cost = np.where(valid_planes(component, candidates), scored.hull_below + scored.hull_above, np.inf)
    return int(cost.argmin()) if np.isfinite(cost).any() else None


class GreedyOverMask:
    """The same as a policy of `decompose`."""

    def choose(self, component: Component, threads: int = 1) -> Plane | None:
        number = greedy_plane(component)
        return None if number is None else paper_planes(component).plane(number)
