"""Closed bodies that cross themselves: inside out in places, they cannot be cut as they are."""

from __future__ import annotations

import itertools

import numpy as np
import numpy.typing as npt
import pytest
import trimesh
from scipy import ndimage
from scipy.spatial import cKDTree

import rlacd
import rlacd.cut_and_merge
from fuzz.geometry import Polytope, distance_to_union, winding_number
from rlacd.io.read.load import load_mesh
from rlacd.repair.distance import SurfaceQuery, is_tangle
from rlacd.repair.repair import repair
from rlacd.solid.solid import Solid

Mesh = tuple[npt.NDArray[np.float64], npt.NDArray[np.int64]]

BOX = trimesh.creation.box()


BRACKET_POINTS = """
0 0 0  0 0 68.31  0 71.4 0  0 71.4 35.91
8.64 12.66 8.64  8.64 12.66 59.67  8.64 71.4 8.64  8.64 71.4 59.67
59.99 12.66 8.64  59.99 12.66 0  59.99 71.4 8.64  59.99 71.4 59.67
68.63 0 0  68.63 0 68.31  68.63 71.4 0  68.63 71.4 68.31
"""
BRACKET_FACES = """
12 13 1  5 9 8  8 4 5  1 13 15  15 3 1  13 12 14  14 15 13  12 0 2  2 14 12
0 1 3  3 2 0  3 15 11  11 7 3  15 14 10  10 11 15  14 2 6  6 10 14  2 3 7
7 6 2  7 11 9  9 5 7  11 10 8  8 9 11  10 6 4  4 8 10  6 7 5  5 4 6
"""
FAULTY_BRACKET: Mesh = (
    np.array(BRACKET_POINTS.split(), dtype=float).reshape(-1, 3),
    np.array(BRACKET_FACES.split(), dtype=int).reshape(-1, 3),
)


def tangle(seed: int = 0) -> Mesh:
    """An icosahedron whose corners were shuffled: closed, oriented, and hardly a face that no other crosses."""
    shape = trimesh.creation.icosahedron()
    return np.random.default_rng(seed).permutation(shape.vertices), np.array(shape.faces)


def repaired(mesh: Mesh) -> Solid:
    return repair(load_mesh(mesh))


def crosses_itself(vertices: npt.NDArray[np.float64], faces: npt.NDArray[np.int64]) -> bool:
    return is_tangle(SurfaceQuery(vertices, faces.astype(np.int64)))


def beside(mesh: Mesh, other: Mesh) -> Mesh:
    """Both, the other to the right."""
    return np.concatenate([mesh[0], other[0] + [4, 0, 0]]), np.concatenate([mesh[1], other[1] + len(mesh[0])])


def enclosed(mesh: Mesh, cells: int = 40) -> tuple[npt.NDArray[np.float64], npt.NDArray[np.float64]]:
    """Points that faces shut in, and points that they do not, found on a grid; none near the faces."""
    vertices, faces = mesh
    surface = trimesh.sample.sample_surface(trimesh.Trimesh(vertices, faces, process=False), 40_000, seed=0)[0]
    axes = [
        np.linspace(low - 0.1, high + 0.1, cells)
        for low, high in zip(vertices.min(axis=0), vertices.max(axis=0), strict=True)
    ]
    grid = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1)
    free = (cKDTree(surface).query(grid.reshape(-1, 3))[0] > 0.06).reshape(grid.shape[:3])
    rooms, _ = ndimage.label(free)
    return grid[free & (rooms != rooms[0, 0, 0])], grid[rooms == rooms[0, 0, 0]]


@pytest.mark.parametrize("seed", range(4))
def test_what_the_faces_of_a_tangle_enclose_is_solid(seed: int) -> None:
    mesh = tangle(seed)
    assert crosses_itself(*mesh) or crosses_itself(mesh[0], mesh[1][:, ::-1])
    solid = repaired(mesh)
    assert not crosses_itself(*solid.mesh)
    (body,) = solid.bodies
    assert (body.step, body.faces_in) == ("slab", 20)
    assert body.deviation < 2e-3
    inside, outside = (solid.frame.to_frame(points[::7]) for points in enclosed(mesh))
    assert len(inside) > 20
    assert trimesh.Trimesh(*solid.mesh, process=False).is_watertight
    wound = winding_number(inside, solid.vertices[solid.faces])  # the grid shuts passages narrower than a cell
    assert (np.abs(wound - 1) < 1e-6).mean() > 0.95
    np.testing.assert_allclose(winding_number(outside[::10], solid.vertices[solid.faces]), 0, atol=1e-6)


@pytest.mark.slow
def test_a_tangle_of_many_faces_is_wrapped() -> None:
    vertices, faces = tangle()
    mesh = trimesh.Trimesh(vertices, faces, process=False)
    for _ in range(3):
        mesh = mesh.subdivide()
    solid = repaired((np.array(mesh.vertices), np.array(mesh.faces)))
    (body,) = solid.bodies
    assert body.step == "wrapped"
    assert body.deviation < 0.045  # 1.5 radii of the ball
    assert not crosses_itself(*solid.mesh)


