"""Planes at reflex edges, against trimesh's adjacency, real cuts and shapes whose answer is known."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import pytest
import trimesh
from hypothesis import given, settings
from hypothesis import strategies as st
from manifold3d import Manifold
from scipy.spatial import ConvexHull

import rlacd
from rlacd import _native
from rlacd.planes.candidates import Candidates, reflex_edge_planes
from rlacd.policies import make_policy
from rlacd.policies.greedy import mid_planes
from rlacd.solid.component import Component, Plane
from tests.shapes import Floats, box, to_manifold, trimesh_of

ON = 2e-6
"""How far a plane may lie from its edge: faces' planes are moved out to what is flat with them in single precision."""


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


@dataclass
class ReflexEdges:
    """By trimesh: edges whose faces enclose more than 190 degrees of the solid, but do not fold back on each other."""

    ends: Floats
    normals: Floats
    corners: Floats
    angle: Floats

    @classmethod
    def of(cls, component: Component) -> ReflexEdges:
        mesh = trimesh.Trimesh(component.vertices, component.faces, process=False)
        angle = mesh.face_adjacency_angles
        reflex = ~mesh.face_adjacency_convex & (angle > np.radians(10)) & (angle < np.radians(179.9))
        faces = mesh.face_adjacency[reflex]
        ends = mesh.vertices[mesh.face_adjacency_edges[reflex]]
        return cls(ends, mesh.face_normals[faces], mesh.triangles[faces], angle[reflex])

    @property
    def middle(self) -> Floats:
        return np.asarray(self.ends.mean(axis=1))

    def chosen(self, candidates: Candidates) -> Floats:
        """Which of them lie in three of the planes."""
        heights = self.ends @ candidates.directions.T - candidates.offsets[:, 0]
        return np.flatnonzero((np.abs(heights).max(axis=1) < ON).sum(axis=1) >= 3)


def depth_below_hull(component: Component, points: Floats) -> Floats:
    equations = ConvexHull(component.vertices).equations
    return np.asarray(-(points @ equations[:, :3].T + equations[:, 3]).max(axis=1))


@pytest.mark.parametrize("name", sorted(SOLIDS.keys() - {"noisy scan"}))
def test_every_concave_edge_is_offered_where_as_many_are_asked_for(name: str) -> None:
    component = Component(SOLIDS[name]())
    edges, candidates = ReflexEdges.of(component), reflex_edge_planes(component, 1000)
    for middle, normals in zip(edges.middle, edges.normals, strict=True):
        for normal in (normals[0] - normals[1], *normals):
            assert has(candidates, tuple(normal), float(normal @ middle), within=1e-3)


def test_edges_that_more_than_two_faces_share_are_left_out() -> None:
    """Two prisms that touch along an edge: which of its faces belong together is not said."""
    vertices = np.array([(0, 0, 0), (0, 0, 1), (1, 0, 0), (0, 1, 0), (-1, 0, 0), (0, -1, 0)], dtype=np.float64)
    fan = np.array([(0, 1, 2), (1, 0, 3), (0, 1, 4), (1, 0, 5)], dtype=np.int32)
    hull = Component(Manifold.tetrahedron()).hull
    for some, count in ((fan, 0), (fan[:2], 3), (fan[[0, 2]], 0)):  # of the last two, both run the same way
        assert len(_native.candidate_planes(vertices, some, hull.body, 0, 4)) == count
    with pytest.raises(ValueError, match="out of range"):
        _native.candidate_planes(vertices[:3], fan[1:2], hull.body, 0, 4)


X, Y, Z = np.eye(3).tolist()
KNOWN: dict[str, tuple[Callable[[], Manifold], int, list[tuple[list[float], float]]]] = {
    "an L has one edge": (l_shape, 3, [(X, 1), (Y, 1), ([1, -1, 0], 0)]),
    "a crease in many segments is one": (lambda: l_shape().refine(7), 3, [(X, 1), (Y, 1), ([1, -1, 0], 0)]),
    "the fourth corner of a plus offers no plane that the others do not": (
        plus,
        6,
        [(X, -1), (X, 1), (Y, -1), (Y, 1), ([1, 1, 0], 0), ([1, -1, 0], 0)],
    ),
    "a table has an underside and legs": (table, 12, [(Z, 1), (X, 0.1), (X, 1.9), (Y, 0.1), (Y, 0.9)]),
    "a groove has walls": (grooved_cylinder, 12, [(Z, 0.9), (Z, 1.1)]),
}


@pytest.mark.parametrize("name", KNOWN)
def test_planes_are_those_that_a_person_would_cut_along(name: str) -> None:
    solid, most, planes = KNOWN[name]
    candidates = reflex_edge_planes(Component(solid()))
    assert len(planes) <= len(candidates) <= most
    for normal, offset in planes:
        assert has(candidates, normal, offset, within=1e-15 if max(normal) == sum(np.abs(normal)) else 1e-8)


