"""Slits between flat walls are filled exactly; holes, wide gaps and what is asked to stay open are left."""

from __future__ import annotations

import numpy as np
import pytest
import trimesh

import rlacd
from rlacd.io.read.load import load_mesh
from rlacd.repair.repair import repair
from rlacd.repair.slits import without_slits

PAGES, THICK = 8, 0.05


def box(lower, upper):
    return trimesh.creation.box(bounds=(lower, upper))


def book(gap, seed=None):
    """Pages on a spine, 2 long and 1.2 deep, turned at random."""
    step = THICK + gap
    pages = [box((-1, 0, i * step), (1, 1.2, i * step + THICK)) for i in range(PAGES)]
    whole = trimesh.util.concatenate([*pages, box((-1, -0.1, 0), (1, 0.05, PAGES * step - gap))])
    if seed is not None:
        whole.apply_transform(trimesh.transformations.random_rotation_matrix(np.random.default_rng(seed).random(3)))
    return whole


def repaired(mesh):
    solid = repair(load_mesh((mesh.vertices, mesh.faces)), threads=1)
    return solid, without_slits(solid, 0.03, 0.1)


@pytest.mark.parametrize("seed", range(4))
def test_what_lies_between_pages_is_filled_and_nothing_else(seed):
    gap = 0.02
    solid, filled = repaired(book(gap, seed))
    scale = solid.frame.scale
    assert gap * scale < 0.03
    added = filled.manifold.volume() - solid.manifold.volume()
    assert added == pytest.approx((PAGES - 1) * gap * 2 * 1.15 * scale**3, rel=1e-5)
    assert solid.manifold.hull().volume() == pytest.approx(filled.manifold.hull().volume(), rel=1e-6)
    [said] = filled.warnings
    assert said.startswith(f"{PAGES - 1} slits were filled")


def hole(width, length):
    """A block with a hole all through it."""
    a, b = width / 2, length / 2
    sides = [
        box((-1, -1, -0.5), (-b, 1, 0.5)),
        box((b, -1, -0.5), (1, 1, 0.5)),
        box((-1, -1, -0.5), (1, -a, 0.5)),
        box((-1, a, -0.5), (1, 1, 0.5)),
    ]
    return trimesh.util.concatenate(sides)


@pytest.mark.parametrize(("width", "length", "is_filled"), [(0.02, 0.02, False), (0.02, 1, True), (0.05, 1, False)])
def test_what_is_narrow_in_two_directions_or_wide_stays_open(width, length, is_filled):
    solid, filled = repaired(hole(width, length))
    assert (filled is not solid) == is_filled
    if is_filled:
        assert filled.manifold.volume() == pytest.approx(4.0, rel=1e-6)


def test_a_room_stays_empty_behind_a_slit_all_around_its_lid():
    chest = [
        box((-1, -1, -1), (1, 1, -0.7)),
        box((-1, -0.9, -0.9), (-0.7, 0.9, 0.7)),
        box((0.7, -0.9, -0.9), (1, 0.9, 0.7)),
        box((-1, -1, -0.8), (1, -0.7, 0.7)),
        box((-1, 0.7, -0.8), (1, 1, 0.7)),
    ]
    solid, filled = repaired(trimesh.util.concatenate([*chest, box((-1, -1, 0.72), (1, 1, 1))]))
    assert solid.manifold.volume() < 6
    assert filled is solid


def test_a_book_of_narrow_gaps_is_one_block_whose_mass_is_that_of_its_pages():
    mesh = book(0.02)
    result = rlacd.decompose(mesh, quality="fast", threads=1)
    assert len(result) <= 2
    assert any("slits were filled" in said for said in result.report.warnings)
    assert result.report.hausdorff.added <= 0.6 * 0.05 / 2 + 1e-3
    pages = PAGES * THICK * 2 * 1.2 + 2 * 0.15 * (PAGES * (THICK + 0.02) - 0.02) - PAGES * THICK * 2 * 0.05
    assert result.report.mass.volume_abs == pytest.approx(pages, rel=1e-5)


@pytest.mark.parametrize("options", [{"gap": 0.01}, {"openings": "thin"}, {"keep_cavities": True}, {"keep_open": 0.5}])
def test_slits_stay_open_where_that_is_asked_for(options):
    result = rlacd.decompose(book(0.02), quality="fast", threads=1, **options)
    assert len(result) >= PAGES
    assert not any("slit" in said for said in result.report.warnings)


@pytest.mark.parametrize(("gap", "slits"), [(2e-9, 0), (2e-3, 1)])
def test_walls_that_lie_on_each_other_to_rounding_are_no_slit(gap, slits):
    blocks = [box((-1, -0.5, -0.5), (1, 0.5, 0)), box((-1, -0.5, gap), (1, 0.5, 0.5))]
    _, filled = repaired(trimesh.util.concatenate(blocks))
    assert sum("filled" in said for said in filled.warnings) == slits
