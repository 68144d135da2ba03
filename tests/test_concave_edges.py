"""Concave edges and their planes, against trimesh's adjacency, real cuts and shapes whose answer is known."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
import trimesh
from hypothesis import given, settings
from hypothesis import strategies as st
from manifold3d import Manifold
from scipy.spatial.transform import Rotation

import rlacd
from rlacd import _native
from rlacd.io.read.load import load_mesh
from rlacd.planes.candidates import Candidates, concave_edge_planes
from rlacd.policies import Greedy, NavACD, Policy
from rlacd.policies.greedy import mid_planes
from rlacd.repair.repair import repair
from rlacd.solid.component import Component, Plane
from tests import reference_concave_edges as reference
from tests.reference_concave_edges import FLAT, HAIR, REFLEX, concave_edges, reflex_edges
from tests.shapes import Floats, box, to_manifold


def l_shape() -> Manifold:
    return box((0, 0, 0), (2, 1, 1)) + box((0, 0, 0), (1, 2, 1))


def plus() -> Manifold:
    return box((-3, -1, 0), (3, 1, 1)) + box((-1, -3, 0), (1, 3, 1))


def staircase(steps: int) -> Manifold:
    return sum((box((i, 0, 0), (i + 1, 3, i + 1)) for i in range(steps)), Manifold())


def table(inset: float = 0) -> Manifold:
    legs = [box((x, y, 0), (x + 0.1, y + 0.1, 1)) for x in (inset, 1.9 - inset) for y in (inset, 0.9 - inset)]
    return sum(legs, box((0, 0, 1), (2, 1, 1.1)))


def grooved_cylinder() -> Manifold:
    ring = Manifold.cylinder(0.2, 2, circular_segments=48) - Manifold.cylinder(0.2, 0.6, circular_segments=48)
    return Manifold.cylinder(2, 1, circular_segments=48) - ring.translate((0, 0, 0.9))


def lopsided() -> Manifold:
    """Boxes, no two of whose edges are alike."""
    boxes = [((0, 0, 0), (2, 1.1, 0.9)), ((0, 0, 0), (0.7, 1.9, 0.5)), ((1.2, 0.3, 0.5), (1.5, 0.8, 1.7))]
    return sum((box(lower, upper) for lower, upper in boxes), Manifold())


def noisy_scan() -> Manifold:
    ball = trimesh.creation.icosphere(4, 1.0)
    heights = 1 + np.random.default_rng(3).normal(0, 0.02, len(ball.vertices)) + 0.3 * np.cos(3 * ball.vertices[:, 0])
    return to_manifold(ball.vertices * heights[:, None], ball.faces)


SOLIDS: dict[str, Callable[[], Manifold]] = {
    "L": l_shape,
    "plus": plus,
    "staircase": lambda: staircase(8),
    "table": table,
    "tilted table": lambda: table().rotate((17, 31, 5)),
    "grooved cylinder": grooved_cylinder,
    "lopsided": lambda: lopsided().rotate((5, 20, 80)),
    "noisy scan": noisy_scan,
    "two bodies": lambda: l_shape() + l_shape().translate((5, 0, 0)),
    "open box": lambda: box((0, 0, 0), (2, 2, 1)) - box((0.1, 0.1, 0.1), (1.9, 1.9, 2)),
}


def planes_of(candidates: Candidates) -> list[Plane]:
    return [candidates.plane(i) for i in range(len(candidates))]


def has(candidates: Candidates, normal: tuple[float, float, float], offset: float, within: float = 1e-8) -> bool:
    """Whether a plane is among the candidates, whichever way its normal points."""
    n = np.asarray(normal) / np.linalg.norm(normal)
    d = offset / np.linalg.norm(normal)
    ours = np.column_stack([candidates.directions, candidates.offsets])
    gaps = [np.abs(ours - sign * np.array([*n, d])).max(axis=1) for sign in (1, -1)]
    return bool(np.minimum(*gaps).min(initial=np.inf) < within)


def edge_sets(ends: Floats) -> set[frozenset[int]]:
    return {frozenset((int(a), int(b))) for a, b in ends}


@pytest.mark.parametrize("name", SOLIDS)
def test_reflex_edges_are_those_that_trimesh_finds(name: str) -> None:
    component = Component(SOLIDS[name]())
    mesh = trimesh.Trimesh(component.vertices, component.faces, process=False)
    reflex = ~mesh.face_adjacency_convex & (mesh.face_adjacency_angles > REFLEX)
    found = reflex_edges(component)
    assert edge_sets(found.ends) == edge_sets(mesh.face_adjacency_edges[reflex])
    assert sorted(found.angle) == pytest.approx(sorted(mesh.face_adjacency_angles[reflex]), abs=1e-6)
    assert np.allclose(found.normals, mesh.face_normals[found.faces], atol=1e-9)


def assert_as_the_reference(component: Component, count: int = 4) -> None:
    planes, asked = concave_edge_planes(component, count), reference.concave_edge_planes(component, count)
    assert planes.directions == pytest.approx(asked.directions, abs=1e-12)
    assert planes.offsets == pytest.approx(asked.offsets, abs=1e-12)


@pytest.mark.parametrize("count", [0, 1, 4, 30])
@pytest.mark.parametrize("name", SOLIDS)
def test_planes_are_those_of_the_reference(name: str, count: int) -> None:
    assert_as_the_reference(Component(SOLIDS[name]()), count)


def test_edges_that_more_than_two_faces_share_are_left_out() -> None:
    """Two prisms that touch along an edge: which of its faces belong together is not said."""
    vertices = np.array([(0, 0, 0), (0, 0, 1), (1, 0, 0), (0, 1, 0), (-1, 0, 0), (0, -1, 0)], dtype=np.float64)
    fan = np.array([(0, 1, 2), (1, 0, 3), (0, 1, 4), (1, 0, 5)], dtype=np.int32)
    hull = Component(Manifold.tetrahedron()).hull
    for some, count in ((fan, 0), (fan[:2], 3), (fan[[0, 2]], 0)):  # of the last two, both run the same way
        assert len(_native.candidate_planes(vertices, some, hull.vertices, hull.faces, 0, 4)[0]) == count


def test_faces_out_of_range_are_refused() -> None:
    vertices, faces = np.zeros((3, 3)), np.array([(0, 1, 3)], dtype=np.int32)
    with pytest.raises(ValueError, match="out of range"):
        _native.candidate_planes(vertices, faces, vertices, faces[:0], 0, 4)


CONVEX: dict[str, Callable[[], Manifold]] = {
    "box": lambda: Manifold.cube((1, 2, 3)).rotate((10, 20, 30)),
    "sphere": lambda: Manifold.sphere(1, 48),
    "frustum": lambda: Manifold.cylinder(1, 1, 0.2, 32).refine(3),
    "tetrahedron": lambda: Manifold.tetrahedron(),
}


@pytest.mark.parametrize("name", CONVEX)
def test_convex_solids_have_no_candidates(name: str) -> None:
    component = Component(CONVEX[name]())
    assert len(concave_edges(component)) == 0
    assert len(concave_edge_planes(component)) == 0


def test_an_l_has_one_edge_and_three_planes() -> None:
    candidates = concave_edge_planes(Component(l_shape()))
    assert len(candidates) == 3
    assert has(candidates, (1, 0, 0), 1, within=1e-15)
    assert has(candidates, (0, 1, 0), 1, within=1e-15)
    assert has(candidates, (1, -1, 0), 0)


def test_a_crease_in_many_segments_offers_the_same_planes_once() -> None:
    whole, refined = (concave_edge_planes(Component(solid)) for solid in (l_shape(), l_shape().refine(7)))
    assert len(whole) == len(refined)
    assert all(has(refined, plane.normal, plane.offset) for plane in planes_of(whole))


def test_a_plus_offers_both_sides_of_both_bars() -> None:
    component = Component(plus())
    assert len(reflex_edges(component)) == 4
    assert len(concave_edges(component)) == 3, "the fourth corner offers no plane that the others do not"
    candidates = concave_edge_planes(component)
    assert len(candidates) == 6
    for normal in ((1, 0, 0), (0, 1, 0)):
        for offset in (-1, 1):
            assert has(candidates, normal, offset, within=1e-15)
    assert has(candidates, (1, 1, 0), 0)
    assert has(candidates, (1, -1, 0), 0)


def test_edges_on_a_staircase_are_spread_out() -> None:
    component = Component(staircase(16))
    steps = np.sort(component.vertices[concave_edges(component).ends[:, 0], 0])
    assert (np.diff(steps) >= 2).all()
    assert np.ptp(steps) >= 8


def test_a_table_offers_its_underside_and_its_legs() -> None:
    candidates = concave_edge_planes(Component(table()))
    assert has(candidates, (0, 0, 1), 1, within=1e-15), "the underside of the top"
    for normal, offsets in (((1, 0, 0), (0.1, 1.9)), ((0, 1, 0), (0.1, 0.9))):
        for offset in offsets:
            assert has(candidates, normal, offset, within=1e-15)


def test_a_groove_offers_its_walls() -> None:
    candidates = concave_edge_planes(Component(grooved_cylinder()))
    assert has(candidates, (0, 0, 1), 0.9)
    assert has(candidates, (0, 0, 1), 1.1)


def test_the_best_edge_is_deep_sharp_and_long() -> None:
    """By brute force, depth by Qhull's facets, where every crease is one edge."""
    component = Component(box((0, 0, 0), (9, 5, 1)) + box((1, 1, 1), (4, 3, 2)) + box((5, 1, 1), (8, 4, 4)))
    found, best = reflex_edges(component), concave_edges(component, 1)
    equations = _qhull(component.vertices)
    ends = component.vertices[found.ends]
    depth = -(ends.mean(axis=1) @ equations[:, :3].T + equations[:, 3]).max(axis=1)
    weight = depth * found.angle * np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1)
    chosen = edge_sets(found.ends).intersection(edge_sets(best.ends))
    assert len(chosen) == 1
    place = [frozenset(map(int, pair)) for pair in found.ends].index(chosen.pop())
    assert weight[place] == pytest.approx(weight.max())


