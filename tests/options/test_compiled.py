"""The package as a frozen program has it: compiled, without docstrings and without its source."""

from __future__ import annotations

import compileall
import dataclasses
import os
import shutil
import subprocess
import sys
from pathlib import Path

import rlacd
from rlacd import _native
from rlacd.learn.options import TrainOptions
from rlacd.options import Options


def test_help_explains_every_option_without_the_source(tmp_path: Path) -> None:
    packed = tmp_path / "rlacd"
    shutil.copytree(Path(rlacd.__file__).parent, packed, ignore=shutil.ignore_patterns("viewer", "__pycache__"))
    shutil.copy(_native.__file__, packed)  # which an editable install keeps elsewhere
    assert compileall.compile_dir(packed, quiet=1, legacy=True, optimize=2)
    for source in packed.rglob("*.py"):
        source.unlink()
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join([str(tmp_path), *sys.path])}

    def help_of(*words: str) -> str:
        command = [sys.executable, "-S", "-OO", "-m", "rlacd", *words]  # without the finder of an editable install
        done = subprocess.run(command, env=environment, capture_output=True, text=True, check=True)
        return "".join(done.stdout.split())

    for options, words in ((Options, ["decompose", "--help-all"]), (TrainOptions, ["train", "--help"])):
        shown = help_of(*words)
        for field in dataclasses.fields(options):
            known = field.metadata["option"]
            assert known.help
            assert "".join(known.help.split()) in shown, field.name
