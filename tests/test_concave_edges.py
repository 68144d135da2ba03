"""Concave edges and their planes, against trimesh's adjacency, real cuts and shapes whose answer is known."""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
import pytest
import trimesh
from hypothesis import given, settings
from hypothesis import strategies as st
from manifold3d import Manifold
from scipy.spatial.transform import Rotation

import rlacd
from rlacd import _native
from rlacd.planes.candidates import Candidates, concave_edge_planes
from rlacd.policies import NavACD
from rlacd.policies.greedy import mid_planes
from rlacd.solid.component import Component, Plane
from tests.shapes import Floats, box, to_manifold

REFLEX = float(np.radians(10))
"""An edge is concave when it exceeds a straight angle by more than this."""

THROUGH = 1e-6
"""What of a plane counts as through an edge: files in single precision tell no less apart."""


class ConcaveEdges(NamedTuple):
    """Ends [E, 2], the faces on both sides [E, 2], their outward normals [E, 2, 3], and the angles beyond straight."""

    ends: np.ndarray
    faces: np.ndarray
    normals: np.ndarray
    angle: np.ndarray


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


def edges_of(found: tuple[np.ndarray, ...]) -> ConcaveEdges:
    ends, faces, normals, angle = found
    return ConcaveEdges(ends, faces, normals.reshape(-1, 2, 3), angle)


def reflex_edges(component: Component) -> ConcaveEdges:
    return edges_of(_native.reflex_edges(component.vertices, component.faces))


def concave_edges(component: Component, count: int = 4) -> ConcaveEdges:
    hull = component.hull
    return edges_of(_native.concave_edges(component.vertices, component.faces, hull.vertices, hull.faces, count))


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


def test_edges_that_more_than_two_faces_share_are_left_out() -> None:
    """Two prisms that touch along an edge: which of its faces belong together is not said."""
    vertices = np.array([(0, 0, 0), (0, 0, 1), (1, 0, 0), (0, 1, 0), (-1, 0, 0), (0, -1, 0)], dtype=np.float64)
    fan = np.array([(0, 1, 2), (1, 0, 3), (0, 1, 4), (1, 0, 5)], dtype=np.int32)
    assert len(_native.reflex_edges(vertices, fan)[0]) == 0
    assert len(_native.reflex_edges(vertices, fan[:2])[0]) == 1
    assert len(_native.reflex_edges(vertices, fan[[0, 2]])[0]) == 0, "both run the same way"


def test_faces_out_of_range_are_refused() -> None:
    vertices, faces = np.zeros((3, 3)), np.array([(0, 1, 3)], dtype=np.int32)
    with pytest.raises(ValueError, match="out of range"):
        _native.reflex_edges(vertices, faces)


CONVEX: dict[str, Callable[[], Manifold]] = {
    "box": lambda: Manifold.cube((1, 2, 3)).rotate((10, 20, 30)),
    "sphere": lambda: Manifold.sphere(1, 48),
    "frustum": lambda: Manifold.cylinder(1, 1, 0.2, 32).refine(3),
    "tetrahedron": lambda: Manifold.tetrahedron(),
}


@pytest.mark.parametrize("name", CONVEX)
def test_convex_solids_have_no_candidates(name: str) -> None:
    component = Component(CONVEX[name]())
    assert len(concave_edges(component).ends) == 0
    assert len(concave_edge_planes(component)) == 0


OFFERED = {
    "L": ([(1, 0, 0, 1), (0, 1, 0, 1), (1, -1, 0, 0)], 3),
    "plus": ([*((1, 0, 0, d) for d in (-1, 1)), *((0, 1, 0, d) for d in (-1, 1)), (1, 1, 0, 0), (1, -1, 0, 0)], 6),
    "table": ([(0, 0, 1, 1), (1, 0, 0, 0.1), (1, 0, 0, 1.9), (0, 1, 0, 0.1), (0, 1, 0, 0.9)], None),
    "grooved cylinder": ([(0, 0, 1, 0.9), (0, 0, 1, 1.1)], None),
}
"""Normals and offsets of planes along the faces beside concave edges, and how many planes there are."""


@pytest.mark.parametrize("name", OFFERED)
def test_both_faces_of_a_concave_edge_and_the_bisector_are_offered(name: str) -> None:
    planes, count = OFFERED[name]
    candidates = concave_edge_planes(Component(SOLIDS[name]()))
    assert count in (None, len(candidates)), "each plane once, whichever edges offer it"
    for *normal, offset in planes:
        assert has(
            candidates, tuple(normal), offset, 1e-15 if normal[0] in (0, 1) and name != "grooved cylinder" else 1e-8
        )


def test_a_crease_in_many_segments_offers_the_same_planes_once() -> None:
    whole, refined = (concave_edge_planes(Component(solid)) for solid in (l_shape(), l_shape().refine(7)))
    assert len(whole) == len(refined)
    assert all(has(refined, plane.normal, plane.offset) for plane in planes_of(whole))


def test_edges_on_a_staircase_are_spread_out() -> None:
    component = Component(staircase(16))
    steps = np.sort(component.vertices[concave_edges(component).ends[:, 0], 0])
    assert (np.diff(steps) >= 2).all()
    assert np.ptp(steps) >= 8


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
    assert len(edges.ends) <= count
    assert len(candidates) <= 3 * count
    assert np.linalg.norm(candidates.directions, axis=1) == pytest.approx(1)
    for plane in planes_of(candidates):
        normal = np.asarray(plane.normal)
        heights = component.vertices @ normal - plane.offset
        through = np.abs(heights[edges.ends]).max(axis=1) < THROUGH
        assert through.any()
        lean = np.abs(edges.normals[through] @ normal)
        bisects = np.abs(lean[:, 0] - lean[:, 1]) < 1e-6
        corners = heights[component.faces[edges.faces[through]]]
        one_sided = (corners.min(axis=2) >= 0) | (corners.max(axis=2) <= 0)
        beside = one_sided & (np.abs(corners).max(axis=2) < THROUGH)
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


@pytest.mark.parametrize("name", ["L", "tilted table", "grooved cylinder", "lopsided"])
def test_navacd_takes_the_cut_with_the_least_hulls(name: str) -> None:
    component = Component(SOLIDS[name]())
    candidates = Candidates.joined(mid_planes(component), concave_edge_planes(component))
    plane = NavACD().choose(component)
    sums = []
    for candidate in (plane, *planes_of(candidates)):
        sides = [side for side in component.cut(candidate) if side is not None]
        sums.append(sum(side.hull.volume for side in sides))
    assert sums[0] <= min(sums[1:]) + 1e-6 * component.hull.volume


@pytest.mark.parametrize("policy", ["greedy", "navacd"])
def test_offset_bricks_come_apart(policy: str) -> None:
    """The plane between them holds a face of each, on opposite sides."""
    bricks = (box((0, 0, 0), (2, 1, 1)) + box((1, 1, 0), (3, 2, 1))).to_mesh64()
    result = rlacd.decompose((bricks.vert_properties[:, :3], bricks.tri_verts), policy=policy)
    assert [len(hull.vertices) for hull in result] == [8, 8]
    assert [hull.volume for hull in result] == pytest.approx([2, 2])
