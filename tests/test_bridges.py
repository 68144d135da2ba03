"""Parts are united across what lies between them, where what the solid fills of their joint hull is tight."""

from __future__ import annotations

from collections.abc import Callable, Iterator

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st
from manifold3d import CrossSection, Manifold, Mesh64, OpType

import rlacd
from rlacd import _native
from rlacd.criteria import Concavity
from rlacd.criteria.criterion import Feasibility
from rlacd.criteria.navigable import Navigable
from rlacd.merge import merge_parts
from rlacd.merge.merge import united_in_turn
from rlacd.run import Run, Work
from rlacd.solid.component import ClippedPart, Component, Part, Plane, reunite
from rlacd.solid.hull import Hull
from rlacd.solid.manifold import to_manifold
from rlacd.solid.primitive import Balls
from tests.shapes import block, strangers

TIGHT = Concavity(0.02)


CROSS = block(2, 0.3, 0.3) + block(0.3, 2, 0.3)


def arms_and_beam(solid: Manifold) -> tuple[Component, list[Part]]:
    """The solid, and what lies left of x = -0.15, right of x = 0.15 and between."""
    root = Component(solid)
    left, rest = root.cut(Plane((1.0, 0.0, 0.0), -0.15))
    middle, right = rest.cut(Plane((1.0, 0.0, 0.0), 0.15))
    return root, [left, middle, right]


@pytest.fixture
def run() -> Iterator[Run]:
    with Run(2) as pool:
        yield pool


def test_a_beam_is_one_part_although_another_crosses_it(run: Run) -> None:
    root, parts = arms_and_beam(CROSS)
    assert len(merge_parts(parts, TIGHT, run)) == 3
    merged = merge_parts(parts, TIGHT, run, solid=root)
    assert sorted(part.hull.volume for part in merged) == pytest.approx([2 * 0.09, 2 * 0.09])
    assert all(part.volume == pytest.approx(2 * 0.09) for part in merged)  # the crossing belongs to both
    (beam,) = (part for part in merged if isinstance(part, ClippedPart))
    assert set(beam.members) == {parts[0], parts[2]}
    assert TIGHT.error(beam) < 1e-3


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
    root, parts = arms_and_beam(solid)
    merged = merge_parts(parts, TIGHT, run, solid=root)
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
    assert found.report["concavity"]["max"] < 1e-3


def test_what_is_united_with_a_share_is_a_share(run: Run) -> None:
    """Gluing would count what two of them have in common twice."""
    root, parts = arms_and_beam(CROSS)
    merged = merge_parts(parts, TIGHT, run, solid=root)
    *_, ((whole,), _) = united_in_turn(merged, Part.glued, TIGHT, Work(), run)
    assert isinstance(whole, ClippedPart)
    assert whole.volume == pytest.approx(CROSS.volume())
    united = reunite(strangers(whole.members))
    assert united.volume == pytest.approx(CROSS.volume())


def heap_of_blocks(random: np.random.Generator) -> tuple[Component, list[Manifold]]:
    """The union of four blocks that may overlap, and the blocks."""
    sizes, places = random.uniform(0.1, 1, (4, 3)), random.uniform(-0.4, 0.4, (4, 3))
    blocks = [block(*s, tuple(p)) for s, p in zip(sizes, places, strict=True)]
    return Component(Manifold.batch_boolean(blocks, OpType.Add)), blocks


def share_fits(solid: Component, hull: Hull, threshold: float) -> bool | None:
    """Whether what the solid fills of a hull meets the strict test; None where it is empty."""
    share = to_manifold(solid.vertices, solid.faces) ^ Manifold(Mesh64(hull.vertices + 0, hull.faces.astype(np.uint64)))
    mesh = share.to_mesh64()
    vertices = np.ascontiguousarray(mesh.vert_properties[:, :3])
    if len(vertices) == 0:
        return None
    return _native.meets_concavity(
        vertices, mesh.tri_verts.astype(np.int32), hull.vertices, hull.faces, share.volume(), hull.volume, threshold
    )


