"""The same hulls to the bit, whatever the processor can do."""

from __future__ import annotations

import os
import platform
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from tests import bits
from tests.hulls import hull_of
from tests.shapes import component_of

ROOT = Path(__file__).resolve().parents[1]


def older_processor() -> dict[str, str]:
    """Variables that keep numpy, OpenBLAS and the C library to what a processor of 2006 could do: no FMA, no AVX."""
    extra = np.show_config(mode="dicts")["SIMD Extensions"].get("found", [])
    return {
        "OPENBLAS_CORETYPE": "Prescott",
        "NPY_DISABLE_CPU_FEATURES": " ".join(extra),
        "GLIBC_TUNABLES": "glibc.cpu.hwcaps=-AVX,-AVX2,-FMA,-FMA4,-AVX512F,-AVX2_Usable,-FMA_Usable,-AVX512F_Usable",
    }


@pytest.mark.slow
@pytest.mark.skipif(platform.machine() not in ("x86_64", "AMD64"), reason="the variables are those of x86")
@pytest.mark.promise("processor")
def test_an_older_processor_makes_the_same_hulls() -> None:
    command = [sys.executable, "-m", "tests.bits"]
    runs = [
        subprocess.run(command, cwd=ROOT, env={**os.environ, **more}, capture_output=True, text=True, timeout=600)
        for more in ({}, older_processor())
    ]
    assert runs[1].returncode == 0, runs[1].stderr
    assert runs[0].stdout == runs[1].stdout
    assert len(runs[0].stdout.splitlines()) == len(bits.CASES)


def test_axes_are_eigenvectors_of_the_moments() -> None:
    """Against LAPACK, on random boxes turned at random."""
    draw = np.random.default_rng(0)
    for _ in range(50):
        corners = draw.normal(size=(20, 3)) * draw.uniform(0.2, 2, 3)
        rotation, _ = np.linalg.qr(draw.normal(size=(3, 3)))
        component = component_of(hull_of(corners @ rotation))
        axes = component.principal_axes
        moments = _moments(component.vertices[component.faces])
        values, vectors = np.linalg.eigh(moments)
        assert np.abs((axes * vectors.T[::-1]).sum(axis=1)) == pytest.approx(np.ones(3), abs=1e-9)
        assert axes @ axes.T == pytest.approx(np.eye(3), abs=1e-14)
        assert np.diag(axes @ moments @ axes.T) == pytest.approx(values[::-1])
        assert (axes[range(3), np.abs(axes).argmax(axis=1)] > 0).all()


def test_a_cube_keeps_the_axes_of_its_space() -> None:
    """All directions are principal; rounding must not choose some."""
    corners = np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)]) / 3 + 0.1
    axes = component_of(hull_of(corners)).principal_axes
    assert sorted(axes.tolist()) == [[0, 0, 1], [0, 1, 0], [1, 0, 0]]


def _moments(corners: np.ndarray) -> np.ndarray:
    """Second moments [3, 3] of triangles [F, 3, 3] about their joint centroid, by quadrature at the edges' middles."""
    area = np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1)
    middles = (corners + np.roll(corners, 1, axis=1)) / 2  # exact for polynomials of degree two
    middles -= np.average(corners.mean(axis=1), weights=area, axis=0)
    return np.einsum("f,fki,fkj->ij", area, middles, middles)
