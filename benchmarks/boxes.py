"""Six articulated things of plates, each a few millimetres from the next: drawer, cabinet, oven, microwave, gripper,
fork; lengths in metres."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TypeAlias

import numpy as np
import trimesh

Joint: TypeAlias = tuple[str, str, str, str, str, float, float]
"""Its type, the links that it connects, where it is, its axis, and its limits."""

PLAY = 0.003

JOINT = (
    '<joint name="{2}_joint" type="{0}"><parent link="{1}"/><child link="{2}"/><origin xyz="{3}"/><axis xyz="{4}"/>'
    '<limit lower="{5}" upper="{6}" effort="9" velocity="9"/></joint>'
)
LINK = '<link name="{0}"><collision><geometry><mesh filename="{0}.obj"/></geometry></collision></link>'


def write_boxes(folder: Path) -> list[Path]:
    """Write all as URDF; returns their files."""
    return [_write(folder / name, name, *make()) for name, make in ROBOTS.items()]


def _write(folder: Path, name: str, links: Mapping[str, trimesh.Trimesh], joints: Sequence[Joint]) -> Path:
    folder.mkdir(parents=True, exist_ok=True)
    for link, mesh in links.items():
        mesh.export(folder / f"{link}.obj")
    path = folder / f"{name}.urdf"
    inner = [*map(LINK.format, links), *(JOINT.format(*joint) for joint in joints)]
    path.write_text("\n".join([f'<robot name="{name}">', *inner, "</robot>\n"]))
    return path


def _box(x: float, to_x: float, y: float, to_y: float, z: float, to_z: float) -> trimesh.Trimesh:
    return trimesh.creation.box(bounds=[(x, y, z), (to_x, to_y, to_z)])


def _cat(*parts: trimesh.Trimesh) -> trimesh.Trimesh:
    return trimesh.util.concatenate(parts)


def _shell(w: float, d: float, h: float, t: float) -> trimesh.Trimesh:
    """A case of walls of thickness t, open in front."""
    sides = _box(0, t, 0, d, t, h - t), _box(w - t, w, 0, d, t, h - t), _box(t, w - t, 0, t, t, h - t)
    return _cat(_box(0, w, 0, d, 0, t), _box(0, w, 0, d, h - t, h), *sides)


def _drawer() -> tuple[dict[str, trimesh.Trimesh], list[Joint]]:
    w, d, h, t = 0.5 - 0.036 - 2 * PLAY, 0.42, 0.12, 0.012
    walls = (
        _box(0, t, 0, d, t, h),
        _box(w - t, w, 0, d, t, h),
        _box(t, w - t, 0, t, t, h),
        _box(t, w - t, d - t, d, t, h),
    )
    knob = _box(w / 2 - 0.03, w / 2 + 0.03, d, d + 0.03, h / 2, h / 2 + 0.02)
    at = f"{0.018 + PLAY} {0.02} {0.018 + PLAY}"
    links = {"case": _shell(0.5, 0.45, 0.2, 0.018), "box": _cat(_box(0, w, 0, d, 0, t), *walls, knob)}
    return links, [("prismatic", "case", "box", at, "0 1 0", 0, 0.35)]


def _cabinet() -> tuple[dict[str, trimesh.Trimesh], list[Joint]]:
    case = _cat(_shell(0.8, 0.5, 1.2, 0.018), _box(0.391, 0.409, 0.018, 0.5, 0.018, 1.182))
    left = _cat(_box(0, 0.39, 0, 0.018, 0, 1.16), _box(0.34, 0.36, 0.018, 0.05, 0.5, 0.6))
    right = _cat(_box(-0.39, 0, 0, 0.018, 0, 1.16), _box(-0.36, -0.34, 0.018, 0.05, 0.5, 0.6))
    hinges: list[Joint] = [
        ("revolute", "case", "left", ".004 .504 .02", "0 0 1", 0, 1.5),
        ("revolute", "case", "right", ".796 .504 .02", "0 0 1", -1.5, 0),
    ]
    return {"case": case, "left": left, "right": right}, hinges


def _oven() -> tuple[dict[str, trimesh.Trimesh], list[Joint]]:
    handle = [_box(x, x + 0.02, 0.03, 0.05, 0.43, 0.45) for x in (-0.2, 0.18)]
    door = _cat(_box(-0.28, 0.28, 0, 0.03, 0, 0.5), _box(-0.2, 0.2, 0.05, 0.07, 0.43, 0.45), *handle)
    rods = [_box(x, x + 0.006, 0, 0.45, 0, 0.006) for x in np.linspace(0, 0.494, 12)]
    rack = _cat(*rods, _box(0, 0.5, 0, 0.006, -0.006, 0), _box(0, 0.5, 0.444, 0.45, -0.006, 0))
    joints: list[Joint] = [
        ("revolute", "case", "door", ".3 .553 .05", "-1 0 0", 0, 1.55),
        ("prismatic", "case", "rack", ".05 .06 .25", "0 1 0", 0, 0.2),
    ]
    return {"case": _shell(0.6, 0.55, 0.6, 0.04), "door": door, "rack": rack}, joints


def _microwave() -> tuple[dict[str, trimesh.Trimesh], list[Joint]]:
    case = _cat(_shell(0.5, 0.35, 0.3, 0.015), _box(0.38, 0.485, 0.015, 0.345, 0.015, 0.285))
    door = _cat(_box(0, 0.36, 0, 0.02, 0, 0.29), _box(0.33, 0.345, 0.02, 0.05, 0.05, 0.24))
    joints: list[Joint] = [
        ("revolute", "case", "door", ".005 .353 .005", "0 0 1", 0, 1.6),
        ("revolute", "case", "plate", ".2 .18 .03", "0 0 1", -3.1, 3.1),
    ]
    return {"case": case, "door": door, "plate": trimesh.creation.annulus(0.02, 0.14, 0.01, sections=48)}, joints


def _gripper() -> tuple[dict[str, trimesh.Trimesh], list[Joint]]:
    rails = _box(-0.08, 0.08, -0.03, -0.022, 0, 0.015), _box(-0.08, 0.08, 0.022, 0.03, 0, 0.015)
    tip = _box(0, 0.004, -0.012, 0.012, 0.06, 0.09), _box(0.004, 0.02, -0.006, 0.006, 0.02, 0.03)
    left = _cat(_box(0, 0.012, -0.01, 0.01, 0, 0.06), *tip)
    right = left.copy().apply_transform(trimesh.transformations.rotation_matrix(np.pi, (0, 0, 1)))
    palm, plate = _cat(_box(-0.08, 0.08, -0.03, 0.03, -0.03, 0), *rails), _box(-0.0025, 0.0025, -0.04, 0.04, 0, 0.05)
    joints: list[Joint] = [
        ("prismatic", "palm", "left", ".003 0 .001", "1 0 0", 0, 0.04),
        ("prismatic", "palm", "right", "-.003 0 .001", "-1 0 0", 0, 0.04),
        ("fixed", "palm", "plate", "0 0 .07", "1 0 0", 0, 0),
    ]
    return {"palm": palm, "left": left, "right": right, "plate": plate}, joints


def _fork() -> tuple[dict[str, trimesh.Trimesh], list[Joint]]:
    cheeks = _box(-0.15, 0, -0.03, 0.03, -0.03, -0.018), _box(-0.15, 0, -0.03, 0.03, 0.018, 0.03)
    fork, lug = (
        _cat(*cheeks, _box(-0.17, -0.15, -0.03, 0.03, -0.03, 0.03)),
        _box(-0.02, 0.15, -0.025, 0.025, -0.015, 0.015),
    )
    return {"fork": fork, "lug": _cat(lug)}, [("revolute", "fork", "lug", "-.02 0 0", "0 0 1", -1.2, 1.2)]


ROBOTS = {
    "drawer": _drawer,
    "cabinet": _cabinet,
    "oven": _oven,
    "microwave": _microwave,
    "gripper": _gripper,
    "fork": _fork,
}
