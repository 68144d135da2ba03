"""Same input, options and seed: the same bytes, in every process and on any number of threads."""

from __future__ import annotations

import hashlib
import subprocess
import sys
from pathlib import Path

import pytest

MESHES = [
    "test/vhacd/lamp.ply",
    "test/vhacd/ob_chess_table.ply",
    "test/coacd_examples/Bottle.ply",
    "test/capod/class1__m2.ply",
    "test/ikea_assembled/chair_ivar_0668.ply",
    "test/aws_small_house/Trash_01__aws_Trash_01_visual.ply",
]


def written(mesh: Path, output: Path, *words: str) -> str:
    """Decompose in a process of its own; the digest of the file, which holds every digit of every hull."""
    command = [sys.executable, "-c", "from rlacd.cli import main; main()", "decompose", str(mesh), "-o", str(output)]
    done = subprocess.run([*command, "-q", *words], capture_output=True, text=True, timeout=300)
    assert done.returncode == 0, done.stderr
    return hashlib.sha256(output.read_bytes()).hexdigest()


@pytest.mark.slow
@pytest.mark.parametrize("name", MESHES)
def test_the_same_bytes_in_every_process_and_for_any_number_of_threads(name: str, corpus: Path, tmp_path: Path) -> None:
    mesh = corpus / name
    once = written(mesh, tmp_path / "a.ply", "--threads", "1")
    assert written(mesh, tmp_path / "b.ply", "--threads", "1") == once
    assert written(mesh, tmp_path / "c.ply", "--threads", "2") == once
    assert written(mesh, tmp_path / "d.ply", "--threads", "5") == once


@pytest.mark.slow
@pytest.mark.parametrize("name", MESHES[2:4])
def test_limits_do_not_change_that(name: str, corpus: Path, tmp_path: Path) -> None:
    words = ("--max-hulls", "6", "--max-vertices", "24", "--threshold", "0.1")
    once = written(corpus / name, tmp_path / "a.ply", "--threads", "1", *words)
    assert written(corpus / name, tmp_path / "b.ply", "--threads", "3", *words) == once
