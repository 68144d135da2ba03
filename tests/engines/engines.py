"""The engines, the bodies that they are given, and what each answers: a program of its own asks it.

Engines are installed by ``make build/engines``: packages of Python in an environment, packages of Node beside it.
"""

from __future__ import annotations

import json
import os
import shutil
import subprocess
import sys
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import trimesh

import rlacd
from rlacd.decomposition import Decomposition
from tests.models import table

HERE = Path(__file__).resolve().parent
FOLDER = Path(os.environ.get("RLACD_ENGINES", HERE.parents[1] / "build" / "engines"))
PATIENCE = 1800  # seconds, most of them to compile kernels

REAL = {
    "chair": "ikea_assembled/chair_bernhard_0146.ply",
    "coffee table": "aws_small_house/CoffeeTable_01__aws_CoffeeTable_01_visual.ply",
    "valve": "gazebo_models/drc_practice_wheel_valve__valve_wheel.ply",
    "teapot": "vhacd/teapot.ply",
    "hornbug": "vhacd/hornbug.ply",
}
"""Meshes of the corpus; the first two also fall."""

DROP = 0.02
"""How far bodies fall, metres."""

FALL = 2.0  # seconds

TABLE_HEIGHT = 0.8  # metres

BALLS = (32, 33, 34, 62, 64, 65, 128, 129, 130, 200, 255, 256, 257, 512, 1000)
"""Corners of the balls that show how many an engine keeps."""

SLABS = (10.0, 5.0, 2.0, 1.0, 0.5, 0.2, 0.1)
"""Millimetres of the slabs, 1 m wide, that show how thin a hull may be."""


@dataclass(frozen=True)
class Engine:
    """An engine and how it is asked.

    Attributes
    ----------
    program
        What asks it, with its arguments.
    package
        What has to be installed for it: a module of Python, or a package of Node.
    preset
        The preset whose hulls it gets.
    ending
        Of the file it reads; empty if it gets the points of hulls.
    is_rough
        Whether it changes hulls a little, whatever its settings.
    is_slow
        Whether it compiles for minutes before bodies of several hulls can touch: it drops the table alone, and stacks
        blocks of one hull in place of tables.
    """

    program: tuple[str, ...]
    package: str
    preset: str | None
    ending: str = ""
    is_rough: bool = False
    is_slow: bool = False

    @property
    def command(self) -> list[str]:
        """The command that runs its program; skips the test where the engine is not installed."""
        name, *arguments = self.program
        if name.endswith(".mjs"):
            if shutil.which("node") is None or not (FOLDER / "node_modules" / self.package).is_dir():
                pytest.skip(f"Node or {self.package} is not installed (make build/engines)")
            return ["node", str(HERE / name), *arguments]
        return [python_with(self.package), str(HERE / name), *arguments]


def python_with(*packages: str) -> str:
    """The Python that has packages: the project's own, or that of the engines; skips the test where neither has."""
    if all(find_spec(package) for package in packages):
        return sys.executable
    python = str(FOLDER / "bin" / "python")
    finds = f"import importlib.util as u, sys; sys.exit(not all(map(u.find_spec, {packages!r})))"
    if not Path(python).is_file() or subprocess.run([python, "-c", finds], check=False).returncode:
        pytest.skip(f"{packages[0]} is not installed (make build/engines)")
    return python


ENGINES = {
    "PhysX": Engine(("in_physx.mjs",), "physx-js-webidl", "physx"),
    "PhysX on a GPU": Engine(("in_physx.mjs", "gpu"), "physx-js-webidl", "physx-gpu"),
    "SAPIEN": Engine(("in_sapien.py",), "sapien", "physx", "urdf", is_rough=True),
    "Jolt": Engine(("in_jolt.mjs",), "jolt-physics", "godot"),
    "Havok": Engine(("in_havok.mjs",), "@babylonjs/havok", "physx-gpu", is_rough=True),
    "Rapier": Engine(("in_rapier.mjs",), "@dimforge/rapier3d-compat", None),
    "MuJoCo": Engine(("in_mujoco.py",), "mujoco", "mujoco", "xml"),
    "MJX": Engine(("in_mujoco.py", "mjx"), "jax", "mujoco", "xml", is_rough=True, is_slow=True),
    "MuJoCo Warp": Engine(("in_mujoco.py", "warp"), "mujoco_warp", "mujoco", "xml"),
    "Newton": Engine(("in_newton.py",), "newton", "newton", "usd"),
    "Genesis": Engine(("in_genesis.py",), "genesis", None, "urdf"),
    "Bullet": Engine(("in_bullet.py",), "pybullet", "bullet", "urdf"),
    "Drake": Engine(("in_drake.py",), "pydrake", None, "sdf"),
    "Pinocchio and Coal": Engine(("in_coal.py",), "coal", None, "urdf"),
}


