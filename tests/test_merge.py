"""Merging: what may be united is, what may not stays, judged on the glued union."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from manifold3d import Manifold, OpType

from rlacd import _native
from rlacd.criteria import Concavity
from rlacd.cut import CutTree
from rlacd.cut_and_merge import cut_and_merge
from rlacd.merge import grow_cover, merge_parts
from rlacd.planes.sweep import SweepCache
from rlacd.policies import make_policy
from rlacd.run import Run
from rlacd.solid.component import Component, Part, Plane
from tests.shapes import bent_bar, box, dense, from_manifold, own_volume, to_manifold, together
from tests.test_redistribute import depth_outside
from tests.test_sweep import SOLIDS


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


def test_a_shattered_box_becomes_one_part(run) -> None:
    parts = pieces_of(Manifold.cube((2, 1, 1), True), along((1, 2, 3), 0.1), along((-1, 1, 0.3), 0.0))
    assert len(parts) == 4
    (whole,) = merge_parts(parts, Concavity(0.01), run)
    assert whole.volume == pytest.approx(2)
    assert whole.hull.volume == pytest.approx(2)


def test_parts_of_an_l_never_become_one(run) -> None:
    shape = Manifold.cube((2, 1, 1)) + Manifold.cube((1, 2, 1))
    parts = pieces_of(shape, along((0, 1, 0), 1.0), along((1, 0, 0), 0.5), along((0, 0, 1), 0.3))
    assert len(merge_parts(parts, Concavity(0.05), run)) >= 2


def test_the_inner_surface_of_a_tube_forbids_uniting_its_halves(run) -> None:
    """Joint R_v is small for a thin bore, but its wall lies deep inside the joint hull: both ways have to be tested."""
    tube = Manifold.cube((1, 1, 1), True) - Manifold.cylinder(2, 0.06, 0.06, 24, True)
    parts = pieces_of(tube, along((1, 0, 0), 0.0))
    assert len(merge_parts(parts, Concavity(0.05), run)) >= 2


def test_parts_apart_unite_where_the_gap_is_no_deeper_than_the_threshold(run) -> None:
    def sheets(gap: float) -> list[Component]:
        return [Component(Manifold.cube((1, 1, 0.01)).translate((0, 0, i * (0.01 + gap)))) for i in range(2)]

    assert len(merge_parts(sheets(0.015), Concavity(0.05), run)) == 1
    assert len(merge_parts(sheets(0.2), Concavity(0.05), run)) == 2


def test_a_deep_crack_keeps_parts_apart(run) -> None:
    """The walls of the crack are surface of the union, and lie half a unit inside its hull."""
    blocks = [Component(Manifold.cube((1, 1, 1)).translate((i * 1.001, 0, 0))) for i in range(2)]
    assert len(merge_parts(blocks, Concavity(0.05), run)) == 2


def test_every_part_of_a_merge_meets_the_criterion(run) -> None:
    criterion = Concavity(0.05)
    ring = Manifold.cylinder(0.3, 1, 1, 40, True) - Manifold.cylinder(1, 0.8, 0.8, 40, True)
    parts = pieces_of(ring, *(along((np.cos(a), np.sin(a), 0), 0.0) for a in np.linspace(0, 3, 7)))
    merged = merge_parts(parts, criterion, run)
    assert len(merged) < len(parts)
    assert all(criterion.is_met(part) for part in merged)
    assert sum(part.volume for part in merged) == pytest.approx(sum(part.volume for part in parts))


@pytest.mark.parametrize("across", [False, True])
def test_pairs_of_nearby_boxes(across: bool) -> None:
    random = np.random.default_rng(0)
    for count in (1, 2, 30):
        lower = random.uniform(0, 4, (count, 3))
        parts = {7 * i: Component(box(tuple(at), tuple(at + random.uniform(0.1, 1, 3)))) for i, at in enumerate(lower)}
        corners = {i: part.box for i, part in parts.items()}

        def near(i: int, j: int, corners=corners) -> bool:
            gap = np.maximum(np.maximum(corners[i][0] - corners[j][1], corners[j][0] - corners[i][1]), 0)
            return bool(np.linalg.norm(gap) <= 0.2)

        new = [7 * i for i in range(0, count, 3)]
        expected = {
            (min(i, j), max(i, j))
            for i in new
            for j in parts
            if i != j and (near(i, j) or (across and any(near(i, k) and near(k, j) for k in parts)))
        }
        boxes = _native.Boxes([])
        for number, part in parts.items():
            boxes.add(number, part.hull.corners)
        assert boxes.pairs(new, 0.2, across).tolist() == [list(pair) for pair in sorted(expected)]


@pytest.mark.parametrize("name", SOLIDS)
@pytest.mark.parametrize("seed", range(5))
def test_gluing_undoes_a_cut(name: str, seed: int) -> None:
    solid = Component(SOLIDS[name]())
    rng = np.random.default_rng(seed)
    normal = rng.normal(size=3)
    normal /= np.linalg.norm(normal)
    below, above = solid.cut(Plane(tuple(normal), float(normal @ solid.vertices.mean(axis=0))))
    glued = Part.glued(below, above)
    assert glued.volume == pytest.approx(solid.volume)
    area = _native.mesh_area(glued.vertices, glued.faces)
    assert area == pytest.approx(_native.mesh_area(solid.vertices, solid.faces), rel=1e-5)
    assert glued.hull.volume == pytest.approx(solid.hull.volume)


def test_only_the_common_area_of_two_faces_vanishes() -> None:
    base = Component(Manifold.cube((3, 3, 1)))
    tower = Component(Manifold.cube((1, 1, 2)).translate((1, 1, 1)))
    glued = Part.glued(base, tower)
    assert _native.mesh_area(glued.vertices, glued.faces) == pytest.approx(30 + 10 - 2)
    glued = Part.glued(Component(box((0, 0, 0), (1, 1, 1))), Component(box((2, 0, 0), (3, 1, 1))))
    assert _native.mesh_area(glued.vertices, glued.faces) == pytest.approx(12), "coplanar faces on the same side stay"


def test_parts_that_are_all_film_keep_their_surfaces() -> None:
    """Every face of such a part touches the other one: without a surface there would be nothing to measure."""
    below = Component(Manifold.cube((1, 1, 2e-9)))
    above = Component(Manifold.cube((1, 1, 2e-9)).translate((0, 0, 2e-9)))
    glued = Part.glued(below, above)
    assert len(glued.faces) == len(below.faces) + len(above.faces)


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
    spaces = solid.filling.grown(piece.hull.vertices, piece.hull.faces, depth)
    normals, offsets = spaces[:, :3], spaces[:, 3]
    assert (piece.hull.vertices @ normals.T <= offsets + 1e-9).all()
    inside = (offsets - dense(from_manifold(to_manifold(solid.vertices, solid.faces))) @ normals.T).min(axis=1)
    assert inside.max() <= depth + 1e-9


def test_bars_that_cross_take_fewer_parts_that_are_tight_and_lose_nothing() -> None:
    solid, found = bars(8, 0), []
    for threads in (1, 2, 3):
        with Run(threads) as run:
            before = merged(solid, run)
            found.append(grow_cover(before, CRITERION, run, solid))
    after, whole = found[0], to_manifold(solid.vertices, solid.faces)
    assert len(after) < len(before)
    for part in after:
        inside = whole ^ to_manifold(part.hull.vertices, part.hull.faces)
        assert CRITERION.is_met(Component(inside)), "the solid clipped by another library"
    assert depth_outside(dense(from_manifold(whole)), after) < 5e-3, "no more than slivers"
    assert own_volume(after) == pytest.approx(solid.volume, rel=1e-2)
    for others in found[1:]:
        assert [part.hull.vertices.tobytes() for part in others] == [part.hull.vertices.tobytes() for part in after]


@pytest.mark.parametrize("solid", [together(bent_bar()), Component(box((0, 0, 0), (2, 1, 1)))], ids=["bent", "box"])
def test_where_nothing_crosses_no_work_is_done(solid: Component) -> None:
    with Run(1) as run:
        parts = merged(solid, run)
        done = run.work.done
        assert grow_cover(parts, CRITERION, run, solid) is parts
        assert run.work.done == done


@pytest.mark.parametrize("units", [0, 3_000, 30_000])
def test_without_enough_work_the_merged_parts_stay(units: int) -> None:
    solid = bars(8, 0)
    with Run(1) as run:
        parts = merged(solid, run)
        with run.limited(units):
            assert grow_cover(parts, CRITERION, run, solid) is parts
        assert run.stopped_by is None
