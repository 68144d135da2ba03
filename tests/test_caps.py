"""Caps close a cut as often as the solid overlaps itself, and lead nowhere out of it."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from rlacd import _native
from rlacd.solid.arrays import FloatArray, IntArray
from rlacd.solid.hull import Hull
from tests.shapes import is_closed

Surface = tuple[FloatArray, IntArray]
NOTHING = np.empty((0, 3)), np.empty((0, 3), np.int32)


def cut(surface: Surface, normal: tuple[float, float, float], offset: float) -> list[Surface]:
    return [NOTHING if side is None else side[:2] for side in _native.cut(*surface, *normal, offset, -np.inf)]


def together(*solids: Surface) -> Surface:
    """Several solids as one surface; where they overlap it runs around the points more than once."""
    first = np.cumsum([0, *(len(vertices) for vertices, _ in solids[:-1])])
    faces = np.concatenate([own + start for (_, own), start in zip(solids, first, strict=True)])
    return np.concatenate([vertices for vertices, _ in solids]), faces.astype(np.int32)


def blob(seed: int) -> Surface:
    """The hull of random points."""
    random = np.random.default_rng(seed)
    hull = Hull.of(random.normal(size=(12, 3)) * 0.3 + random.uniform(-0.2, 0.2, 3))
    assert hull is not None
    return hull.vertices, hull.faces


def volume(surface: Surface) -> float:
    return _native.mesh_volume(*surface) if len(surface[1]) else 0.0


def caps_of(side: Surface, normal: tuple[float, float, float], offset: float) -> np.ndarray:
    """Corners [T, 3, 3] of the triangles in a plane."""
    corners = side[0][side[1]]
    return corners[(np.abs(corners @ normal - offset) < 1e-12).all(axis=1)]


@given(seed=st.integers(0, 10**6), number=st.integers(2, 5), inside_out=st.booleans())
def test_a_solid_that_overlaps_itself_is_cut_like_its_bodies_one_by_one(seed, number, inside_out) -> None:
    bodies = [blob(seed + i) for i in range(number)]
    if inside_out:
        bodies[0] = bodies[0][0], np.ascontiguousarray(bodies[0][1][:, ::-1])
    normal = tuple(np.random.default_rng(seed).normal(size=3).tolist())
    normal = tuple(c / np.linalg.norm(normal) for c in normal)
    whole = together(*bodies)
    original = _native.Surface(*whole)
    for k, side in enumerate(cut(whole, normal, 0.05)):
        own = [volume(cut(body, normal, 0.05)[k]) for body in bodies]
        assert volume(side) == pytest.approx(sum(own), abs=1e-9)
        if not len(side[1]):
            continue
        assert is_closed(side[1])
        a, b, c = np.moveaxis(caps_of(side, normal, 0.05), 1, 0)
        sizeable = np.linalg.norm(np.cross(b - a, c - a), axis=1) > 1e-6
        if sizeable.any():
            winding = original.winding(((a + b + c) / 3)[sizeable])
            assert (np.abs(winding) > 0.5).all()  # no cap outside


@given(seed=st.integers(0, 10**6))
def test_cuts_follow_cuts_without_piling_up_vertices(seed) -> None:
    """Caps lie on each other where a solid overlaps itself; the next plane cuts all of them at the same points."""
    surface = together(*(blob(seed + i) for i in range(3)))
    random = np.random.default_rng(seed)
    size = len(surface[1])
    for _ in range(8):
        normal = random.normal(size=3)
        normal /= np.linalg.norm(normal)
        surface = cut(surface, tuple(normal.tolist()), 0.25)[0]
        assert is_closed(surface[1])
    assert len(surface[1]) < 10 * size


@pytest.mark.parametrize("offset", [0.0, 0.25, 0.5, 1.0])
def test_films_that_coincide_are_closed(offset) -> None:
    """Two boxes that share their faces and cross: rims coincide in part."""
    box = Hull.of(np.array([[x, y, z] for x in (0, 1) for y in (0, 1) for z in (0, 1)], dtype=float))
    assert box is not None
    for shift in ((0.0, 0.0, 0.0), (0.5, 0.0, 0.0), (0.25, 0.5, 0.0)):
        surface = together((box.vertices, box.faces), (box.vertices + shift, box.faces))
        sides = cut(surface, (0.0, 0.0, 1.0), offset)
        for side in sides:
            if len(side[1]):
                assert is_closed(side[1])
        assert volume(sides[0]) == pytest.approx(2 * offset, abs=1e-9)
        assert volume(sides[1]) == pytest.approx(2 - 2 * offset, abs=1e-9)
