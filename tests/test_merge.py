"""Merging: what may be united is, also across what lies between, and what may not stays; bars that cross; slivers."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from manifold3d import CrossSection, Manifold, Mesh64, OpType

import rlacd
from rlacd.criteria import Concavity
from rlacd.cut import CutTree
from rlacd.cut_and_merge import cut_and_merge
from rlacd.merge import grow_cover, merge_parts
from rlacd.merge.grow import SLIVER_LOSS, drop_slivers
from rlacd.planes.sweep import SweepCache
from rlacd.policies import make_policy
from rlacd.run import Run
from rlacd.solid.component import Component, Part, Plane, reunite
from rlacd.solid.hull import Hull
from tests.shapes import (
    block,
    box,
    dense,
    depth_outside,
    from_manifold,
    own_volume,
    to_manifold,
)


def pieces_of(solid: Manifold, *planes: Plane) -> list[Component]:
    parts = [Component(solid)]
    for plane in planes:
        parts = [piece for part in parts for side in part.cut(plane) if side is not None for piece in side.pieces()]
    return parts


def along(normal: tuple[float, float, float], offset: float) -> Plane:
    unit = np.array(normal) / np.linalg.norm(normal)
    return Plane((float(unit[0]), float(unit[1]), float(unit[2])), offset)


@pytest.fixture
def run():
    with Run(2) as pool:
        yield pool


# --- slivers ----------------------------------------------------------------------------------------------------------


def slab(height: float, z: float = 0.0) -> Component:
    return Component(Manifold.cube((1, 1, height)).translate((0, 0, z)))


def test_a_sliver_goes_only_where_others_stand_for_it() -> None:
    solid, sliver, sheet = slab(1), slab(0.001, 1), slab(0.001, 3)
    with Run(1) as run:
        assert drop_slivers([solid, sliver, sheet], run) == [solid, sheet]
        assert drop_slivers([sheet], run) == [sheet]


def test_of_a_stack_of_slivers_enough_stay_for_all_of_them() -> None:
    stack = [slab(0.001 + 1e-6 * i, 0.0015 * i) for i in range(30)]
    with Run(1) as run:
        kept = drop_slivers(stack, run)
    assert len(kept) < len(stack)
    tops = np.array([part.vertices[:, 2].max() for part in kept])
    for part in stack:
        assert np.abs(tops - part.vertices[:, 2].max()).min() <= SLIVER_LOSS + 0.0015


# --- growing ----------------------------------------------------------------------------------------------------------


CRITERION = Concavity(0.05)


def bars(count: int, seed: int) -> Component:
    """A connected solid of long bars at random, in the frame."""
    draw, solid = np.random.default_rng(seed), []
    for _ in range(count):
        half = draw.uniform((0.5, 0.06, 0.06), (1.0, 0.12, 0.12))
        bar = box(tuple(-half), tuple(half)).rotate(draw.uniform(0, 360, 3))
        solid.append(bar.translate(draw.uniform(-0.4, 0.4, 3)))
    return Component(max(Manifold.batch_boolean(solid, OpType.Add).decompose(), key=lambda body: body.volume()))


def merged(solid: Component, run: Run) -> list[Part]:
    tree = CutTree(solid, make_policy("greedy", SweepCache(), None), run)
    return cut_and_merge(tree, CRITERION, run).parts


@settings(max_examples=15, deadline=None)
@given(st.integers(2, 5), st.integers(0, 1000), st.floats(0.05, 0.1))
def test_what_grows_holds_its_hull_and_the_solid_comes_no_deeper_into_it(count: int, seed: int, depth: float) -> None:
    solid = bars(count, seed)
    with Run(1) as run:
        piece = max((member for part in merged(solid, run) for member in part.members), key=lambda one: one.volume)
    spaces = solid.against.grown(piece.hull.body, depth)
    normals, offsets = spaces[:, :3], spaces[:, 3]
    assert (piece.hull.vertices @ normals.T <= offsets + 1e-9).all()
    inside = (offsets - dense(from_manifold(to_manifold(solid.vertices, solid.faces))) @ normals.T).min(axis=1)
    assert inside.max() <= depth + 1e-9


def test_bars_that_cross_take_fewer_parts_that_are_tight_and_lose_nothing() -> None:
    solid, found = bars(8, 0), []
    for threads in (1, 2, 3):
        with Run(threads) as run:
            before = merged(solid, run)
            found.append(grow_cover(before, CRITERION, run))
    after, whole = found[0], to_manifold(solid.vertices, solid.faces)
    assert len(after) < len(before)
    for part in after:
        assert CRITERION.is_met(Part(part.hull, (), Component(whole))), "with the volume of all that is in the hull"
    assert depth_outside(dense(from_manifold(whole)), after) < 5e-3, "no more than slivers"
    assert own_volume(after) == pytest.approx(solid.volume, rel=1e-2)
    for others in found[1:]:
        assert [part.hull.vertices.tobytes() for part in others] == [part.hull.vertices.tobytes() for part in after]


@pytest.mark.parametrize("units", [0, 3_000, 30_000])
def test_without_enough_work_the_merged_parts_stay(units: int) -> None:
    solid = bars(8, 0)
    with Run(1) as run:
        parts = merged(solid, run)
        with run.limited(units):
            assert grow_cover(parts, CRITERION, run) is parts
        assert run.stopped_by is None


TIGHT = Concavity(0.02)


CROSS = block(2, 0.3, 0.3) + block(0.3, 2, 0.3)


def arms_and_beam(solid: Manifold) -> list[Part]:
    """What of the solid lies left of x = -0.15, right of x = 0.15 and between."""
    left, rest = Component(solid).cut(Plane((1.0, 0.0, 0.0), -0.15))
    middle, right = rest.cut(Plane((1.0, 0.0, 0.0), 0.15))
    return [left, middle, right]


@pytest.mark.parametrize(
    "solid",
    [
        block(2, 0.3, 0.3) - block(0.3, 0.3, 0.2) + block(0.3, 2, 0.1, (0, 0, -0.1)),  # air between
        CROSS - block(0.2, 0.2, 2),  # a bore through the crossing
        CROSS - block(0.2, 0.2, 0.2),  # a bubble inside it
        block(0.85, 0.3, 0.3, (-0.575, 0, 0)) + block(0.85, 0.3, 0.3, (0.575, 0, 0.25)) + block(0.3, 2, 1),  # beside
    ],
)
def test_arms_stay_apart_where_something_is_missing_between(run: Run, solid: Manifold) -> None:
    parts = arms_and_beam(solid)
    merged = merge_parts(parts, TIGHT, run)
    assert not any({parts[0], parts[2]} <= set(part.members) for part in merged)


def test_hulls_of_crossing_beams_cover_them_and_no_more() -> None:
    bars = [block(2, 0.2, 0.2, (0, y, 0)) for y in (-0.5, 0.5)] + [block(0.2, 2, 0.2, (x, 0, 0)) for x in (-0.5, 0.5)]
    window = Manifold.batch_boolean(bars, OpType.Add)
    mesh = window.to_mesh64()
    found = rlacd.decompose((mesh.vert_properties[:, :3], mesh.tri_verts), threshold=0.02, quality="fast", threads=1)
    assert len(found) == 4
    hulls = [Manifold(Mesh64(np.array(h.vertices), np.array(h.faces, dtype=np.uint64))) for h in found]
    assert (window - Manifold.batch_boolean(hulls, OpType.Add)).volume() == pytest.approx(0, abs=1e-9)
    assert all((hull - window).volume() == pytest.approx(0, abs=1e-9) for hull in hulls)
    assert found.report.concavity.max < 1e-3


def heap_of_blocks(random: np.random.Generator) -> tuple[Component, list[Manifold]]:
    """The union of four blocks that may overlap, and the blocks."""
    sizes, places = random.uniform(0.1, 1, (4, 3)), random.uniform(-0.4, 0.4, (4, 3))
    blocks = [block(*s, tuple(p)) for s, p in zip(sizes, places, strict=True)]
    return Component(Manifold.batch_boolean(blocks, OpType.Add)), blocks


@settings(deadline=None, max_examples=60)
@given(st.integers(0, 10**6), st.floats(0.01, 0.5))
def test_a_quick_no_about_a_pair_is_never_wrong(seed: int, threshold: float) -> None:
    """Held against the strict test of the joint hull, for random blocks that the solid fills.

    Nor does anything get lost by leaving out the facets of the two hulls.
    """
    random = np.random.default_rng(seed)
    solid, blocks = heap_of_blocks(random)
    hulls = [hull for b in blocks if (hull := Hull.of(b.to_mesh64().vert_properties[:, :3].astype(float))) is not None]
    pairs = np.array([(i, j) for j in range(len(hulls)) for i in range(j)], dtype=np.int32)
    volumes = solid.against.feasible_volumes([hull.body for hull in hulls], pairs, threshold, 1)
    for (i, j), volume in zip(pairs, volumes, strict=True):
        joint = Hull.around(hulls[i], hulls[j])
        assert volume == np.inf or volume == pytest.approx(joint.volume)
        is_deep = solid.against.comes_deeper(joint.body, threshold)
        assert np.isfinite(volume) or is_deep or solid.against.leads_farther(joint.body, threshold)
        if is_deep:
            larger = Hull.of(np.concatenate([joint.vertices, random.uniform(-1, 1, (3, 3))]))
            assert solid.against.comes_deeper(larger.body, threshold * (1 - 1e-9))


def grooved() -> Manifold:
    """A groove from end to end: its corners lie on the hull, its bottom deep inside; the hull is nowhere far away."""
    groove = CrossSection([[(-0.04, 0.0), (0.0, -0.3), (0.04, 0.0)]])
    return block(1, 1, 1, (0, -0.5, 0)) - Manifold.extrude(groove, 1).translate((0, 0, -0.5))


@pytest.mark.parametrize(
    ("solid", "too_deep", "deep_enough"),
    [
        (grooved, (0.05, 0.1, 0.29), 0.31),
        (lambda: block(4, 4, 0.3) - block(0.3, 0.3, 1, (0.83, -1.41, 0)), (0.1,), 0.2),
    ],
    ids=["a face deep in a hull without its corners", "a window between the points first looked at"],
)
def test_what_is_deep_in_a_hull_is_seen(
    solid: Callable[[], Manifold], too_deep: tuple[float, ...], deep_enough: float
) -> None:
    whole = Component(solid())
    for threshold in too_deep:
        assert whole.against.comes_deeper(whole.hull.body, threshold)
    assert not whole.against.comes_deeper(whole.hull.body, deep_enough)
    assert not whole.against.leads_farther(whole.hull.body, deep_enough)


def test_a_solid_that_overlaps_itself_can_be_reunited() -> None:
    """Volumes of its pieces count twice what overlaps; that is no loss."""
    folded = Manifold.compose([block(2, 0.5, 0.5), block(0.5, 2, 0.02, (0.3, 0, 0))])
    pieces = [Component(piece) for piece in folded.split_by_plane((1, 0.2, 0.1), 0.1)]
    united = reunite(pieces)
    assert united.volume == pytest.approx((block(2, 0.5, 0.5) + block(0.5, 2, 0.02, (0.3, 0, 0))).volume(), rel=1e-6)