def test_edges_on_a_staircase_are_spread_out() -> None:
    candidates = reflex_edge_planes(Component(staircase(16)))
    steps = np.sort([plane.offset for plane in planes_of(candidates) if plane.normal == (1, 0, 0)])
    assert len(steps) == 4
    assert (np.diff(steps) >= 2).all()
    assert np.ptp(steps) >= 8


def test_the_best_edge_is_deep_sharp_and_long() -> None:
    """By brute force, depth by Qhull's facets, where every crease is one edge."""
    component = Component(box((0, 0, 0), (9, 5, 1)) + box((1, 1, 1), (4, 3, 2)) + box((5, 1, 1), (8, 4, 4)))
    edges = ReflexEdges.of(component)
    weight = depth_below_hull(component, edges.middle) * edges.angle
    weight *= np.linalg.norm(edges.ends[:, 1] - edges.ends[:, 0], axis=1)
    (best,) = edges.chosen(reflex_edge_planes(component, 1))
    assert weight[best] == pytest.approx(weight.max())


def assert_planes_belong_to_edges(component: Component, count: int = 4) -> None:
    """Every plane contains a reflex edge; it halves its angle, or has one of its faces on one side and touches it."""
    edges, candidates = ReflexEdges.of(component), reflex_edge_planes(component, count)
    assert len(candidates) <= 3 * count
    assert np.linalg.norm(candidates.directions, axis=1) == pytest.approx(1)
    for plane in planes_of(candidates):
        normal = np.asarray(plane.normal)
        through = np.abs(edges.ends @ normal - plane.offset).max(axis=1) < ON
        assert through.any()
        lean = np.abs(edges.normals[through] @ normal)
        bisects = np.abs(lean[:, 0] - lean[:, 1]) < 1e-6
        corners = edges.corners[through] @ normal - plane.offset
        one_sided = (corners.min(axis=2) >= 0) | (corners.max(axis=2) <= 0)
        beside = one_sided & (np.abs(corners).max(axis=2) < ON)
        assert (bisects | beside.any(axis=1)).any()


@pytest.mark.parametrize("name", SOLIDS)
def test_planes_belong_to_edges(name: str) -> None:
    assert_planes_belong_to_edges(Component(SOLIDS[name]()))


boxes = st.lists(st.tuples(*[st.integers(0, 5)] * 3, *[st.integers(1, 4)] * 3), min_size=1, max_size=5)
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


@pytest.mark.parametrize("name", ["L", "tilted table", "grooved cylinder", "lopsided"])
def test_navacd_takes_the_cut_with_the_least_hulls(name: str) -> None:
    component = Component(SOLIDS[name]())
    candidates = Candidates.joined(mid_planes(component), reflex_edge_planes(component))
    plane = make_policy("navacd").choose(component)
    assert plane is not None
    sums = []
    for candidate in (plane, *planes_of(candidates)):
        sides = [side for side in component.cut(candidate) if side is not None]
        sums.append(sum(side.hull.volume for side in sides))
    assert sums[0] <= min(sums[1:]) + 1e-6 * component.hull.volume


def test_navacd_halves_a_box_that_has_to_be_cut() -> None:
    plane = make_policy("navacd").choose(Component(box((0, 0, 0), (4, 2, 1))))
    assert plane is not None
    assert (abs(np.asarray(plane.normal)).max(), plane.offset) in {(1, 2), (1, 1), (1, 0.5)}


@pytest.mark.parametrize("turn", [(0, 0, 0), (17, 31, 5)], ids=["upright", "tilted"])
@pytest.mark.parametrize("inset", [0, 0.1], ids=["legs at the corners", "legs set in"])
@pytest.mark.parametrize("policy", ["greedy", "navacd"])
def test_a_table_is_its_top_and_legs(policy: str, inset: float, turn: tuple[float, float, float]) -> None:
    result = rlacd.decompose(trimesh_of(table(inset).rotate(turn)), policy=policy)
    assert len(result) == 5
    if inset:
        assert [len(hull.vertices) for hull in result] == [8] * 5, "no ledges where the cuts ran"


@pytest.mark.parametrize("policy", ["greedy", "navacd"])
def test_offset_bricks_come_apart(policy: str) -> None:
    """The plane between them holds a face of each, on opposite sides."""
    bricks = box((0, 0, 0), (2, 1, 1)) + box((1, 1, 0), (3, 2, 1))
    result = rlacd.decompose(trimesh_of(bricks), policy=policy)
    assert [len(hull.vertices) for hull in result] == [8, 8]
    assert [hull.volume for hull in result] == pytest.approx([2, 2])