@settings(deadline=None, max_examples=60)
@given(st.integers(0, 10**6), st.floats(0.01, 0.5))
def test_a_quick_no_is_never_wrong(seed: int, threshold: float) -> None:
    """Held against the strict test of the share itself, for hulls of corners of random heaps of blocks."""
    random = np.random.default_rng(seed)
    solid, _ = heap_of_blocks(random)
    hull = Hull.of(random.permutation(solid.vertices)[: int(random.integers(4, 12))])
    assume(hull is not None and hull.volume >= 1e-4)
    fits = share_fits(solid, hull, threshold)
    feasibility = Concavity(threshold).screen.feasibility(solid.filling, hull)
    assume(fits is not None)
    assert not (fits and feasibility is not Feasibility.MAYBE)
    larger = Hull.of(np.concatenate([hull.vertices, random.uniform(-1, 1, (3, 3))]))
    assert Concavity(threshold).screen.forbids(solid.filling, hull) == (feasibility is Feasibility.NEVER)
    if feasibility is Feasibility.NEVER:
        assert Concavity(threshold * (1 - 1e-9)).screen.feasibility(solid.filling, larger) is Feasibility.NEVER


@settings(deadline=None, max_examples=40)
@given(st.integers(0, 10**6), st.floats(0.01, 0.5))
def test_a_quick_no_about_a_pair_is_never_wrong(seed: int, threshold: float) -> None:
    """Nor does anything get lost by leaving out the facets of the two hulls, here blocks that the solid fills."""
    solid, blocks = heap_of_blocks(np.random.default_rng(seed))
    hulls = [hull for b in blocks if (hull := Hull.of(b.to_mesh64().vert_properties[:, :3].astype(float))) is not None]
    pairs = np.array([(i, j) for j in range(len(hulls)) for i in range(j)], dtype=np.int32)
    corners = [hull.corners for hull in hulls]
    _, feasibilities = Concavity(threshold).screen.feasibilities(solid.filling, corners, pairs, 1)
    for (i, j), feasibility in zip(pairs, feasibilities, strict=True):
        joint = Hull.around(hulls[i], hulls[j])
        alone = Concavity(threshold).screen.feasibility(solid.filling, joint)
        assert (feasibility == Feasibility.MAYBE) <= (alone is Feasibility.MAYBE)
        assert (feasibility == Feasibility.NEVER) <= (alone is Feasibility.NEVER)
        assert not (share_fits(solid, joint, threshold) and feasibility != Feasibility.MAYBE)


def test_time_may_run_out_before_pairs_are_looked_at() -> None:
    root, parts = arms_and_beam(CROSS)
    late = Run(1, timeout=-1.0)
    assert len(merge_parts(parts, TIGHT, late, solid=root)) == len(parts)
    assert late.stopped_by == "timeout"


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
        assert Concavity(threshold).screen.feasibility(whole.filling, whole.hull) is Feasibility.NEVER
    assert Concavity(deep_enough).screen.feasibility(whole.filling, whole.hull) is Feasibility.MAYBE


def test_a_solid_that_overlaps_itself_can_be_reunited() -> None:
    """Volumes of its pieces count twice what overlaps; that is no loss."""
    folded = Manifold.compose([block(2, 0.5, 0.5), block(0.5, 2, 0.02, (0.3, 0, 0))])
    pieces = [Component(piece) for piece in folded.split_by_plane((1, 0.2, 0.1), 0.1)]
    united = reunite(pieces)
    assert united.volume == pytest.approx((block(2, 0.5, 0.5) + block(0.5, 2, 0.02, (0.3, 0, 0))).volume(), rel=1e-6)


def test_balls_do_not_ask_what_is_inside_a_hull() -> None:
    component = Component(CROSS)
    space = Navigable(0.1, 0.05, Balls(np.zeros((0, 3)), np.zeros(0)))
    assert space.screen.feasibility(component.filling, component.hull) is Feasibility.NEVER
    assert not space.screen.forbids(component.filling, component.hull)
