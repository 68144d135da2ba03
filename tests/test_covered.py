"""What a state covers, every later state covers: whatever the shape, the options, and where the work is stopped."""

from __future__ import annotations

import os
import pkgutil
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
import numpy.typing as npt
import pytest
import trimesh
from hypothesis import example, given, settings
from hypothesis import strategies as st
from manifold3d import Manifold, OpType

import rlacd
from rlacd import _native
from rlacd.criteria import Concavity
from rlacd.finish.finish import covers
from rlacd.planes.sweep import SweepCache
from rlacd.policies import make_policy
from rlacd.proxy.model import Transfer
from rlacd.proxy.simplify import simplify
from rlacd.run import Run
from rlacd.solid.component import Component, Part
from rlacd.solid.distance import hull_union
from rlacd.solid.frame import Frame
from rlacd.solid.hull import Hull
from tests.shapes import block, component_of, table, trimesh_of
from tests.shapes_large import boxes

Floats = npt.NDArray[np.float64]

FEW = 500
"""Solids of so many triangles count as dense here, so that a dense one takes a tenth of a second."""

OUTSIDE = 2e-3
"""Share of the longest side that a point may lie outside all hulls: what sheets are moved by, and more."""


def bumpy(seed: int, scale: Sequence[float], at: Sequence[float]) -> trimesh.Trimesh:
    mesh = trimesh.creation.icosphere(2)
    waves = 2 * np.random.default_rng(seed).normal(size=(3, 3))
    mesh.vertices *= (1 + 0.03 * np.sin(mesh.vertices @ waves.T).sum(axis=1))[:, None]
    mesh.apply_scale(scale)
    mesh.apply_translation(at)
    return mesh


def spoon(seed: int) -> trimesh.Trimesh:
    """A bowl, a bent stem and an end, in one body."""
    bowl = bumpy(seed, (0.35, 0.22, 0.1), (0, 0, 0))
    stem, end = bumpy(seed + 1, (1.1, 0.06, 0.05), (1.2, 0, 0.02)), bumpy(seed + 2, (0.2, 0.12, 0.06), (2.2, 0, 0.05))
    mesh = trimesh.boolean.union([bowl, stem, end], engine="manifold")
    vertices = mesh.vertices + np.column_stack(
        [*np.zeros((2, len(mesh.vertices))), 0.15 * np.sin(2 * mesh.vertices[:, 0])]
    )
    return trimesh.Trimesh(vertices, mesh.faces, process=False)


def thin(seed: int) -> trimesh.Trimesh:
    """A thin plate with a hole, on a thin wall."""
    x, y, hole = np.random.default_rng(seed).uniform([0.5, 0.5, 0.1], [2, 2, 0.4])
    return trimesh_of(block(x, y, 0.01) - block(hole, hole, 1) + block(x, 0.01, 0.6, (0, y / 2, 0.3)))


def open_box(seed: int) -> trimesh.Trimesh:
    """A box without a lid or thickness, turned, with some of its triangles gone."""
    random = np.random.default_rng(seed)
    mesh = trimesh.creation.box(random.uniform(0.3, 2, 3))
    mesh = trimesh.Trimesh(*trimesh.remesh.subdivide(mesh.vertices, mesh.faces[2:]), process=False)
    mesh.apply_transform(trimesh.transformations.random_rotation_matrix(random.random(3)))
    return trimesh.Trimesh(mesh.vertices, mesh.faces[random.random(len(mesh.faces)) < 0.9], process=False)


def bodies(seed: int) -> trimesh.Trimesh:
    """Turned boxes that touch, cross, or stand apart."""
    random = np.random.default_rng(seed)
    vertices, faces = boxes(12)
    each = np.asarray(vertices, dtype=np.float64).reshape(12, -1, 3)
    return trimesh.Trimesh((each + random.uniform(-1, 1, (12, 1, 3))).reshape(-1, 3), faces, process=False)


SHAPES: dict[str, Callable[[int], trimesh.Trimesh]] = {
    "dense": spoon,
    "thin": thin,
    "open": open_box,
    "many bodies": bodies,
}


