"""Clipping a solid to a convex hull without a boolean, and which hulls take in what of a surface others miss."""

from __future__ import annotations

import numpy as np
import pytest
import trimesh
from manifold3d import Manifold, Mesh64

from rlacd.solid.component import Component, Plane
from rlacd.solid.distance import hull_union
from rlacd.solid.hull import Hull
from rlacd.solid.manifold import to_manifold
from tests.shapes import component_of, is_closed


def solids() -> dict[str, trimesh.Trimesh]:
    bumpy = trimesh.creation.icosphere(subdivisions=4)
    bumpy.vertices *= 1 + 0.1 * np.random.default_rng(0).normal(size=(len(bumpy.vertices), 1))
    return {
        "box": trimesh.creation.box((1, 2, 3)),
        "ring": trimesh.creation.torus(1.0, 0.3, 64, 32),
        "bumpy ball": bumpy,
        "hollow box": trimesh.creation.box((2, 2, 2)) + inverted(trimesh.creation.box((1.5, 1.5, 1.5))),
        "two boxes": trimesh.creation.box((1, 1, 1)) + trimesh.creation.box((1, 1, 1)).apply_translation((2, 0, 0)),
    }


def inverted(mesh: trimesh.Trimesh) -> trimesh.Trimesh:
    mesh.invert()
    return mesh


def hulls(mesh: trimesh.Trimesh, count: int = 30) -> list[Hull]:
    """Hulls of corners of the solid, whose faces touch the facets, of grid points, and of any points."""
    rng = np.random.default_rng(1)
    found = []
    for size in rng.integers(4, 40, size=count).tolist():
        near = mesh.vertices[rng.integers(len(mesh.vertices))]
        for points in (
            mesh.vertices[rng.integers(len(mesh.vertices), size=size)],
            rng.integers(-4, 5, size=(size, 3)) / 2,
            near + 0.3 * rng.normal(size=(size, 3)),
        ):
            hull = Hull.of(np.array(points, dtype=np.float64))
            if hull is not None:
                found.append(hull)
    return found


@pytest.mark.slow
@pytest.mark.parametrize("name", solids())
def test_clipping_agrees_with_a_boolean(name: str) -> None:
    mesh = solids()[name]
    solid = component_of(mesh)
    whole = to_manifold(solid.vertices, solid.faces)
    for hull in hulls(mesh):
        part = solid.inside(hull)
        vertices, faces = part.vertices, part.faces
        assert is_closed(faces)
        boolean = whole ^ Manifold(Mesh64(hull.vertices, hull.faces.astype(np.uint64)))
        assert part.volume == pytest.approx(boolean.volume(), abs=1e-6)
        if len(faces):
            planes = hull.vertices[hull.faces]
            normals = np.cross(planes[:, 1] - planes[:, 0], planes[:, 2] - planes[:, 0])
            large = np.linalg.norm(normals, axis=1) > 1e-6
            normals = normals[large] / np.linalg.norm(normals[large], axis=1)[:, None]
            heights = np.einsum("vfk,fk->vf", vertices[:, None] - planes[None, large, 0], normals)
            assert heights[np.unique(faces)].max() < 1e-6


def test_a_surface_folded_by_noise_is_clipped_and_its_halves_add_up() -> None:
    """Some hulls have corners where the folded surface holds them twice, or turns inside out."""
    crumpled = trimesh.creation.icosphere(subdivisions=4)
    crumpled.vertices += np.random.default_rng(0).uniform(-0.1, 0.1, crumpled.vertices.shape)
    solid = component_of(crumpled)
    rng = np.random.default_rng(2)
    for _ in range(60):
        hull = Hull.of(crumpled.vertices[rng.integers(len(crumpled.vertices), size=12)] * 0.985)
        below, above = Component((hull.vertices, hull.faces)).cut(Plane((0.0, 0.6, 0.8), 0.1))
        whole, *halves = (solid.inside(one) for one in (hull, below.hull, above.hull))
        assert all(is_closed(part.faces) for part in (whole, *halves))
        assert whole.volume == pytest.approx(sum(half.volume for half in halves), rel=1e-3)


def test_a_hull_around_everything_changes_nothing_and_one_inside_is_filled() -> None:
    ball = component_of(solids()["bumpy ball"])
    around = Hull.of(3 * np.array(trimesh.creation.box((1, 1, 1)).vertices))
    inside = Hull.of(0.5 * np.array(trimesh.creation.box((1, 1, 1)).vertices))
    assert ball.inside(around).size == len(ball.faces)
    assert ball.inside(inside).volume == pytest.approx(inside.volume, abs=1e-6)


@pytest.mark.parametrize("name", ["ring", "bumpy ball", "two boxes"])
def test_hulls_that_take_in_what_is_uncovered_cover_the_surface(name: str) -> None:
    """Hulls of pieces of a shrunk copy miss the surface everywhere; each then takes in its share, and little more."""
    mesh = solids()[name]
    shrunk = component_of(mesh.copy().apply_scale(0.97))
    x = np.linspace(*shrunk.box[:, 0], 6)[1:-1]
    pieces, rest = [], to_manifold(shrunk.vertices, shrunk.faces)
    for offset in x:
        beyond, below = rest.split_by_plane((1, 0, 0), float(offset))
        pieces.append(below)
        rest = beyond
    pieces.append(rest)
    corners = [np.array(piece.to_mesh64().vert_properties[:, :3]) for piece in pieces]
    small = [hull for points in corners if (hull := Hull.of(points)) is not None]
    solid = component_of(mesh)
    missed = solid.filling.uncovered([h.vertices for h in small], [h.faces for h in small], 0.1, 1e-3)
    grown = [Hull.of(np.concatenate([h.vertices, p])) for h, p in zip(small, missed, strict=True)]
    assert hull_union(grown, 1).under(solid.vertices, solid.faces, 1e-5, 1)[1] <= 2e-5
    need = hull_union(small, 1).under(solid.vertices, solid.faces, 1e-4, 1)[1]
    for before, after in zip(small, grown, strict=True):
        assert hull_union([before], 1).distance(after.vertices, 1).max() < 6 * need + 1e-2
