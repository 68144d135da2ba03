"""Same input, options and seed: the same bytes, in every process, on any number of threads, alone or in a batch."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
from collections.abc import Sequence
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


def rlacd(*commands: Sequence[object], hash_seed: int) -> None:
    """Run commands, each in a new process, in which sets and dicts have an order of their own."""
    environment = {**os.environ, "PYTHONHASHSEED": str(hash_seed)}
    for command in commands:
        words = [sys.executable, "-m", "rlacd", *(str(word) for word in command)]
        done = subprocess.run(words, env=environment, capture_output=True, text=True, timeout=1800)
        assert done.returncode == 0, done.stderr


def copied(corpus: Path, names: Sequence[str], folder: Path) -> Path:
    """Put meshes side by side."""
    folder.mkdir()
    for name in names:
        shutil.copy(corpus / name, folder)
    return folder


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
    assets, alone = copied(corpus, SMALL, tmp_path / "assets"), tmp_path / "alone"
    order = JobSpec.of({"quality": "fast", "threads": 1}, file_format=file_format)
    with InProcessPool() as pool:
        Batch(assets, str(tmp_path / "out"), order).run(pool, watch_nothing())  # type: ignore[arg-type]
    alone.mkdir()
    for mesh in assets.iterdir():
        decompose(mesh, quality="fast", threads=3).save(alone / f"{mesh.stem}.{ending}", up="z")
    assert tree(alone) == tree(tmp_path / "out", TIMES, "manifest.jsonl", ".rlacd/lock")


@pytest.mark.slow
@pytest.mark.parametrize("name", MESHES)
@pytest.mark.promise("same-bytes")
def test_the_same_bytes_in_every_process_and_for_any_number_of_threads(name: str, corpus: Path, tmp_path: Path) -> None:
    digits = set()
    for seed, threads in enumerate((1, 5)):
        out = tmp_path / f"{seed}.ply"
        rlacd(["decompose", corpus / name, "-o", out, "-q", "--threads", threads], hash_seed=seed)
        digits.add(out.read_bytes())
    assert len(digits) == 1


def compare(meshes: Path, tmp_path: Path, file_format: str, ending: str, *words: str) -> None:
    """Two batches and two times every mesh by itself, each in new processes and on another number of threads."""
    batches, alone = (tmp_path / "b1", tmp_path / "b2"), (tmp_path / "a1", tmp_path / "a2")
    for number, (out, jobs, threads) in enumerate(zip(batches, (2, 1), (1, 3), strict=True)):
        how = ["--format", file_format, "--jobs", jobs, "--threads", threads, "-q"]
        rlacd(["batch", meshes, "-o", out, *how, *words], hash_seed=10 + number)
    for number, (out, threads) in enumerate(zip(alone, (1, 2), strict=True)):
        out.mkdir()
        each = [["decompose", mesh, "-o", out / f"{mesh.stem}.{ending}"] for mesh in sorted(meshes.iterdir())]
        rlacd(*([*one, "--threads", threads, "-q", *words] for one in each), hash_seed=20 + number)
    expected = tree(alone[0])
    assert len(expected) >= len(list(meshes.iterdir()))
    assert tree(alone[1]) == expected
    assert tree(batches[0], TIMES) == tree(batches[1], TIMES), "the manifest, too"
    assert tree(batches[0], TIMES, "manifest.jsonl", ".rlacd/lock") == expected


@pytest.mark.nightly
def test_the_same_files_for_a_cross_section_of_real_meshes(corpus: Path, tmp_path: Path) -> None:
    names = (corpus / "quick.txt").read_text().split()
    assert len(names) == 25
    compare(copied(corpus, names, tmp_path / "assets"), tmp_path, "glb", "glb", "--quality", "fast")