def outside(mesh: trimesh.Trimesh, hulls: Sequence[trimesh.Trimesh]) -> float:
    """The share of a surface outside all hulls, from samples and half-spaces, by numpy alone."""
    random, corners = np.random.default_rng(0), np.asarray(mesh.vertices)[mesh.faces]
    areas = np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1)
    on = corners[random.choice(len(corners), 4000, p=areas / areas.sum())]
    points = np.einsum("nk,nkd->nd", random.dirichlet([1, 1, 1], len(on)), on)
    tolerance, is_out = OUTSIDE * np.ptp(points, axis=0).max(), np.ones(len(points), dtype=bool)
    for hull in hulls:
        a, b, c = (np.asarray(hull.vertices)[hull.faces[:, k]] for k in range(3))
        normals = np.cross(b - a, c - a)
        lengths = np.linalg.norm(normals, axis=1)
        normals, a = normals[lengths > 0] / lengths[lengths > 0][:, None], a[lengths > 0]
        is_out &= (points @ normals.T - (normals * a).sum(axis=1)).max(axis=1) > tolerance
    return float(is_out.mean())


@st.composite
def options(draw: st.DrawFn) -> dict[str, Any]:
    """Options of every stage; at most one of those that exclude each other."""
    chosen: dict[str, Any] = {"quality": draw(st.sampled_from(["fast", "fast", "fast", "balanced"]))}
    chosen |= draw(
        st.sampled_from(
            [
                *({"max_vertices": most} for most in (6, 8, 12, 16, 24, 32)),
                *({"max_faces": most} for most in (8, 20, 60)),
                *({"preset": name} for name in ("unreal", "physx-gpu", "mujoco")),
                {},
            ]
        )
    )
    chosen |= draw(st.sampled_from([{}, {}, {"max_hulls": 1}, {"max_hulls": 3}, {"max_hulls": 8}]))
    chosen |= draw(
        st.sampled_from(
            [
                {},
                {"threshold": 0.02},
                {"threshold": 0.15},
                {"overlap": 0.01},
                {"primitives": ("box", "sphere", "capsule", "cylinder")},
                {"detail": "full"},
                {"merge": False},
                {"criterion": "distance"},
                {"criterion": "volume"},
                {"keep_open": 0.5},
            ]
        )
    )
    return chosen | {"threads": 1}


@settings(max_examples=200 if os.environ.get("RLACD_RANDOM") else 8)
@given(st.sampled_from(list(SHAPES)), st.integers(0, 1000), options())
@example("dense", 0, {"quality": "fast", "max_vertices": 24, "threads": 1})
@pytest.mark.promise("covered")
def test_no_option_leaves_any_of_the_surface_outside_all_hulls(shape: str, seed: int, asked: dict[str, Any]) -> None:
    mesh = SHAPES[shape](seed)
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("rlacd.find_parts.DENSE", FEW)
        result = rlacd.decompose(mesh, **asked)
    assert outside(mesh, result.hulls) == 0


STAGES: dict[str, Callable[..., Any]] = {
    "rlacd.find_parts.cut_and_merge": lambda tree, *_, of: [(tree.root, of.pieces), (tree.root, of.parts or of.pieces)],
    "rlacd.proxy.model.cut_and_merge": lambda tree, *_, of: [(tree.root, of.parts)],
    "rlacd.extras.limit.cut_and_merge": lambda tree, *_, of: [(tree.root, of.parts or of.pieces)],
    "rlacd.find_parts.grow_cover": lambda parts, *_, of: [(parts[0].whole, of)],
    "rlacd.find_parts.eliminate_parts": lambda context, *_, of: [(context.root, of)],
    "rlacd.extras.limit.eliminate_parts": lambda context, *_, of: [(context.root, of)],
    "rlacd.find_parts.search": lambda context, *_, of: [(context.root, parts) for parts in of[0]],
    "rlacd.proxy.model.Transfer.__call__": lambda self, *_, of: [(self.solid, of[0])],
    "rlacd.proxy.model.Transfer.moved": lambda self, *_, of: [(self.solid, of)],
    "rlacd.extras.limit.cut_to_limits": lambda parts, limited, solid, *_, of: [(solid, of)],
    "rlacd.extras.limit.at_most": lambda most, decompositions, whole, *_, of: [(whole, of)],
    "rlacd.extras.finish.overlap.overlap_parts": lambda parts, solid, *_, of: [(solid, of[0])],
    "rlacd.finish.finish.cleaned_parts": lambda reached, *_, of: [(reached.root, of[0])],
}
"""The functions of the stages, and the states that each leaves, with the solid that each is a state of."""