def _qhull(points: Floats) -> Floats:
    from scipy.spatial import ConvexHull

    return np.asarray(ConvexHull(points).equations)


def assert_planes_belong_to_edges(component: Component, count: int = 4) -> None:
    """Every plane contains a chosen edge; it halves its angle, or has one of its faces on one side and touches it."""
    edges, candidates = concave_edges(component, count), concave_edge_planes(component, count)
    assert len(edges) <= count
    assert len(candidates) <= 3 * count
    assert np.linalg.norm(candidates.directions, axis=1) == pytest.approx(1)
    for plane in planes_of(candidates):
        normal = np.asarray(plane.normal)
        heights = component.vertices @ normal - plane.offset
        through = np.abs(heights[edges.ends]).max(axis=1) < FLAT + 2 * HAIR
        assert through.any()
        lean = np.abs(edges.normals[through] @ normal)
        bisects = np.abs(lean[:, 0] - lean[:, 1]) < 1e-6
        corners = heights[component.faces[edges.faces[through]]]
        one_sided = (corners.min(axis=2) >= 0) | (corners.max(axis=2) <= 0)
        beside = one_sided & (np.abs(corners).max(axis=2) < FLAT + 2 * HAIR)
        assert (bisects | beside.any(axis=1)).any()


@pytest.mark.parametrize("name", SOLIDS)
def test_planes_belong_to_edges(name: str) -> None:
    assert_planes_belong_to_edges(Component(SOLIDS[name]()))


