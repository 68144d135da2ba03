"""Any soup gives one closed solid by the least change, however finely it is divided, and with a little noise."""

from __future__ import annotations

import math

import numpy as np
import pytest
import trimesh
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial import cKDTree
from scipy.spatial.transform import Rotation

import rlacd
from rlacd.io.read.load import load_mesh
from rlacd.repair.distance import SurfaceQuery, points_covering
from rlacd.repair.repair import repair
from rlacd.repair.union import to_arrays
from rlacd.repair.wanted import DEFAULT_GAP
from rlacd.solid.component import Component
from rlacd.solid.manifold import to_manifold
from tests.repair.repaired import BOX, check_closed, join, moved, solid_of, steps, volume, without
from tests.scripts import script


def soup(mesh):
    """Every face with corners of its own."""
    return trimesh.Trimesh(
        mesh.vertices[mesh.faces].reshape(-1, 3), np.arange(3 * len(mesh.faces)).reshape(-1, 3), process=False
    )


SHAPES = {
    "box": BOX,
    "ball": trimesh.creation.icosphere(subdivisions=2),
    "ring": trimesh.creation.torus(1, 0.3),
    "pipe": trimesh.creation.annulus(0.5, 1, 2),
}


@pytest.mark.parametrize("name", SHAPES)
@given(seed=st.integers(0, 10**6), flip=st.sampled_from(["none", "all", "some"]), split=st.booleans())
@settings(max_examples=15, deadline=None)
@pytest.mark.promise("repair-keeps")
def test_a_closed_body_keeps_every_face_whatever_its_windings(name, seed, flip, split):
    mesh = SHAPES[name].copy()
    random = np.random.default_rng(seed)
    faces = mesh.faces[random.permutation(len(mesh.faces))]
    turned = {"none": np.zeros, "all": np.ones, "some": lambda n, dtype: random.random(n) < 0.5}[flip](
        len(faces), dtype=bool
    )
    faces[turned] = faces[turned][:, ::-1]
    given_mesh = trimesh.Trimesh(mesh.vertices, faces, process=False)
    solid = solid_of(soup(given_mesh) if split else given_mesh)
    assert volume(solid) == pytest.approx(mesh.volume, rel=1e-12)
    assert solid.bodies[0].step == ("closed" if flip == "none" else "reoriented")
    assert solid.bodies[0].deviation == 0
    vertices, out = to_arrays(solid.manifold)
    expected = solid.frame.to_frame(mesh.vertices[mesh.faces].reshape(-1, 3)).reshape(-1, 3, 3)

    def rows(t):
        """Triangles as sets of corners, sorted."""
        t = np.round(t.reshape(-1, 3, 3), 9) + 0.0
        t = np.array([corner[np.lexsort(corner.T)] for corner in t]).reshape(-1, 9)
        return t[np.lexsort(t.T)]

    np.testing.assert_array_equal(rows(vertices[out]), rows(expected))


@given(st.integers(0, 10**6))
@settings(max_examples=30, deadline=None)
def test_overlapping_boxes_have_the_volume_of_their_union(seed):
    random = np.random.default_rng(seed)
    lower = random.uniform(-1, 1, (3, 3))
    upper = lower + random.uniform(0.3, 1.5, (3, 3))
    boxes = [trimesh.creation.box(bounds=np.stack([a, b])) for a, b in zip(lower, upper, strict=True)]
    solid = solid_of(join(*boxes))

    def meet(some):
        return np.prod(np.maximum(upper[some].min(axis=0) - lower[some].max(axis=0), 0))

    union = sum(meet([i]) for i in range(3)) - meet([0, 1]) - meet([0, 2]) - meet([1, 2]) + meet([0, 1, 2])
    assert volume(solid) == pytest.approx(union, rel=1e-9)
    assert steps(solid) == ["closed"] * 3


def sides(gap=0.0):
    """The six sides of a box, each moved outwards."""
    found = [BOX.submesh([np.flatnonzero(BOX.face_normals @ n > 0.9)], append=True) for n in (*np.eye(3), *-np.eye(3))]
    return [moved(side, *(gap * side.face_normals[0])) for side in found]


def cracked():
    mesh = soup(BOX)
    mesh.vertices += np.random.default_rng(0).uniform(-1e-5, 1e-5, mesh.vertices.shape)
    return mesh


def t_junction():
    """One face of the box is split at the middle of an edge that its neighbour keeps whole."""
    a, b, c = BOX.faces[0]
    vertices = np.vstack([BOX.vertices, (BOX.vertices[a] + BOX.vertices[b]) / 2])
    return trimesh.Trimesh(vertices, np.vstack([BOX.faces[1:], [a, 8, c], [8, b, c]]), process=False)