def watch(patch: pytest.MonkeyPatch, stages: dict[str, Callable[..., Any]], look: Callable[[str, Any], object]) -> None:
    """Have every state that a stage leaves looked at, with the name of the stage."""

    def watched(path: str, stage: Callable[..., Any]) -> Callable[..., Any]:
        def run(*arguments: Any, **named: Any) -> Any:
            result = stage(*arguments, **named)
            for state in stages[path](*arguments, of=result):
                look(path, state)
            return result

        return run

    for path in stages:
        patch.setattr(path, watched(path, pkgutil.resolve_name(path)))


def is_covered(root: Component, parts: Sequence[Part]) -> bool:
    with Run(1) as run, run.shielded():
        return covers(parts, root.vertices, root.faces, run)


@pytest.fixture
def left(monkeypatch: pytest.MonkeyPatch) -> dict[str, list[bool]]:
    """Whether each state that a stage leaves covers its solid, by the stage."""
    found: dict[str, list[bool]] = {}
    monkeypatch.setattr("rlacd.find_parts.DENSE", FEW)
    watch(monkeypatch, STAGES, lambda path, state: found.setdefault(path, []).append(is_covered(*state)))
    return found


@pytest.mark.parametrize("asked", [{"quality": "fast", "max_vertices": 16}, {"max_hulls": 2}, {"overlap": 0.01}])
@pytest.mark.parametrize("mesh", [spoon(0), table()], ids=["dense", "simple"])
def test_every_stage_leaves_what_covers_the_solid(
    left: dict[str, list[bool]], mesh: trimesh.Trimesh, asked: dict[str, Any]
) -> None:
    rlacd.decompose(mesh, threads=1, **asked)
    assert {"rlacd.find_parts.cut_and_merge", "rlacd.finish.finish.cleaned_parts"} <= left.keys()
    assert all(all(states) for states in left.values()), left


@pytest.mark.parametrize("stage", ["cut", "merge", "transfer", "limit"])
def test_a_stop_in_any_stage_leaves_what_covers_the_solid(left: dict[str, list[bool]], stage: str) -> None:
    result = rlacd.decompose(
        spoon(0), quality="fast", max_vertices=16, threads=1, progress=lambda now: now.stage != stage
    )
    assert result.report.stopped_by == "cancel"
    assert all(all(states) for states in left.values()), left
    assert outside(spoon(0), result.hulls) == 0


