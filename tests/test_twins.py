"""Nodes that are one mesh in several places: the same hulls for each, tested on each."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import numpy.typing as npt
import pytest
import trimesh
from scipy.spatial import ConvexHull

import rlacd
from tests.hulls import assert_convex_hull, assert_covers, assert_same_hulls
from tests.shapes import table

Matrix = npt.NDArray[np.float64]


def placed(seed: int, scale: float = 1.0, *, mirrored: bool = False) -> Matrix:
    """A random place [4, 4], turned at random."""
    random = np.random.default_rng(seed)
    place: Matrix = trimesh.transformations.random_rotation_matrix(random.random(3))
    place[:3, :3] *= scale
    place[:3, 0] *= -1 if mirrored else 1
    place[:3, 3] = (5 * seed, *random.uniform(-1, 1, 2))
    return place


def blob() -> trimesh.Trimesh:
    """A knobbly body without symmetry, of many hulls."""
    ball = trimesh.creation.icosphere(2)
    x, y, z = ball.vertices.T
    ball.vertices *= (1 + 0.3 * np.sin(4 * x + 1) * np.cos(3 * y) + 0.2 * np.sin(5 * z + 0.5))[:, None]
    return ball


def scene_of(mesh: trimesh.Trimesh, places: Sequence[Matrix]) -> trimesh.Scene:
    scene = trimesh.Scene()
    for number, place in enumerate(places):
        scene.add_geometry(mesh, geom_name="mesh", node_name=f"node{number}", transform=place)
    return scene


def by_node(result: rlacd.Decomposition, count: int) -> list[list[trimesh.Trimesh]]:
    return [[hull for hull in result if hull.metadata["node_index"] == number] for number in range(count)]


def decomposed(scene: trimesh.Scene, **options: object) -> rlacd.Decomposition:
    return rlacd.decompose(scene, per_node=True, quality="fast", threads=1, **options)  # type: ignore[arg-type]


def assert_moved(hulls: list[list[trimesh.Trimesh]], places: Sequence[Matrix], within: float = 1e-9) -> None:
    """Each node's hulls are those of the first, in the same order, moved as its mesh is."""
    back = np.linalg.inv(places[0])
    for own, place in zip(hulls, places, strict=True):
        assert len(own) == len(hulls[0])
        for hull, first in zip(own, hulls[0], strict=True):
            assert_convex_hull(hull)
            there = trimesh.transform_points(first.vertices, place @ back)
            assert len(there) == len(hull.vertices)
            apart = np.linalg.norm(there[:, None] - hull.vertices, axis=2)
            assert max(apart.min(axis=0).max(), apart.min(axis=1).max()) <= within * np.ptp(there, axis=0).max()


def farthest_outside(hulls: list[trimesh.Trimesh], points: Matrix) -> float:
    """How far a point is above some side of every hull, by Qhull, at most; the longest side is 1."""
    sides = [ConvexHull(hull.vertices).equations for hull in hulls]
    above = [np.max(points @ planes[:, :3].T + planes[:, 3], axis=1) for planes in sides]
    return float(np.min(above, axis=0).max() / np.ptp(points, axis=0).max())


PLACES = {
    "turned": [placed(seed) for seed in range(4)],
    "mirrored": [placed(0), placed(1, mirrored=True), placed(2, mirrored=True)],
    "scaled": [placed(0), placed(1, 0.01), placed(2, 30.0, mirrored=True)],
}


@pytest.mark.parametrize("shape", [table, blob])
@pytest.mark.parametrize("how", PLACES)
@pytest.mark.promise("per-node")
def test_a_mesh_in_several_places_has_the_same_hulls_in_each(shape: type, how: str) -> None:
    places, mesh = PLACES[how], shape()
    result = decomposed(scene_of(mesh, places), relative_to="node")
    hulls = by_node(result, len(places))
    assert len(hulls[0]) > 3
    assert_moved(hulls, places)
    for own, place in zip(hulls, places, strict=True):
        assert_covers(own, trimesh.transform_points(mesh.vertices, place), mesh.faces)
        assert farthest_outside(own, trimesh.transform_points(mesh.vertices, place)) <= 1e-6
    report = result.report
    assert [node.hulls for node in report.nodes or ()] == [len(own) for own in hulls]
    assert report.concavity is not None
    assert report.concavity.max is not None
    assert report.concavity.max <= report.concavity.threshold
    volumes = [mesh.volume * abs(np.linalg.det(place[:3, :3])) for place in places]
    assert report.mass.volume_abs == pytest.approx(sum(volumes), rel=1e-6)
    assert_same_hulls(result, decomposed(scene_of(mesh, places), relative_to="node"))


def test_the_tolerance_of_the_scene_is_the_same_for_turned_nodes_only() -> None:
    """A small copy needs fewer hulls; large ones are turned and have the same, moved."""
    places = [placed(0), placed(1), placed(2, 0.05)]
    large, turned, small = by_node(decomposed(scene_of(blob(), places), threshold_abs=0.08), 3)
    assert_moved([large, turned], places[:2])
    assert len(small) < len(large)


def test_a_mesh_with_one_vertex_elsewhere_is_another() -> None:
    """It is decomposed as if it were alone."""
    mesh, other = blob(), blob()
    other.vertices[17] *= 1.0001
    scene = scene_of(mesh, [placed(0)])
    scene.add_geometry(other, geom_name="other", node_name="other", transform=placed(1))
    alone = scene_of(other, [placed(1)])
    alone.add_geometry(trimesh.creation.box(), node_name="box", transform=placed(3))
    _, beside = by_node(decomposed(scene, relative_to="node"), 2)
    first, _ = by_node(decomposed(alone, relative_to="node"), 2)
    assert_same_hulls(beside, first)


@pytest.mark.parametrize(
    "options", [{"max_hulls": 3}, {"max_vertices": 8}, {"primitives": True}, {"overlap": 0.02}, {"criterion": "volume"}]
)
def test_twins_have_equally_many_hulls_with_every_option(options: dict[str, object]) -> None:
    mesh, places = blob(), [placed(0), placed(1, mirrored=True)]
    result = decomposed(scene_of(mesh, places), **options)
    one, other = by_node(result, 2)
    assert len(one) == len(other)
    for own, place in zip((one, other), places, strict=True):
        assert_covers(own, trimesh.transform_points(mesh.vertices, place), mesh.faces)
    if "max_vertices" in options:
        assert max(len(hull.vertices) for hull in result) <= 8


def test_places_beside_a_mesh_to_avoid_are_not_alike() -> None:
    """Only the node that the obstacle stands in makes way for it."""
    places = [np.eye(4), placed(1)]
    legs = table()
    post = trimesh.creation.box(bounds=[(-0.05, -0.05, legs.bounds[0, 2]), (0.05, 0.05, legs.bounds[0, 2] + 0.1)])
    result = decomposed(scene_of(legs, places), avoid=[post])
    assert not any(hull.bounds[0, 0] < 0 < hull.bounds[1, 0] for hull in result if hull.contains([post.centroid])[0])
