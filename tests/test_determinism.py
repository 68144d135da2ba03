"""Same input, options and seed: the same bytes, in every process, on any number of threads, alone or in a batch."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from rlacd import decompose
from rlacd.batch import Batch, JobSpec
from rlacd.pool.local import InProcessPool
from tests.batch.test_batch import TIMES
from tests.batch.trouble import tree

MESHES = [
    "test/vhacd/lamp.ply",
    "test/vhacd/ob_chess_table.ply",
    "test/coacd_examples/Bottle.ply",
    "test/capod/class1__m2.ply",
    "test/ikea_assembled/chair_ivar_0668.ply",
    "test/aws_small_house/Trash_01__aws_Trash_01_visual.ply",
]
SMALL = ["test/vhacd/ob_chair_gothic.ply", "test/gazebo_models/door_handle__handle.ply", MESHES[-1]]
FORMATS = [("glb", "glb"), ("mjcf", "xml"), ("usd", "usd")]
"""As a batch is told, and the ending of the file."""


def watch_nothing() -> object:
    class Nothing:
        def begin(self, *_: object) -> None: ...

        passed_over = started = finished = begin

    return Nothing()


@pytest.mark.slow
@pytest.mark.parametrize(("file_format", "ending"), FORMATS)
@pytest.mark.promise("batch-bytes")
def test_a_batch_of_real_meshes_writes_what_decompose_writes(
    file_format: str, ending: str, corpus: Path, tmp_path: Path
) -> None:
    if file_format == "usd":
        pytest.importorskip("pxr", reason="the extra usd is not installed")
    assets, alone = tmp_path / "assets", tmp_path / "alone"
    assets.mkdir()
    alone.mkdir()
    for name in SMALL:
        shutil.copy(corpus / name, assets)
    order = JobSpec.of({"quality": "fast", "threads": 1}, file_format=file_format)
    with InProcessPool() as pool:
        Batch(assets, str(tmp_path / "out"), order).run(pool, watch_nothing())  # type: ignore[arg-type]
    for mesh in assets.iterdir():
        decompose(mesh, quality="fast", threads=3).save(alone / f"{mesh.stem}.{ending}", up="z")
    assert tree(alone) == tree(tmp_path / "out", TIMES, "manifest.jsonl", ".rlacd/lock")


@pytest.mark.slow
@pytest.mark.parametrize("name", MESHES)
@pytest.mark.promise("same-bytes")
def test_the_same_bytes_in_every_process_and_for_any_number_of_threads(name: str, corpus: Path, tmp_path: Path) -> None:
    """Each in a new process, in which sets and dicts have an order of their own."""
    for seed, threads in enumerate("15"):
        words = ["rlacd", "decompose", str(corpus / name), "-o", f"{tmp_path}/{seed}.ply", "-q", "--threads", threads]
        environment = {**os.environ, "PYTHONHASHSEED": str(seed)}
        subprocess.run([sys.executable, "-m", *words], env=environment, check=True, timeout=1800)
    assert (tmp_path / "0.ply").read_bytes() == (tmp_path / "1.ply").read_bytes()