def planks():
    mesh = join(*(trimesh.creation.box(bounds=[[i, 0, 0], [i + 1, 3 + i % 2, 1]]) for i in range(4)))
    mesh.merge_vertices()
    return mesh


WHOLE = {
    "faces doubled both ways": (join(BOX, BOX, trimesh.Trimesh(BOX.vertices, BOX.faces[:, ::-1])), 8, 1e-6, 1e-9),
    "boxes that share an edge": (join(BOX, moved(BOX, 2, 2, 0)), 16, 1e-6, 1e-9),
    "boxes that share a vertex": (join(BOX, moved(BOX, 2, 2, 2)), 16, 1e-6, 1e-9),
    "boxes that share a face": (join(BOX, moved(BOX, 2, 0, 0)), 16, 1e-6, 1e-9),
    "six separate sides": (join(*sides()), 8, 1e-6, 1e-9),
    "six sides that do not quite touch": (join(*sides(0.004)), 8 * 1.004**3, 0.05, 2 * DEFAULT_GAP),
    "corners that do not quite meet": (cracked(), 8, 1e-3, 1e-4),
    "a T-junction": (t_junction(), 8, 1e-6, 1e-9),
    "planks whose faces do not match": (planks(), 3 + 4 + 3 + 4, 1e-6, 1e-9),
}


@pytest.mark.parametrize("name", WHOLE)
@pytest.mark.promise("repair-keeps")
def test_what_is_meant_to_be_solid_is_so_by_a_small_change(name):
    mesh, expected, rel, most = WHOLE[name]
    solid = solid_of(mesh)
    assert volume(solid) == pytest.approx(expected, rel=rel)
    assert max(body.deviation for body in solid.bodies) <= most
    assert len(solid.surface[1]) == 12 or name != "faces doubled both ways"


FOLDED = (
    np.array([[2.0, 1, 0], [0, 1, 0], [0, 1, 1], [2, 1, 1], [0, 0, 0], [2, 0, 0], [2, 0, 1]]),
    np.array(
        [[0, 1, 2], [0, 2, 3], [4, 0, 5], [0, 4, 1], [4, 2, 1], [6, 0, 3], [0, 6, 5], [4, 5, 2], [5, 3, 2], [5, 6, 3]]
    ),
)
"""A wedge of volume 1, its last face folded back onto its neighbours; turned, most come out of manifold3d changed."""


@pytest.mark.parametrize("seed", range(40))
def test_folded_faces_stay_where_they_are(seed):
    vertices, faces = FOLDED
    turned = np.ascontiguousarray(vertices @ Rotation.random(random_state=seed).as_matrix())
    assert to_manifold(turned, faces).volume() == pytest.approx(1, abs=1e-4)
    assert Component((turned, faces.astype(np.int32))).volume == pytest.approx(1, abs=1e-4)


def test_a_closed_mesh_with_folds_is_kept(corpus):
    solid = repair(load_mesh(corpus / "train/kenney_cc0/graveyard_kit__debris.ply"))
    check_closed(solid)
    vertices, faces = solid.surface
    a, b, c = (vertices[faces[:, k]] for k in range(3))
    assert steps(solid) == ["closed"]
    assert solid.manifold.volume() == pytest.approx(np.einsum("ij,ij->i", a, np.cross(b, c)).sum() / 6, abs=1e-6)


@pytest.mark.parametrize("spacing", [0.05, 0.2, 1.0])
def test_points_cover_every_face_and_share_corners(spacing: float) -> None:
    ball = trimesh.creation.icosphere(3)
    faces = np.concatenate([ball.faces, [[0, 40, 300], [5, 77, 500]]])
    vertices = np.asarray(ball.vertices)
    points, on = points_covering(vertices, faces, spacing)
    weights = np.random.default_rng(0).dirichlet([1, 1, 1], (len(faces), 40))
    samples = np.einsum("fsc,fcx->fsx", weights, vertices[faces]).reshape(-1, 3)
    assert cKDTree(points).query(np.concatenate([samples, vertices]))[0].max() <= spacing
    np.testing.assert_allclose(trimesh.triangles.closest_point(vertices[faces[on]], points), points, atol=1e-12)
    if spacing == 1.0:
        assert len(points) < len(vertices) + 50


def noisy_copy(corpus, name):
    """The mesh, and a copy of some 10,000 faces or more that is displaced by 0.001 of half the longest side."""
    mesh = trimesh.load(corpus / name, force="mesh", process=False)
    return mesh, script(corpus / "dense.py").densify(mesh.copy(), 10_000, 0.001)


