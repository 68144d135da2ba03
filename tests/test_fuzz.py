"""Whatever shapes are thrown together and damaged, the judges of `fuzz/` find nothing wrong with what comes out."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import rlacd
from fuzz.judges import finite_faces
from fuzz.recipes import make_shape
from fuzz.shapes import run_seed
from fuzz.worker import InProcess

pytestmark = pytest.mark.nightly


@pytest.mark.parametrize("seed", range(3, 40))
@pytest.mark.promise("any-mesh", "covered", "report-true")
def test_promises_hold_for_any_soup_and_any_options(seed: int, tmp_path: Path) -> None:
    row = run_seed(seed, InProcess(), tmp_path)
    assert row.status in ("done", "refused"), row.said


@pytest.mark.parametrize("seed", range(25))
def test_scaling_by_a_power_of_two_scales_the_hulls(seed: int) -> None:
    shape, factor = make_shape(seed), 2.0 ** (3 * (seed % 25) - 36)
    if len(finite_faces(shape)) == 0:
        return
    one, other = (
        rlacd.decompose((vertices, shape.faces), threshold=0.2, threads=1, timeout=60)
        for vertices in (shape.vertices, shape.vertices * factor)
    )
    if one.report["complete"] and other.report["complete"]:
        for a, b in zip(one, other, strict=True):
            np.testing.assert_array_equal(a.vertices * factor, b.vertices)
            np.testing.assert_array_equal(a.faces, b.faces)
