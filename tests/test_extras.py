"""What only options ask for stays out of a run that does not ask for it."""

from __future__ import annotations

import subprocess
import sys

import pytest

RUN = """
import sys, trimesh, rlacd
corner = trimesh.util.concatenate([trimesh.creation.box((2, 1, 1)), trimesh.creation.box((1, 1, 2))])
done = rlacd.decompose(corner, threads=1, **{options})
assert len(done.hulls) > 1
print(*(name for name in sys.modules if name.startswith("rlacd.extras.")))
"""


def extras_of(options: dict[str, object]) -> list[str]:
    """The modules of extras that a fresh process has imported after a run with these options."""
    run = [sys.executable, "-c", RUN.format(options=options)]
    return subprocess.run(run, capture_output=True, text=True, check=True).stdout.split()


@pytest.mark.parametrize("options", [{"quality": "fast"}, {}], ids=str)
def test_a_default_run_imports_no_extras(options: dict[str, object]) -> None:
    assert extras_of(options) == []


def test_an_option_imports_its_own_extra() -> None:
    assert extras_of({"criterion": "volume", "quality": "fast"}) == [
        "rlacd.extras.criteria",
        "rlacd.extras.criteria.volume",
    ]
