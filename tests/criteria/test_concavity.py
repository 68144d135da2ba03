"""The strict concavity test: its intervals hold the truth, its yes means yes."""

from __future__ import annotations

import csv
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import manifold3d
import numpy as np
import pytest
import trimesh
from hypothesis import given, settings
from hypothesis import strategies as st

from rlacd import _native
from rlacd.criteria.concavity import Concavity, Distance
from rlacd.solid.component import Component, Part, Plane
from rlacd.solid.distance import hull_union
from rlacd.solid.hull import Hull
from tests.shapes import box, dense, depth_in, to_manifold

TOLERANCE = 1e-3


def sampled(part: Component) -> tuple[float, float]:
    """Lower bounds of both one-sided distances, from many points and independent distance functions."""
    hull = part.hull
    surface = _native.Surface(part.vertices, part.faces)
    return float(depth_in(hull, dense(part)).max()), float(surface.distance(dense(hull)).max())


def check(part: Component) -> None:
    """The interval holds what dense sampling finds and is no looser than sampling is coarse."""
    measured = Concavity().measure(part, TOLERANCE)
    lower, upper = measured.value
    inward, outward = sampled(part)
    by_volume = 0.3 * measured.volume_radius
    assert inward <= measured.depth[1] + 1e-7
    assert outward <= measured.reach[1] + 1e-7
    assert 0 <= lower <= upper <= lower + TOLERANCE + 1e-12
    assert lower <= max(inward, outward, by_volume) + 0.06  # how coarse the samples are
    if upper > 1e-6:
        assert Concavity(upper * 1.01 + TOLERANCE).is_met(part)
    if lower > 1e-4:  # below, rounding of volumes decides it
        assert not Concavity(lower * 0.99).is_met(part)


def slot(x: float) -> manifold3d.Manifold:
    """Only a stretch of the hull's top 0.06 wide is away from the part: a sampled test misses it."""
    return box((-1,) * 3, (1,) * 3) - box((x, -0.8, 0), (x + 0.06, 0.77, 2))


KNOWN: dict[str, tuple[manifold3d.Manifold, float | None, float]] = {
    # A slot 0.4 wide and 0.5 deep: its floor is 0.5 below the hull's top, whose middle is 0.2 from the rims.
    "notched box": (box((-1, -1, -1), (1, 1, 1)) - box((-0.2, -2, 0.5), (0.2, 2, 2)), 0.5, 0.2),
    # The inner edge (1, 1) lies below the hull's slanted face, whose middle is 1/2 from the walls; the L is 0.5 thick.
    "L": (box((0, 0, 0), (2, 1, 0.5)) + box((0, 0, 0), (1, 2, 0.5)), 0.25, 0.5),
    "box": (box((-1, -1, -1), (1, 0.3, 0.01)).rotate((10, 20, 30)), 0, 0),
    "ball": (manifold3d.Manifold.sphere(1.0, 12), 0, 0),
    "slot": (slot(0), None, 0.03),
    "slot aside": (slot(0.3), None, 0.03),
}


@pytest.mark.parametrize(
    ("name", "levels", "turn"),
    [*((name, levels, 0) for name in KNOWN for levels in (1, 5)), *(("notched box", levels, 33) for levels in (1, 7))],
)
def test_known_answers(name: str, levels: int, turn: float) -> None:
    solid, inward, outward = KNOWN[name]
    part = Component(solid.rotate((turn, 2 * turn, 0)).refine(levels))
    lower, upper, _ = hull_union([part.hull]).over(_native.Surface(part.vertices, part.faces), 1e-4)
    assert lower <= upper <= lower + 1e-4 + 1e-12
    assert lower == pytest.approx(outward, abs=1e-4)
    measured = Concavity().measure(part, TOLERANCE)
    assert measured.reach[0] <= outward + 1e-9 <= measured.reach[1] + 2e-9
    if inward is not None:
        assert measured.depth[0] == pytest.approx(inward, abs=TOLERANCE)
    if name == "notched box":
        assert measured.volume_radius == pytest.approx(np.cbrt(3 * 0.4 / (4 * np.pi)))
        assert measured.value[0] <= 0.5 + 1e-9 <= measured.value[1] + 2e-9
        assert Concavity(0.502).is_met(part)
        assert not Concavity(0.499).is_met(part)