def finely(mesh, times, noise=0.0):
    """Every triangle divided into four, so many times, and all vertices displaced a little."""
    mesh = trimesh.Trimesh(mesh.vertices, mesh.faces, process=False)
    mesh.merge_vertices()
    for _ in range(times):
        mesh = mesh.subdivide()
    shift = np.random.default_rng(0).normal(0, noise, mesh.vertices.shape) if noise else 0
    return trimesh.Trimesh(mesh.vertices + shift, mesh.faces, process=False)


def box_with_room():
    """A box, and on it a room of sheets, half as high, with a slit in its roof and eaves: 8 + 4 units of volume."""
    x, top = [-1, -0.01, 0.01, 1], 2.0
    roof = [(a, y, top) for y in (-1, 1) for a in x]
    eaves = [(2, y, top) for y in (-1, 1)]
    floor = [(a, y, 1.0) for y in (-1, 1) for a in (-1, 1)]
    quads = [[0, 1, 5, 4], [2, 3, 7, 6], [0, 4, 10, 8], [3, 9, 11, 7], [3, 12, 13, 7]]
    fans = [[8, 0, 1], [8, 1, 2], [8, 2, 9], [9, 2, 3], [10, 5, 4], [10, 6, 5], [10, 11, 6], [11, 7, 6]]
    faces = [t for a, b, c, d in quads for t in ([a, b, c], [a, c, d])] + fans
    return join(BOX, trimesh.Trimesh([*roof, *floor, *eaves], faces, process=False))


@pytest.mark.parametrize(("times", "noise"), [(0, 0.0), (4, 0.0), (4, 1e-3)])
def test_a_room_of_sheets_on_a_box_is_filled_and_the_box_stays(times, noise):
    mesh = finely(box_with_room(), times, noise)
    solid = solid_of(mesh)
    assert volume(solid) == pytest.approx(12, rel=0.02)
    query, there = SurfaceQuery(*to_arrays(solid.shape)), solid.frame.to_frame(mesh.vertices)
    assert query.distance(there)[~query.inside(there)].max(initial=0) <= 1e-3


@pytest.mark.parametrize("times", [0, 2])
def test_a_capped_body_whose_faces_cross_at_an_edge_is_solid(times):
    """Two wedges share an edge and overlap by a hair: the angles around it join the inside with the outside."""
    angles = np.radians([0, 30, 29.9, 60])
    rays = [(np.cos(a), np.sin(a)) for a in angles]
    corners = [(0, 0, z) for z in (0, 1)] + [(x, y, z) for x, y in rays for z in (0, 1)]
    wedge = [[0, 2, 3], [0, 3, 1], [0, 5, 4], [0, 1, 5], [2, 4, 5], [2, 5, 3], [0, 4, 2], [1, 3, 5]]
    faces = wedge + [[i if i < 2 else i + 4 for i in face] for face in wedge]
    closed = finely(trimesh.Trimesh(corners, faces, process=False), times)
    far = int(np.argmax(closed.triangles_center @ (1, 0, 0)))
    solid = solid_of(without(closed, far))
    assert volume(solid) == pytest.approx(np.sin(np.radians(30)), rel=0.02)


LOST = [
    *("test/capod/class5__m54.ply", "test/capod/class5__m55.ply", "test/capod/class5__m58.ply"),  # plants, wrapped
    "train/kenney_cc0/space_kit__spaceCraft1.ply",  # slivers around a room that is filled
    "test/gazebo_models/speed_limit_sign__speed_limit_sign.ply",  # caps turn it inside out in places
    "train/kenney_cc0/furniture_pack__cabinetBedDrawer.ply",  # its first skin leads away from it
]
CROSSING = [f"test/ikea_assembled/{name}.ply" for name in ("bed_dalselv_0270", "bookcase_hensvik_0565")]
CROSSING += [f"test/ikea_assembled/cabinet_akurum_{name}.ply" for name in ("0011", "0021")]
CROSSING += ["test/vhacd/hornbug.ply", "train/kenney_cc0/furniture_pack__kitchenCabinetUpper.ply"]
CROSSING += ["train/kaykit_cc0/restaurant__crate_ham.ply"]
"""Noisy copies of these have skins that cross themselves."""

ACROSS_A_GAP = CROSSING[0]
"""Of faces with edges up to `DEFAULT_GAP`, repair looks at corners only: middles may lie outside. A warning tells."""