boxes = st.lists(st.tuples(*[st.integers(0, 5)] * 3, *[st.integers(1, 4)] * 3), min_size=2, max_size=5)
turns = st.tuples(*[st.floats(-180, 180)] * 3)


@settings(max_examples=60, deadline=None)
@given(boxes, turns, st.booleans())
def test_planes_of_any_boxes_belong_to_edges(sizes: list[tuple[int, ...]], turn: Floats, single: bool) -> None:
    solid = sum((box(s[:3], tuple(np.add(s[:3], s[3:]).tolist())) for s in sizes), Manifold()).rotate(tuple(turn))
    if single:  # as a file in single precision would have it: what was flat is so no longer
        mesh = solid.scale((0.2, 0.2, 0.2)).to_mesh64()
        solid = to_manifold(np.float64(np.float32(mesh.vert_properties[:, :3])), mesh.tri_verts.astype(np.int32))
    if not solid.is_empty() and solid.volume() > 1e-6:
        assert_planes_belong_to_edges(Component(solid))


@pytest.mark.parametrize("axis", ["x", "y", "z"])
def test_planes_turn_with_the_solid(axis: str) -> None:
    turn = Rotation.from_euler(axis, 33, degrees=True)
    still = concave_edge_planes(Component(lopsided()))
    turned = concave_edge_planes(Component(lopsided().rotate(tuple(turn.as_euler("xyz", degrees=True)))))
    assert len(still) == len(turned)
    for plane in planes_of(still):
        assert has(turned, tuple(turn.apply(plane.normal)), plane.offset)


@pytest.mark.parametrize("name", SOLIDS)
def test_same_bits_again(name: str) -> None:
    first, second = (concave_edge_planes(Component(SOLIDS[name]()), 8) for _ in range(2))
    assert np.array_equal(first.directions, second.directions)
    assert np.array_equal(first.offsets, second.offsets)