@pytest.mark.parametrize("levels", [1, 2, 9])
def test_deepest_point_that_is_no_corner_and_no_centroid(levels: int) -> None:
    # A thin triangular slot runs across the whole box: the depth of its bottom edge is greatest at a place along the
    # edge that no vertex, edge middle or centroid marks.
    cutter = manifold3d.Manifold.hull_points(
        np.array([[-3, -0.02, 1], [-3, 0.02, 1], [3, -0.02, 1], [3, 0.02, 1], [-3, 0, 0.7], [3, 0, 0.1]])
    )
    part = Component((box((-1, -0.5, -0.5), (1, 0.5, 0.5)) - cutter).refine(levels))
    # Bottom edge at height 0.4 - 0.1 x, 0.1 + 0.1 x below the top and 1 - x from the end: equal at x = 0.818.
    x = 0.9 / 1.1
    assert Concavity().measure(part, 1e-5).depth[0] == pytest.approx(1 - x, abs=2e-5)
    assert not Concavity(1 - x - 1e-3).is_met(part)


def test_sliver_facets_do_not_shorten_distances() -> None:
    # Points along a box's edges, off by rounding: the hull has needle facets whose computed normals are noise.
    rng = np.random.default_rng(0)
    solid = box((-1, -1, -1), (1, 1, 1)) - box((-0.5, -0.5, 0), (0.5, 0.5, 2))
    part = Component(solid)
    for scale in (1e-15, 1e-13, 1e-10, 1e-7):
        along = np.stack([np.linspace(-1, 1, 200), np.ones(200), np.ones(200)], axis=1)
        edges = np.vstack([along[:, order] * sign for order in ([0, 1, 2], [1, 0, 2], [1, 2, 0]) for sign in (1, -1)])
        points = np.vstack([edges + rng.normal(scale=scale, size=edges.shape), 1.0001 * part.vertices])
        hull = Hull.of(points)
        depth, _ = part.against.measure(hull.body, 1e-3)
        truth = 1.0  # the pocket's floor is 1 above the bottom and 1 below the top
        assert depth[1] >= truth - 1e-3
        assert depth[0] <= truth + 2e-3


@st.composite
def solids(draw: st.DrawFn) -> Component:
    """Unions and differences of a few boxes and hulls of points, some refined: any genus, slivers included."""
    unit = st.floats(-1, 1, width=32)
    points = st.lists(st.tuples(unit, unit, unit), min_size=5, max_size=9)
    solid = box((-0.7, -0.6, -0.5), (0.7, 0.6, 0.5))
    for _ in range(draw(st.integers(1, 3))):
        other = manifold3d.Manifold.hull_points(np.array(draw(points)))
        solid = solid + other if draw(st.booleans()) else solid - other
    pieces = sorted(solid.decompose(), key=lambda piece: piece.volume())
    if not pieces or pieces[-1].volume() < 1e-3:
        return Component(box((-1, -1, -1), (1, 1, 1)))
    return Component(pieces[-1].refine(draw(st.integers(1, 3))))


@settings(deadline=None, max_examples=25)
@given(st.integers(0, 2**32 - 1), st.sampled_from([0.0, 1e-8, 1e-4, 0.02]), st.booleans())
def test_hulls_that_lie_in_the_surface_against_dense_sampling(seed: int, shift: float, turn: bool) -> None:
    """Boxes against the union of them: facets lie in its surface, inside, across both, or off by a shift."""
    random = np.random.default_rng(seed)
    lower = random.integers(0, 5, (5, 3)) / 4
    boxes = [box(low, low + random.integers(1, 4, 3) / 4) for low in lower]
    if turn:
        boxes = [one.rotate((31, 17, 5)) for one in boxes]
    whole = Component(manifold3d.Manifold.batch_boolean(boxes, manifold3d.OpType.Add))
    surface = whole.against.surface
    for one in boxes:
        corners = one.to_mesh64().vert_properties[:, :3]
        hull = Hull.of(corners + random.normal(0, shift, corners.shape))
        assert hull is not None
        points = dense(hull)
        distances = surface.distance(points)
        outside = surface.winding(points, is_closed=True) < 0.5
        _, (least, most) = whole.against.measure(hull.body, TOLERANCE, TOLERANCE)
        reach = distances[outside].max(initial=0)
        assert least <= most
        assert reach <= most + 1e-7
        if shift == 0:
            assert most < 1e-5
        least, most, _ = hull_union([hull]).over(surface, 1e-6, floor=TOLERANCE)
        assert distances.max() <= most + 1e-7


@pytest.mark.slow
@settings(deadline=None, max_examples=60)
@given(solids())
def test_made_solids_against_dense_sampling(part: Component) -> None:
    check(part)