@pytest.mark.nightly
@pytest.mark.parametrize("name", [*LOST, *CROSSING])
@pytest.mark.promise("covered")
def test_nothing_of_meshes_of_which_something_was_lost_lies_outside(corpus, name):
    report = rlacd.decompose(noisy_copy(corpus, name)[1] if name in CROSSING else corpus / name, quality="fast").report
    under = report.hausdorff.missed
    if name == ACROSS_A_GAP:
        assert under <= 0.006  # up to DEFAULT_GAP / √3 is possible, 0.0052 is what happens
        said = f"up to {under / report.scale:.4g} units outside the hulls"
        assert any(said in warning for warning in report.warnings)
    else:
        assert under <= 1e-3
    assert report.concavity.max <= 0.0501
    radii = math.sqrt(2) if "class5" in name else 1  # a wrap ends at balls, a right angle at most from where they touch
    assert max(body.deviation for body in report.repair) < radii * DEFAULT_GAP


# Faces without an area beside a box, and how far from its hull a corner lies that no other face has.
NOTHING = {
    "a point": ([[3, 0, 0]], [[0, 0, 0]], 2),
    "a point, three times": ([[3, 0, 0]] * 3, [[0, 1, 2]], 2),
    "points": ([[3, 0, 0], [0, -4, 0]], [[0, 0, 0], [1, 1, 1]], 3),
    "an edge": ([[3, 0, 0]], [[-8, 0, 0]], 2),
    "an edge apart": ([[3, 0, 0], [4, 0, 0]], [[0, 1, 1]], 3),
    "a point inside": ([[0.5, 0, 0]], [[0, 0, 0]], 0),
    "an edge inside": ([[0.5, 0, 0]], [[-8, 0, 0]], 0),
    "three corners in a line": ([[3, 0, 0], [4, 0, 0], [5, 0, 0]], [[0, 1, 2]], 0),
    "a line from a corner": ([[3, 3, 3], [5, 5, 5]], [[-1, 0, 1]], 0),
    "a sliver": ([[3, 0, 0], [4, 1e-13, 0], [5, 0, 0]], [[0, 1, 2]], 0),
}


@pytest.mark.parametrize("name", NOTHING)
@pytest.mark.promise("covered")
@pytest.mark.promise("loss-named")
def test_corners_of_faces_without_an_area_are_covered_or_named(name: str) -> None:
    points, faces, away = NOTHING[name]
    mesh = (np.concatenate([BOX.vertices, points]), np.concatenate([BOX.faces, np.array(faces) + 8]))
    result = rlacd.decompose(mesh, quality="fast", threads=1)
    corners = np.array(points, dtype=float)
    missed = np.min([trimesh.proximity.signed_distance(hull, corners) * -1 for hull in result], axis=0).max()
    assert max(missed, 0) == pytest.approx(away, abs=2e-3)
    report = result.report
    assert report.hausdorff.missed / report.scale == pytest.approx(away, abs=2e-3)
    said = [warning for warning in report.warnings if "only a point or an edge were left out" in warning]
    assert len(said) == (away > 0)
    assert not said or f"lie{'s' if '1 corner ' in said[0] else ''} up to {away} units outside" in said[0]


@pytest.mark.parametrize("width", [1e-9, 1e-6, 1e-4, 1e-3, 1e-2])
@pytest.mark.promise("covered")
def test_needles_apart_are_kept_though_they_are_narrower_than_cracks(width: float) -> None:
    needles = np.array([[[3, 0, 0], [5, 1, 0], [5, 1 + width, 0]], [[0, -4, width], [1, -2, 2], [0, -4, 0]]])
    corners = np.concatenate([BOX.vertices, needles.reshape(-1, 3)])
    faces = np.concatenate([BOX.faces, [[8, 9, 10], [11, 12, 13]]])
    result = rlacd.decompose((corners, faces), quality="fast", threads=1)
    outside = [trimesh.proximity.signed_distance(hull, corners[8:]) * -1 for hull in result]
    assert np.min(outside, axis=0).max() <= 2e-3 / result.report.scale
    assert result.report.hausdorff.missed <= 1e-3
    assert {body.step for body in result.report.repair} == {"closed", "slab"}


@pytest.mark.parametrize("per_node", [False, True])
def test_a_node_without_size_is_named_if_hulls_miss_it(per_node: bool) -> None:
    speck = trimesh.Trimesh([[3, 0, 0]] * 3, [[0, 1, 2]], process=False)
    scene = trimesh.Scene({"one": BOX, "two": moved(BOX, -2, 0, 0), "speck": speck})
    report = rlacd.decompose(scene, per_node=per_node, quality="fast", threads=1).report
    assert report.hausdorff.missed == pytest.approx(1.0)
    assert "1 corner lies up to 2 units outside the hulls, farthest near (3, 0, 0)" in report.warnings[0]