def test_edges_of_a_scan_lie_deep_not_in_its_noise() -> None:
    component = Component(noisy_scan())
    equations = _qhull(component.vertices)

    def depth(ends: Floats) -> Floats:
        middle = component.vertices[ends].mean(axis=1)
        return np.asarray(-(middle @ equations[:, :3].T + equations[:, 3]).max(axis=1))

    everywhere, chosen = depth(reflex_edges(component).ends), depth(concave_edges(component).ends)
    assert len(everywhere) > 1000
    assert chosen.min() > np.median(everywhere)
    assert chosen.max() > np.quantile(everywhere, 0.9)


@pytest.mark.parametrize("name", ["L", "tilted table", "grooved cylinder", "lopsided"])
def test_navacd_takes_the_cut_with_the_least_hulls(name: str) -> None:
    component = Component(SOLIDS[name]())
    candidates = Candidates.joined(mid_planes(component), concave_edge_planes(component))
    plane = NavACD().choose(component)
    assert plane is not None
    sums = []
    for candidate in (plane, *planes_of(candidates)):
        sides = [side for side in component.cut(candidate) if side is not None]
        sums.append(sum(side.hull.volume for side in sides))
    assert sums[0] <= min(sums[1:]) + 1e-6 * component.hull.volume


def test_navacd_halves_a_box_that_has_to_be_cut() -> None:
    plane = NavACD().choose(Component(box((0, 0, 0), (4, 2, 1))))
    assert plane is not None
    assert (abs(np.asarray(plane.normal)).max(), plane.offset) in {(1, 2), (1, 1), (1, 0.5)}


@pytest.mark.parametrize("turn", [(0, 0, 0), (0, 0, 90), (17, 31, 5)], ids=str)
def test_an_l_falls_into_two_convex_parts(turn: tuple[float, float, float]) -> None:
    """Two boxes, or two wedges cut along the bisector: the hulls add up to the solid either way."""
    component = Component(l_shape().rotate(turn))
    plane = NavACD().choose(component)
    assert plane is not None
    below, above = component.cut(plane)
    assert below is not None
    assert above is not None
    assert below.volume + above.volume == pytest.approx(3)
    for side in (below, above):
        assert side.hull.volume == pytest.approx(side.volume, rel=1e-7)


@pytest.mark.parametrize("policy", [NavACD(), Greedy()], ids=["navacd", "greedy"])
@pytest.mark.parametrize("name", SOLIDS)
def test_policies_cut_every_solid(policy: Policy, name: str) -> None:
    component = Component(SOLIDS[name]())
    plane = policy.choose(component)
    assert plane is not None
    below, above = component.cut(plane)
    assert below is not None
    assert above is not None
    assert below.volume + above.volume == pytest.approx(component.volume)
    assert plane == policy.choose(component, threads=3)


@pytest.mark.parametrize("turn", [(0, 0, 0), (17, 31, 5)], ids=["upright", "tilted"])
@pytest.mark.parametrize("inset", [0, 0.1], ids=["legs at the corners", "legs set in"])
@pytest.mark.parametrize("policy", ["greedy", "navacd"])
def test_a_table_is_its_top_and_legs(policy: str, inset: float, turn: tuple[float, float, float]) -> None:
    mesh = table(inset).rotate(turn).to_mesh64()
    result = rlacd.decompose((mesh.vert_properties[:, :3], mesh.tri_verts), policy=policy)
    assert len(result) == 5
    if inset:
        assert [len(hull.vertices) for hull in result] == [8] * 5, "no ledges where the cuts ran"


@pytest.mark.parametrize("policy", ["greedy", "navacd"])
def test_offset_bricks_come_apart(policy: str) -> None:
    """The plane between them holds a face of each, on opposite sides."""
    bricks = (box((0, 0, 0), (2, 1, 1)) + box((1, 1, 0), (3, 2, 1))).to_mesh64()
    result = rlacd.decompose((bricks.vert_properties[:, :3], bricks.tri_verts), policy=policy)
    assert [len(hull.vertices) for hull in result] == [8, 8]
    assert [hull.volume for hull in result] == pytest.approx([2, 2])


@pytest.mark.nightly
@pytest.mark.parametrize("file", ["test/vhacd/al.ply", "test/vhacd/hornbug.ply", "test/coacd_examples/SnowFlake.ply"])
def test_real_meshes(corpus: Path, file: str) -> None:
    component = Component(repair(load_mesh(corpus / file)).manifold)
    assert_planes_belong_to_edges(component, 8)
    result = rlacd.decompose(corpus / file, policy="navacd")
    assert result.report["complete"]
    assert result.report["concavity"]["max"] <= 0.05
