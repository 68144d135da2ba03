"""The unit and up axis of a COLLADA file: readers of robot descriptions scale by its unit."""

from __future__ import annotations

from pathlib import Path

from rlacd.io.read.conventions import HEAD, collada


def collada_unit(path: Path) -> tuple[float, list[str]]:
    """Return the metres per unit of the file, 1 for other formats, and warnings.

    ROS, Gazebo and Bullet apply the unit. Whether a file whose y axis points up is turned differs between them.
    """
    if path.suffix.lower() != ".dae" or not path.is_file():
        return 1.0, []
    with path.open("rb") as file:
        up, metres = collada(file.read(HEAD))
    warnings = []
    if up != "z":
        warnings.append(
            f"{path.name} declares {up.upper()}_UP, and some programs rotate such a file when they read it; its hulls "
            "keep its coordinates."
        )
    return metres or 1.0, warnings
