"""A Godot 3 without a display, where there is one, and projects for it."""

from __future__ import annotations

import shutil
import subprocess
import threading
import time
from pathlib import Path

import pytest

PATIENCE = 120  # seconds


def godot() -> str:
    """Path of the headless Godot 3; skips where there is none."""
    found = shutil.which("godot3-server")
    if found is None:
        pytest.skip("godot3-server is not installed (apt-get install godot3-server)")
    return found


def project(folder: Path) -> None:
    """Make a folder a project."""
    (folder / "project.godot").write_text('config_version=4\n\n[application]\n\nconfig/name="test"\n')


def edit(folder: Path, until: str) -> None:
    """Open the project in the editor until a file appears that matches; the editor does not always leave by itself."""
    quiet = subprocess.DEVNULL
    with subprocess.Popen([godot(), "--editor", "--path", str(folder)], stdout=quiet, stderr=quiet) as editor:
        end = time.monotonic() + PATIENCE
        while time.monotonic() < end and editor.poll() is None and not list(folder.glob(until)):
            time.sleep(0.2)
        editor.kill()
    assert list(folder.glob(until)), f"the editor did not make {until}"


def play(folder: Path, script: str) -> str:
    """Run a script that is a SceneTree, and return the lines that it prints up to ``end``."""
    command = [godot(), "--path", str(folder), "-s", script]
    said: list[str] = []
    with subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True) as run:
        assert run.stdout is not None
        late = threading.Timer(PATIENCE, run.kill)
        late.start()
        for line in run.stdout:
            if line.strip() == "end":
                break
            said.append(line)
        late.cancel()
        run.kill()  # it does not always leave by itself either
    return "".join(said)
