"""Gluing parts that touch: the faces between them vanish, everything else stays."""

from __future__ import annotations

import numpy as np
import pytest
from manifold3d import Manifold

from rlacd import _native
from rlacd.solid.component import Component, Part, Plane
from tests.test_sweep import SOLIDS


@pytest.mark.parametrize("name", SOLIDS)
@pytest.mark.parametrize("seed", range(5))
def test_gluing_undoes_a_cut(name: str, seed: int) -> None:
    solid = Component(SOLIDS[name]())
    rng = np.random.default_rng(seed)
    normal = rng.normal(size=3)
    normal /= np.linalg.norm(normal)
    below, above = solid.cut(Plane(tuple(normal), float(normal @ solid.vertices.mean(axis=0))))
    assert below is not None
    assert above is not None
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


def test_coplanar_faces_on_the_same_side_stay() -> None:
    left = Component(Manifold.cube((1, 1, 1)))
    right = Component(Manifold.cube((1, 1, 1)).translate((2, 0, 0)))
    glued = Part.glued(left, right)
    assert _native.mesh_area(glued.vertices, glued.faces) == pytest.approx(12)


def test_parts_that_are_all_film_keep_their_surfaces() -> None:
    """Every face of such a part touches the other one: without a surface there would be nothing to measure."""
    below = Component(Manifold.cube((1, 1, 2e-9)))
    above = Component(Manifold.cube((1, 1, 2e-9)).translate((0, 0, 2e-9)))
    glued = Part.glued(below, above)
    assert len(glued.faces) == len(below.faces) + len(above.faces)