def cut_meshes(corpus: Path, count: int, seed: int) -> Iterator[Component]:
    """Pieces of real closed meshes, cut by random axis-aligned planes: what a decomposition asks about."""
    rng = np.random.default_rng(seed)
    rows = [row for row in csv.DictReader((corpus / "index.csv").open()) if row["watertight"] == "1"]
    rows = [row for row in rows if int(row["faces"]) < 8000]
    for row in rng.permutation(np.array(rows, dtype=object))[:count]:
        mesh = trimesh.load(corpus / row["file"], process=False)
        vertices = 2 * (np.asarray(mesh.vertices) - mesh.bounds.mean(axis=0)) / mesh.extents.max()
        todo: list[Any] = to_manifold(vertices, np.asarray(mesh.faces)).decompose()
        for _ in range(3):
            pieces = [piece for piece in todo if piece.volume() > 1e-5]
            if not pieces:
                break
            piece = max(pieces, key=lambda piece: piece.volume())
            yield Component(piece)
            normal = np.eye(3)[rng.integers(3)]
            heights = Component(piece).vertices @ normal
            offset = heights.min() + np.ptp(heights) * rng.uniform(0.2, 0.8)
            todo = [part for half in piece.split_by_plane(normal, offset) for part in half.decompose()]


@pytest.mark.slow
@pytest.mark.promise("certified")
def test_on_real_parts_yes_is_never_contradicted_by_dense_samples(corpus: Path) -> None:
    met = 0
    for part in cut_meshes(corpus, 15, seed=1):
        check(part)
        if Concavity(0.05).is_met(part):
            met += 1
            assert max(sampled(part)) <= 0.05 + 1e-9
    assert met > 4


def test_hull_larger_than_the_part_counts_in_full() -> None:
    # A hull fattened by a vertex limit: its distance from the part is part of the concavity.
    solid = Component(box((-0.5, -0.5, -0.5), (0.5, 0.5, 0.5)))
    hull = Component(box((-0.6, -0.6, -0.6), (0.6, 0.6, 0.6))).hull
    measured = Concavity().measure(Part(hull, (solid,), solid), 1e-4)
    assert measured.depth[0] - 1e-12 <= 0.1 <= measured.depth[1] + 1e-12
    assert measured.reach[0] == pytest.approx(0.1 * np.sqrt(3), abs=2e-4)
    by_volume = 0.3 * np.cbrt(3 * (1.2**3 - 1) / (4 * np.pi))
    assert measured.value[0] == pytest.approx(max(0.1 * np.sqrt(3), by_volume), abs=2e-4)


def test_what_other_parts_fill_of_a_hull_is_no_error_of_it() -> None:
    # The upright of a T between two halves of its bar: the joint hull of the halves holds the upright's end.
    solid = Component(box((-1, -0.1, 0), (1, 0.1, 0.2)) + box((-0.1, -0.1, -1), (0.1, 0.1, 0.2)))
    left, rest = (side for side in solid.cut(Plane((1.0, 0.0, 0.0), -0.1)) if side is not None)
    upright, right = (side for side in rest.cut(Plane((1.0, 0.0, 0.0), 0.1)) if side is not None)
    bar = Part.joint(left, right)
    measured = Concavity().measure(bar, 1e-5)
    assert measured.value[1] <= 2e-5
    assert bar.volume < bar.filled == pytest.approx(bar.hull.volume, rel=1e-6)
    assert not Concavity(0.09).is_met(Part.joint(left, upright)), "air lies between them"


def test_a_hollow_counts_as_deep_as_it_lies() -> None:
    # A box around a hollow: the hull of a wall is full, that of two opposite walls holds the hollow.
    solid = Component(box((-1, -1, -1), (1, 1, 1)) - box((-0.9, -0.9, -0.9), (0.9, 0.9, 0.9)))
    low, rest = (side for side in solid.cut(Plane((0.0, 0.0, 1.0), -0.9)) if side is not None)
    high = rest.cut(Plane((0.0, 0.0, 1.0), 0.9))[1]
    assert high is not None
    assert Concavity(1e-3).is_met(low)
    both = Part.joint(low, high)
    measured = Distance().measure(both, 1e-3)
    assert measured.depth[0] == pytest.approx(0.1, abs=1e-3)
    assert measured.reach[0] == 0, "the walls between them hold its sides"
    assert Distance(0.101).is_met(both)
    assert not Distance(0.099).is_met(both)


@pytest.mark.parametrize(("radius", "met"), [(0.166, True), (0.167, False)])
def test_the_volume_that_a_hull_adds_counts(radius: float, met: bool) -> None:
    # 0.3 of the radius of a ball as large as what is cut from the box all around, far less deep than the threshold.
    solid = Component(box((-1, -1, -1), (1, 1, 1)))
    side = (8 + 4 / 3 * np.pi * radius**3) ** (1 / 3) / 2
    hull = Component(box((-side,) * 3, (side,) * 3)).hull
    assert Concavity(0.05).is_met(Part(hull, (solid,), solid)) == met