@dataclass(frozen=True)
class Body:
    """What an engine was given, and what it answered: what it says of each hull, and of bodies after each fall."""

    given: Decomposition
    hulls: list[dict[str, Any]]
    falls: list[list[dict[str, Any]]]


def ask(
    engine: Engine, bodies: Mapping[str, tuple[Decomposition, list[Any]]], folder: Path
) -> tuple[str, dict[str, Body]]:
    """Ask an engine about bodies, each with its falls; returns the engine's name and version, and the answers."""
    command, task = engine.command, []
    for name, (result, falls) in bodies.items():
        file = str(result.save(folder / name / f"{name}.{engine.ending}")) if engine.ending else ""
        hulls = [{"points": hull.vertices.tolist(), "faces": hull.faces.tolist()} for hull in result]
        task.append({"file": file, "hulls": hulls, "falls": falls})
    asked, answered = folder / "task.json", folder / "answer.json"
    asked.write_text(json.dumps(task))
    place = {**os.environ, "ENGINES": str(FOLDER), "OMP_NUM_THREADS": "1"}
    words = [*command[:2], str(asked), str(answered), *command[2:]]
    done = subprocess.run(words, env=place, capture_output=True, text=True, timeout=PATIENCE, check=False)
    assert done.returncode == 0, done.stderr[-3000:]
    said = json.loads(answered.read_text())
    given = [result for result, _ in bodies.values()]
    return said["engine"], {
        name: Body(result, **answer) for name, result, answer in zip(bodies, given, said["bodies"], strict=True)
    }


def lowest(body: Body, end: Mapping[str, Any]) -> float:
    """The height of the lowest point of a body after a fall."""
    *place, x, y, z, w = end["pose"]
    points = np.concatenate([hull.vertices for hull in body.given])
    turn = trimesh.transformations.quaternion_matrix([w, x, y, z])
    return float(trimesh.transform_points(points, turn)[:, 2].min() + place[2])


def speed(ends: Sequence[Mapping[str, Any]]) -> float:
    """The fastest movement of bodies after a fall, in metres or radians a second."""
    return max(abs(part) for end in ends for part in end["velocity"])


def to_fall(engine: Engine, meshes: Path | None) -> dict[str, tuple[Decomposition, list[Any]]]:
    """A table, a stack of three, and the real meshes, if there are any."""
    drop = {"starts": [[0, 0, DROP]], "seconds": FALL}
    stack = {"starts": [[0, 0, 0.001 + i * (TABLE_HEIGHT + 0.001)] for i in range(3)], "seconds": FALL}
    stacked = decomposed("block" if engine.is_slow else "table", engine.preset, meshes)
    bodies = {"table": (decomposed("table", engine.preset, meshes), [drop]), "stack": (stacked, [stack])}
    for index, name in enumerate(REAL if meshes else ()):
        falls = [drop] if index < 2 and not engine.is_slow else []
        bodies[name] = decomposed(name, engine.preset, meshes), falls
    return bodies


@cache
def decomposed(name: str, preset: str | None, meshes: Path | None) -> Decomposition:
    """A body, with its longest side 1 m (of the table, 1.6 m), its lowest point at the height 0."""
    if name == "table":
        mesh = table().apply_scale(TABLE_HEIGHT / 0.2)
    elif name == "block":
        mesh = trimesh.creation.box(bounds=[[-0.5, -0.5, 0.0], [0.5, 0.5, TABLE_HEIGHT]])
    else:
        assert meshes is not None
        mesh = trimesh.load_mesh(meshes / "test" / REAL[name], process=False)
        mesh.apply_scale(1 / mesh.extents.max())
        mesh.apply_translation(-np.array([*mesh.bounds.mean(axis=0)[:2], mesh.bounds[0, 2]]))
    return rlacd.decompose(mesh, preset=preset, quality="fast", threads=1)


def probes() -> Decomposition:
    """Balls of more and more corners, and slabs that are thinner and thinner, as the hulls of one body."""
    hulls = [*map(ball, BALLS), *map(slab, SLABS)]
    return Decomposition.of(hulls, trimesh.util.concatenate(hulls), name="probes")


def ball(corners: int) -> trimesh.Trimesh:
    """Points along a spiral on a sphere 1 m wide."""
    turn = np.pi * (1 + 5**0.5) * (np.arange(corners) + 0.5)
    height = 1 - 2 * (np.arange(corners) + 0.5) / corners
    around = np.sqrt(1 - height**2)
    return trimesh.convex.convex_hull(0.5 * np.stack([np.cos(turn) * around, np.sin(turn) * around, height], axis=1))


def slab(thickness: float) -> trimesh.Trimesh:
    return trimesh.creation.box((1.0, 1.0, thickness / 1000))
