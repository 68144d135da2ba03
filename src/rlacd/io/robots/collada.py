"""The unit and up axis of a COLLADA file: readers of robot descriptions scale by its unit."""

from __future__ import annotations

import re
from pathlib import Path

_HEAD = 1 << 16  # the <asset> comes first
_UNIT = re.compile(rb"""<unit\b[^>]*?\bmeter\s*=\s*["']\s*([0-9.eE+-]+)\s*["']""")
_UP = re.compile(rb"<up_axis>\s*([XYZ]_UP)\s*</up_axis>")


def collada_unit(path: Path) -> tuple[float, list[str]]:
    """Return the metres per unit of the file, 1 for other formats, and warnings.

    ROS, Gazebo and Bullet apply the unit. Whether a file whose y axis points up is turned differs between them.
    """
    if path.suffix.lower() != ".dae" or not path.is_file():
        return 1.0, []
    with path.open("rb") as file:
        head = file.read(_HEAD)
    unit, up = _UNIT.search(head), _UP.search(head)
    try:
        metres = float(unit[1]) if unit else 1.0
    except ValueError:
        metres = 1.0
    warnings = []
    if up and up[1] != b"Z_UP":
        said = up[1].decode()
        warnings.append(
            f"{path.name} says {said}, which some readers obey by turning it; its hulls lie as its numbers do."
        )
    return metres if 0 < metres < float("inf") else 1.0, warnings
