"""rlacd needs nothing that only Linux has: its core runs where that is hidden, in all its processes."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from pathlib import Path

import pytest
import trimesh

ROOT = Path(__file__).resolve().parents[1]
CODE_PAGE = "cp1252"
"""What Windows in western countries uses for pipes; most of the characters below are not in it."""


def elsewhere(*arguments: object, encoding: str = CODE_PAGE) -> subprocess.CompletedProcess[str]:
    """Run Python with the functions, flags, signals and modules of `tests/elsewhere/sitecustomize.py` hidden."""
    variables = {
        "PYTHONPATH": os.pathsep.join([str(ROOT / "tests" / "elsewhere"), str(ROOT)]),
        "PYTHONWARNDEFAULTENCODING": "1",
        "PYTHONIOENCODING": encoding,
        "PYTHONUTF8": "0",
    }
    command = [sys.executable, *map(str, arguments)]
    return subprocess.run(
        command,
        capture_output=True,
        encoding="utf-8",
        errors="replace",  # messages on stderr keep to the code page
        timeout=600,
        env={**os.environ, **variables},
    )


@pytest.fixture
def ring(tmp_path: Path) -> Path:
    mesh = tmp_path / "meshes" / "指輪 – ring.stl"
    mesh.parent.mkdir()
    trimesh.creation.annulus(0.5, 1, 0.3).export(mesh)
    return mesh


def test_what_linux_has_is_hidden_from_rlacd_alone() -> None:
    program = """
import os, sys
print(hasattr(os, "killpg"), end=" ")
import fcntl
exec("import os; print(hasattr(os, 'killpg'), hasattr(os, 'replace')); import fcntl", {"__name__": "rlacd.x"})
"""
    run = elsewhere("-c", program)
    assert run.stdout.split() == ["True", "False", "True"]
    assert "ModuleNotFoundError" in run.stderr


@pytest.mark.slow
def test_every_module_is_imported() -> None:
    """But those of training, and those whose extras are not installed."""
    program = """
import importlib, pkgutil, rlacd
from rlacd.errors import MissingExtraError
for module in pkgutil.walk_packages(rlacd.__path__, "rlacd."):
    if not module.name.startswith("rlacd.learn") and not module.name.endswith("__main__"):
        try:
            importlib.import_module(module.name)
        except MissingExtraError:
            continue
        print(module.name)
"""
    run = elsewhere("-c", program)
    assert run.returncode == 0, run.stderr
    assert len(run.stdout.split()) > 100


@pytest.mark.slow
@pytest.mark.parametrize("ending", ["glb", "obj", "xml"])
def test_a_mesh_is_decomposed_and_written(ring: Path, ending: str) -> None:
    out = ring.with_name(f"結果.{ending}")
    run = elsewhere("-m", "rlacd", "decompose", ring, "-o", out, "--report", "-")
    assert run.returncode == 0, run.stderr
    assert json.loads(run.stdout)["hulls"] > 2
    assert out.exists()


@pytest.mark.slow
@pytest.mark.parametrize(
    ("words", "written", "said"),
    [
        ("decompose {ring} -o {out}/ --quiet", "*.obj", ""),
        ("batch {folder} -o {out} --jobs 2", "*ring*.glb", ""),
        ("info {ring}", "", "ring.stl"),
        ("info {ring} --json", "", '"faces"'),
    ],
)
def test_commands_work_twice_and_print_utf_8(ring: Path, words: str, written: str, said: str) -> None:
    out = ring.parents[1] / "out"
    for _ in range(2):
        command = [word.format(ring=ring, folder=ring.parent, out=out) for word in words.split()]
        run = elsewhere("-m", "rlacd", *command)
        assert run.returncode == 0, run.stderr
        assert said in run.stdout
    assert not written or list(out.rglob(written))


def test_a_worker_is_ended_with_its_children() -> None:
    program = """
import subprocess, sys
from rlacd.pool.process import kill_group, peak_memory, start
child = "import subprocess, sys, time; subprocess.Popen([sys.executable, '-c', 'import time; time.sleep(600)']);" \
        "print('up', flush=True); time.sleep(600)"
process = start([sys.executable, "-c", child], subprocess.DEVNULL, subprocess.PIPE, subprocess.DEVNULL, {})
assert process.stdout.readline().strip() == b"up"
import psutil
grandchildren = psutil.Process(process.pid).children()
assert len(grandchildren) == 1
kill_group(process)
process.wait()
assert not psutil.wait_procs(grandchildren, timeout=30)[1]
assert 2**23 < peak_memory() < 2**33
"""
    run = elsewhere("-c", program)
    assert run.returncode == 0, run.stderr


@pytest.mark.nightly
@pytest.mark.parametrize(
    ("file", "marks"),
    [
        ("io/test_load.py", "not slow and not nightly"),
        ("io/test_formats.py", "not slow and not nightly"),
        ("pool/test_pool.py", "not nightly"),
    ],
)
def test_the_tests_of_the_core_pass(file: str, marks: str) -> None:
    tests = ROOT / "tests" / file
    some = ["-m", marks, "-k", "not locked"]  # Windows cannot lock a folder
    run = elsewhere("-m", "pytest", "-x", "-q", "-n0", *some, "-p", "no:cacheprovider", tests, encoding="utf-8")
    assert run.returncode == 0, run.stdout[-3000:]
