"""A few damaged files of every format, always the same; `make fuzz-files` tries any number of them."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
import trimesh
from trimesh import creation

from fuzz import mutations
from fuzz.damaged import written, written_by_extras
from rlacd.errors import RlacdError
from rlacd.io.read.load import load_mesh
from rlacd.io.robots import rewrite_robot
from tests.bounded import bounded

INPUTS = 60

APART = {"draco": "glb", "usda": "usda", "usdc": "usdc", "usdz": "usdz"}
"""What is read in a process of its own, and how its files end."""

URDF = (
    '<?xml version="1.0"?>\n<robot name="r">\n<link name="a">\n<collision name="c">\n<origin xyz="0 0 1"/>\n'
    '<geometry><mesh filename="box.stl" scale="1 2 -1"/></geometry>\n</collision>\n</link>\n<link name="b"/>\n'
    '<joint name="j" type="fixed">\n<parent link="a"/>\n<child link="b"/>\n</joint>\n</robot>\n'
)
MJCF = (
    '<mujoco model="m">\n<compiler meshdir="."/>\n<default>\n<default class="c">\n<geom type="mesh" group="3"/>\n'
    '</default>\n</default>\n<asset>\n<mesh name="b" file="box.stl" scale="1 1 2"/>\n</asset>\n<worldbody>\n'
    '<body name="x" childclass="c">\n<geom name="g" mesh="b" mass="2"/>\n<geom type="box" size="1 1 1"/>\n</body>\n'
    "</worldbody>\n</mujoco>\n"
)


def shape() -> trimesh.Trimesh:
    return trimesh.util.concatenate([creation.box((2, 0.4, 0.4)), creation.cylinder(0.3, 1, sections=5)])


def damaged(kind: str, number: int, folder: Path) -> Path:
    """The file of a number."""
    write = written_by_extras if kind in APART else written
    seeds: list[Any] = [seed for of, seed in write(shape()) if of == APART.get(kind, kind)]
    seeds += [mutations.Seed({"urdf": URDF, "xml": MJCF}[kind].encode())] if kind in ("urdf", "xml") else []
    rng = np.random.default_rng([7, number])
    seed = seeds[rng.integers(len(seeds))]
    path = folder / f"mesh.{APART.get(kind, kind)}"
    path.write_bytes(mutations.mutated(APART.get(kind, kind), seed, seeds, rng))
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
@pytest.mark.parametrize("kind", ["obj", "stl", "ply", "off", "glb", "gltf", "dae", "3mf", "xyz", "urdf", "xml"])
@pytest.mark.promise("hostile-files")
def test_a_damaged_file_is_read_or_refused(kind: str, tmp_path: Path) -> None:
    creation.box().export(tmp_path / "box.stl")
    assert bounded(untyped, kind, tmp_path, seconds=300) == {}


@pytest.mark.nightly
@pytest.mark.parametrize(("kind", "module"), [(kind, "DracoPy" if kind == "draco" else "pxr") for kind in APART])
def test_a_damaged_file_that_is_read_apart_is_read_or_refused(kind: str, module: str, tmp_path: Path) -> None:
    pytest.importorskip(module)
    assert untyped(kind, tmp_path) == {}


def test_a_number_always_makes_the_same_file(tmp_path: Path) -> None:
    for kind in ("obj", "3mf", "gltf"):
        first, second = (damaged(kind, 3, tmp_path).read_bytes() for _ in range(2))
        assert first == second
