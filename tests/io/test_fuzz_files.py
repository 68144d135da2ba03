"""A few damaged files of every format, always the same; `python -m fuzz.soak --only file` tries any number of them."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
import trimesh
from trimesh import creation

from fuzz import mutations
from fuzz.seeds import written, written_by_extras
from rlacd.errors import RlacdError
from rlacd.io.read import apart
from rlacd.io.read.load import load_mesh
from rlacd.io.robots import rewrite_robot
from rlacd.pool import ProcessLimits
from tests.bounded import bounded

INPUTS = 60

APART = {"draco": "glb", "fbx": "fbx", "step": "step", "igs": "igs", "usda": "usda", "usdc": "usdc", "usdz": "usdz"}
"""What is read in a process of its own, and how its files end."""

MODULES = {"draco": "DracoPy", "fbx": "ufbx", "step": "cascadio", "igs": "cascadio"}


def shape() -> trimesh.Trimesh:
    return trimesh.util.concatenate([creation.box((2, 0.4, 0.4)), creation.cylinder(0.3, 1, sections=5)])


def damaged(kind: str, number: int, folder: Path) -> Path:
    write = written_by_extras if kind in APART else written
    seeds: list[Any] = [seed for of, seed in write(shape()) if of == APART.get(kind, kind)]
    rng = np.random.default_rng([7, number])
    seed = seeds[rng.integers(len(seeds))]
    path = folder / f"mesh.{APART.get(kind, kind)}"
    seed = mutations.damaged(APART.get(kind, kind), seed, seeds, rng)
    path.write_bytes(seed.content)
    for name, content in seed.beside.items():
        (folder / name).write_bytes(content)
    return path


def untyped(kind: str, folder: Path) -> dict[int, str]:
    """What was raised that is no error of ours, by the number of the file."""
    found = {}
    for number in range(INPUTS):
        path = damaged(kind, number, folder)
        try:
            if kind in ("urdf", "xml"):
                rewrite_robot(path, folder / f"out.{kind}", quality="fast", threads=1)
            else:
                load_mesh(path)
        except RlacdError:
            continue
        except Exception as error:
            found[number] = repr(error)
    return found


@pytest.mark.slow
@pytest.mark.parametrize("kind", ["obj", "stl", "ply", "off", "glb", "gltf", "dae", "3mf", "xyz", "msh", "urdf", "xml"])
@pytest.mark.promise("hostile-files")
def test_a_damaged_file_is_read_or_refused(kind: str, tmp_path: Path) -> None:
    assert bounded(untyped, kind, tmp_path, seconds=300) == {}


@pytest.mark.nightly
@pytest.mark.parametrize(("kind", "module"), [(kind, MODULES.get(kind, "pxr")) for kind in APART])
def test_a_damaged_file_that_is_read_apart_is_read_or_refused(
    kind: str, module: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    pytest.importorskip(module)
    monkeypatch.setattr(apart, "LIMITS", ProcessLimits(seconds=5.0))  # OpenCASCADE may never end
    assert untyped(kind, tmp_path) == {}
