"""Same input, options and seed: the same bytes, in every process, on any number of threads, on any processor."""

from __future__ import annotations

import os
import platform
import shutil
import subprocess
import sys
from itertools import pairwise
from pathlib import Path
from unittest import mock

import numpy as np
import pytest

from rlacd import _native, decompose
from rlacd.batch import Batch, JobSpec
from rlacd.policies.network import Network
from rlacd.pool.local import InProcessPool
from tests import bits
from tests.batch.test_batch import TIMES
from tests.batch.trouble import tree
from tests.hulls import hull_of
from tests.shapes import component_of

MESHES = [
    "test/vhacd/lamp.ply",
    "test/vhacd/ob_chess_table.ply",
    "test/coacd_examples/Bottle.ply",
    "test/capod/class1__m2.ply",
    "test/ikea_assembled/chair_ivar_0668.ply",
    "test/aws_small_house/Trash_01__aws_Trash_01_visual.ply",
]
LONG = [name for name in MESHES if name.endswith(("Bottle.ply", "visual.ply"))]
SMALL = ["test/vhacd/ob_chair_gothic.ply", "test/gazebo_models/door_handle__handle.ply", MESHES[-1]]
FORMATS = [("glb", "glb"), ("mjcf", "xml"), ("usd", "usd")]
"""As a batch is told, and the ending of the file."""


@pytest.mark.slow
@pytest.mark.parametrize(("file_type", "ending"), FORMATS)
@pytest.mark.promise("batch-bytes")
def test_a_batch_of_real_meshes_writes_what_decompose_writes(
    file_type: str, ending: str, corpus: Path, tmp_path: Path
) -> None:
    if file_type == "usd":
        pytest.importorskip("pxr", reason="the extra usd is not installed")
    assets, alone = tmp_path / "assets", tmp_path / "alone"
    assets.mkdir()
    alone.mkdir()
    for name in SMALL:
        shutil.copy(corpus / name, assets)
    order = JobSpec.of({"quality": "fast", "threads": 1}, file_type=file_type)
    with InProcessPool() as pool:
        Batch(assets, tmp_path / "out", order).run(pool, mock.Mock())
    for mesh in assets.iterdir():
        decompose(mesh, quality="fast", threads=3).save(alone / f"{mesh.stem}.{ending}", up="z")
    assert tree(alone) == tree(tmp_path / "out", TIMES, "manifest.jsonl", ".rlacd/lock")


@pytest.mark.slow
@pytest.mark.parametrize("name", [pytest.param(n, marks=pytest.mark.nightly) if n in LONG else n for n in MESHES])
@pytest.mark.promise("same-bytes")
def test_the_same_bytes_in_every_process_and_for_any_number_of_threads(name: str, corpus: Path, tmp_path: Path) -> None:
    """Each in a new process, in which sets and dicts have an order of their own."""
    for seed, threads in enumerate("15"):
        words = ["rlacd", "decompose", str(corpus / name), "-o", f"{tmp_path}/{seed}.ply", "-q", "--threads", threads]
        environment = {**os.environ, "PYTHONHASHSEED": str(seed)}
        subprocess.run([sys.executable, "-m", *words], env=environment, check=True, timeout=1800)
    assert (tmp_path / "0.ply").read_bytes() == (tmp_path / "1.ply").read_bytes()


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


def test_elementary_functions_are_those_of_numpy() -> None:
    """Up to rounding: they are our own so that they are the same bits everywhere."""
    draw = np.random.default_rng(0)
    turn, long = draw.uniform(-np.pi, np.pi, 10_000), 10 ** draw.uniform(-200, 200, 10_000)
    sines, cosines = long * np.sin(turn), long * np.cos(turn)
    assert np.abs(_native.angles(sines, cosines) - np.arctan2(sines, cosines)).max() < 1e-14
    quarters = _native.angles(np.array([0.0, 1, 0, -1, 0]), np.array([1.0, 0, -1, 0, 0]))
    assert quarters == pytest.approx([0, np.pi / 2, np.pi, -np.pi / 2, 0], rel=1e-15)
    assert _native.logarithms(long) == pytest.approx(np.log(long), rel=1e-15)
    assert _native.cube_roots(long) == pytest.approx(np.cbrt(long), rel=1e-15)
    few = 10 ** draw.uniform(-12, 3, 10_000)
    assert _native.powers(few, 1.3) == pytest.approx(few**1.3, rel=1e-13)
    assert _native.powers(np.array([0.0, 1.0]), 1.3).tolist() == [0, 1]


def test_networks_are_evaluated_as_numpy_would() -> None:
    draw = np.random.default_rng(0)
    widths = (38, 64, 32, 2)
    layers = [(draw.normal(size=(o, i)), draw.normal(size=o)) for i, o in pairwise(widths)]
    features = draw.normal(size=(5, 40, 38)).astype(np.float32)
    expected = features.astype(np.float64)
    for weight, bias in layers[:-1]:
        expected = np.maximum(expected @ weight.T + bias, 0)
    expected = expected @ layers[-1][0].T + layers[-1][1]
    assert Network(layers, {"threshold": 0.05})(features) == pytest.approx(expected, rel=1e-3, abs=1e-3)


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