@pytest.mark.parametrize("dense", [True, False])
def test_a_state_that_misses_what_the_one_before_covers_is_not_the_result(
    dense: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    mesh = spoon(0) if dense else table()
    monkeypatch.setattr("rlacd.find_parts.DENSE", FEW)
    monkeypatch.setattr("rlacd.extras.limit.cut_to_limits", lambda parts, *_: parts[:1])
    result = rlacd.decompose(mesh, quality="fast", max_vertices=12, threads=1)
    assert outside(mesh, result.hulls) == 0
    assert max(len(hull.vertices) for hull in result) <= 12
    assert not any("outside the hulls" in sentence for sentence in result.report.warnings)


def test_a_stopped_run_measures_its_parts_on_the_solid_not_on_the_copy(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("rlacd.find_parts.DENSE", FEW)
    monkeypatch.setattr("rlacd.run.run.FINISH", 60.0)  # enough on any machine
    mesh = spoon(3)
    frame = Frame.of(mesh.vertices)
    solid = Component((frame.to_frame(mesh.vertices), mesh.faces.astype(np.int32)))
    result = rlacd.decompose(
        mesh, quality="fast", detail="full", threads=1, progress=lambda now: now.stage != "transfer"
    )
    assert result.report.stopped_by == "cancel"
    assert result.report.concavity.per_part is not None
    for hull, error in zip(result, result.report.concavity.per_part, strict=True):
        around = Hull.of(frame.to_frame(hull.vertices))
        assert error == pytest.approx(Concavity(0.05).error(Part(around, (), solid)), abs=1e-4)


def test_a_transfer_without_time_leaves_hulls_that_cover_the_solid() -> None:
    mesh = spoon(0)
    solid = component_of(mesh)
    proxy, policy = simplify(solid, 0.05), make_policy("greedy", SweepCache(), None)
    assert proxy is not None
    with Run(1) as run:
        run.stop.trip()
        parts, _ = Transfer(solid, proxy, Concavity(0.05), policy, run)([proxy.component])
    assert is_covered(solid, parts)
    assert all(part.whole is solid for part in parts)


# --- the pieces of all parts are a partition of the solid -------------------------------------------------------------


PIECES: dict[str, Callable[..., Any]] = {
    **dict.fromkeys(
        ["rlacd.find_parts.cut_and_merge", "rlacd.search.levels.cut_and_merge"],
        lambda *_, of: [of.pieces, of.parts or of.pieces],
    ),
    **dict.fromkeys(["rlacd.find_parts.grow_cover", "rlacd.find_parts.eliminate_parts"], lambda *_, of: [of]),
    "rlacd.find_parts.search": lambda *_, of: of[0],
}

SLIVERS = 1e-5
"""Share of the volume that may be lost as slivers."""

TOUCHING = 1e-8
"""How far a corner of a piece may lie outside its part's hull, by rounding."""


def assert_partition(parts: Sequence[Part]) -> None:
    whole = parts[0].whole
    assert all(part.whole is whole for part in parts), "pieces of one solid"
    volume = sum(piece.volume for part in parts for piece in part.members)
    assert (1 - SLIVERS) * whole.volume <= volume <= (1 + 1e-6) * whole.volume
    for part in parts:
        corners = np.concatenate([piece.vertices[np.unique(piece.faces)] for piece in part.members])
        assert hull_union([part.hull], 1).distance(corners, 1).max() <= TOUCHING


def hash_sign() -> trimesh.Trimesh:
    """Four bars that cross: hulls overlap there, pieces do not."""
    bars = [block(2, 0.2, 0.2, (0, y, 0)) for y in (-0.5, 0.5)] + [block(0.2, 2, 0.2, (x, 0, 0)) for x in (-0.5, 0.5)]
    return trimesh_of(Manifold.batch_boolean(bars, OpType.Add))


def ring() -> trimesh.Trimesh:
    return trimesh.creation.torus(1.0, 0.2, major_sections=24, minor_sections=12)


@pytest.mark.parametrize("asked", [{"quality": "fast"}, {}, {"criterion": "distance"}, {"criterion": "volume"}])
@pytest.mark.parametrize("mesh", [table(), hash_sign(), ring()], ids=["table", "crossing", "ring"])
def test_pieces_of_the_parts_lie_in_their_hulls_and_are_a_partition_after_each_stage(
    mesh: trimesh.Trimesh, asked: dict[str, Any], monkeypatch: pytest.MonkeyPatch
) -> None:
    seen = set[str]()
    watch(monkeypatch, PIECES, lambda path, parts: (assert_partition(parts), seen.add(path)))
    rlacd.decompose(mesh, threads=1, **asked)
    assert "rlacd.find_parts.cut_and_merge" in seen


def test_a_stop_while_bodies_are_made_exact_ends_with_what_was_merged(monkeypatch: pytest.MonkeyPatch) -> None:
    def stopped(*_: object) -> list[Part]:
        raise _native.Stopped

    monkeypatch.setattr("rlacd.find_parts.grown_parts", stopped)
    result = rlacd.decompose(hash_sign(), threads=1)
    assert not result.report.complete
    assert outside(hash_sign(), list(result)) == 0
