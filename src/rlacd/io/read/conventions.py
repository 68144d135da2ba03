"""The unit of length and the up axis that a file states, or that its format defines."""

from __future__ import annotations

import re
from pathlib import Path

from rlacd.options.output import Axis

COLLADA_HEAD = 1 << 16
"""Bytes of a COLLADA file in which they are looked for: ``<asset>`` comes first."""

_COLLADA_UNIT = re.compile(rb"""<(?:[\w.-]+:)?unit\b[^>]*?\bmeter\s*=\s*["']\s*([0-9.eE+-]+)\s*["']""")
_COLLADA_UP = re.compile(rb"<(?:[\w.-]+:)?up_axis>\s*([XYZ])_UP\s*</")

METRES = {
    "micron": 1e-6,
    "millimeter": 1e-3,
    "centimeter": 1e-2,
    "meter": 1.0,
    "inch": 0.0254,
    "foot": 0.3048,
}
"""The units of 3MF."""

UNITS = {"mm": 1e-3, "cm": 1e-2, "m": 1.0, "in": 0.0254}
"""The names that options take for units."""


def collada(head: bytes) -> tuple[Axis, float | None]:
    """The axis that points up, z if nothing is said, and the unit in metres, for the beginning of a COLLADA file."""
    up, unit = _COLLADA_UP.search(head), _COLLADA_UNIT.search(head)
    axes: dict[bytes, Axis] = {b"X": "x", b"Y": "y", b"Z": "z"}
    try:
        metres = float(unit[1]) if unit else None
    except ValueError:
        metres = None
    return axes[up[1]] if up else "z", metres if metres is not None and 0 < metres < float("inf") else None


def collada_unit(path: Path) -> tuple[float, list[str]]:
    """Return the metres per unit of the file, 1 for other formats, and warnings.

    ROS, Gazebo and Bullet apply the unit. Whether a file whose y axis points up is turned differs between them.
    """
    if path.suffix.lower() != ".dae" or not path.is_file():
        return 1.0, []
    with path.open("rb") as file:
        up, metres = collada(file.read(COLLADA_HEAD))
    warnings = []
    if up != "z":
        warnings.append(
            f"{path.name} declares {up.upper()}_UP, and some programs rotate such a file when they read it; its hulls "
            "keep its coordinates."
        )
    return metres or 1.0, warnings
