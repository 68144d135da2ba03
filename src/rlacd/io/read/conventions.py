"""The unit of length and the up axis that a file states, or that its format defines."""

from __future__ import annotations

import re
from typing import Any

from rlacd.io.read.usd import METRES as STATED_METRES
from rlacd.io.read.usd import UP, USD
from rlacd.options.output import Axis

HEAD = 1 << 16
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


def stated(extension: str, content: bytes, scene: Any) -> tuple[Axis, float | None]:
    """Return the axis that points up, z if nothing is said, and the unit in metres, None if nothing is said.

    Parameters
    ----------
    extension : str
        Of the format, without the dot.
    content : bytes
        The file.
    scene : trimesh.Scene
        What was read of it.
    """
    if extension in ("glb", "gltf"):
        return "y", 1.0
    if extension == "dae":
        return collada(content[:HEAD])
    if extension == "3mf":  # always z up, in millimetres unless it says otherwise
        said = {str(getattr(one, "metadata", {}).get("units", "")) for one in scene.geometry.values()}
        return "z", next((METRES[unit] for unit in sorted(said) if unit in METRES), METRES["millimeter"])
    if extension in USD:
        return scene.metadata[UP], scene.metadata[STATED_METRES]
    return "z", None


def collada(head: bytes) -> tuple[Axis, float | None]:
    """The same for the beginning of a COLLADA file."""
    up, unit = _COLLADA_UP.search(head), _COLLADA_UNIT.search(head)
    axes: dict[bytes, Axis] = {b"X": "x", b"Y": "y", b"Z": "z"}
    try:
        metres = float(unit[1]) if unit else None
    except ValueError:
        metres = None
    return axes[up[1]] if up else "z", metres if metres is not None and 0 < metres < float("inf") else None