def test_other_bodies_stay_as_they_are() -> None:
    mesh = beside((np.array(BOX.vertices), np.array(BOX.faces)), tangle())
    solid = repaired(mesh)
    assert [body.step for body in solid.bodies] == ["closed", "slab"]
    assert solid.bodies[0].faces_out == 12


@pytest.mark.parametrize("apart", [0.0, 0.3, 1.0])
def test_bodies_that_cross_each_other_are_no_tangle(apart: float) -> None:
    vertices, faces = np.array(BOX.vertices), np.array(BOX.faces)
    mesh = np.concatenate([vertices, vertices * [3, 0.3, 0.3] + [apart, 0, 0]]), np.concatenate([faces, faces + 8])
    assert {body.step for body in repaired(mesh).bodies} == {"closed"}


@pytest.mark.slow
def test_a_body_with_large_faces_that_is_inside_out_here_and_there_is_a_tangle() -> None:
    """A bracket of 28 triangles, one of them gone and two with a wrong corner."""
    result = rlacd.decompose(FAULTY_BRACKET, threads=2, quality="fast")
    assert len(result) < 60
    assert result.report.hausdorff.missed < 1e-3
    assert result.report.hausdorff.added < 0.06


@pytest.mark.slow
@pytest.mark.parametrize("seed", [0, 1])
@pytest.mark.promise("bounded")
def test_a_tangle_takes_bounded_work(seed: int) -> None:
    mesh = tangle(seed)
    result = rlacd.decompose(mesh, threads=2)
    assert result.report.complete
    assert len(result) < 60
    assert result.report.hausdorff.missed < 1e-3
    assert result.report.hausdorff.added < 0.055
    assert result.report.concavity.max <= 0.05
    assert "1 body crosses" in result.report.warnings[0]


@pytest.mark.slow
def test_cutting_stops_at_its_bound_and_says_so(monkeypatch: pytest.MonkeyPatch) -> None:
    torus = trimesh.creation.torus(1, 0.4, major_sections=32, minor_sections=16)
    monkeypatch.setattr(rlacd.cut_and_merge, "MOST_CUTTING", 2e4)
    monkeypatch.setattr(rlacd.cut_and_merge, "MOST_PER_FACE", 0)
    one, two = (rlacd.decompose(torus, quality="fast", threads=threads) for threads in (1, 2))
    assert "cutting stopped at its bound" in " ".join(one.report.warnings)
    assert one.report.complete
    assert one.report.hausdorff.missed < 1e-6
    assert [hull.vertices.tolist() for hull in one] == [hull.vertices.tolist() for hull in two]


# The caps of these five triangles cross them: little of the solid is inside out, but pieces of it are lost.
CORNERS = [-2.071, -0.031, 0.537, 0.208, -0.802, 0.736, -0.297, 0.851, 1.704]
CORNERS += [-0.136, -0.907, 0.201, -0.694, -0.291, -0.14, -1.065, -0.263, 0.706]
CROSSING = np.reshape(CORNERS, (6, 3)), np.array([(0, 4, 3), (4, 5, 2), (2, 3, 0), (1, 2, 0), (5, 1, 0)])


@pytest.mark.parametrize(
    ("mesh", "within", "steps"), [(tangle(1), 1e-9, 2), (tangle(1), 1e-9, 8), (CROSSING, 5e-3, 2), (CROSSING, 5e-3, 4)]
)
def test_stopped_while_a_tangle_or_pockets_are_cut_the_hulls_cover_them(mesh: Mesh, within: float, steps: int) -> None:
    cuts = itertools.count()

    def go_on(progress: rlacd.Progress) -> bool:
        return progress.stage != "cut" or next(cuts) < steps

    options = {"threshold": 0.1, "policy": "greedy-max-excess"} if mesh is CROSSING else {}
    result = rlacd.decompose(mesh, quality="fast", threads=1, progress=go_on, **options)
    assert result.report.stopped_by == "cancel"
    assert farthest(mesh, result) < within


def farthest(mesh: tuple[np.ndarray, np.ndarray], result: rlacd.Decomposition) -> float:
    """How far sampled points of a mesh are from the hulls, at most."""
    points = trimesh.sample.sample_surface(trimesh.Trimesh(*mesh, process=False), 500, seed=0)[0]
    hulls = [Polytope(np.array(hull.vertices), np.array(hull.faces)) for hull in result]
    return float(distance_to_union(points, hulls).max())


@pytest.mark.slow
def test_bodies_that_cross_each_other_too_often_are_enclosed_instead_of_united() -> None:
    """A union of them would take minutes inside manifold3d, which heeds neither a timeout nor Ctrl-C."""
    rng, some = np.random.default_rng(0), []
    for _ in range(6):
        body = trimesh.creation.torus(1, 0.3, major_sections=11, minor_sections=4)
        body.vertices = rng.uniform(-1, 1, body.vertices.shape) * [1, 1, 0.01]
        some.append(body)
    mesh = trimesh.util.concatenate(some)
    hulls = rlacd.decompose((mesh.vertices, mesh.faces), quality="fast")
    assert any("crosses itself too often to be united exactly" in said for said in hulls.report.warnings)
    assert hulls.report.complete
    assert all(hull.is_convex and hull.is_volume for hull in hulls)
    assert hulls.report.hausdorff.missed < 1e-3
    assert hulls.report.concavity.max <= 0.05
