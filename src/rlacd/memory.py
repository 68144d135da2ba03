"""How much memory is left to this process, and a refusal of meshes that need more before it is gone."""

from __future__ import annotations

from pathlib import Path

from rlacd.errors import MeshDataError

BYTES_READ = 450
"""Bytes that a triangle takes at the peak of reading, repair and report, if the mesh is closed."""

BYTES_REPAIRED = 1300
"""Bytes that a triangle takes at the peak of repair, if bodies overlap or are open."""

_UNQUESTIONED = 2**28  # what needs less is not worth the question
_CGROUPS = Path("/sys/fs/cgroup")


def require_memory(triangles: int, bytes_each: int, name: str) -> None:
    """Refuse a mesh that does not fit into the memory that is left.

    Parameters
    ----------
    triangles : int
        Number of triangles, as read or as declared by a file.
    bytes_each : int
        `BYTES_READ` or `BYTES_REPAIRED`.
    name : str
        Of the mesh, for the message.

    Raises
    ------
    MeshDataError
        It does not fit; the message says what it would need.
    """
    need = triangles * bytes_each
    if need < _UNQUESTIONED or need <= (left := memory_left()):
        return
    said = f"{name} has {triangles:,} triangles, which need about {need / 2**30:.1f} GB of memory"
    raise MeshDataError(f"{said}, but {left / 2**30:.1f} GB are left: simplify it first, or make room")


def memory_left() -> int:
    """Return the bytes that this process may still take, within the limits of its control groups."""
    import psutil

    left: int = psutil.virtual_memory().available
    for limit, used, reclaimable in _groups():
        left = min(left, max(limit - used + reclaimable, 0))
    return left


def _groups() -> list[tuple[int, int, int]]:
    """Limit, use, and reclaimable part of the use of every control group of this process that limits its memory."""
    try:
        lines = Path("/proc/self/cgroup").read_text().splitlines()
    except OSError:  # not Linux
        return []
    found = []
    for line in lines:
        _, controllers, path = line.split(":", 2)
        if controllers == "":
            root, names = _CGROUPS, ("memory.max", "memory.current", "inactive_file")
        elif "memory" in controllers.split(","):
            root = _CGROUPS / "memory"
            names = ("memory.limit_in_bytes", "memory.usage_in_bytes", "total_inactive_file")
        else:
            continue
        group = root / path.lstrip("/")
        for folder in (group, *group.parents):
            if folder.is_relative_to(root) and (numbers := _numbers(folder, *names)) is not None:
                found.append(numbers)
    return found


def _numbers(folder: Path, limit: str, used: str, reclaimable: str) -> tuple[int, int, int] | None:
    """The numbers of one control group; None if it sets no limit, or cannot be seen from here."""
    try:
        statistics = dict(line.split() for line in (folder / "memory.stat").read_text().splitlines())
        numbers = (folder / limit).read_text(), (folder / used).read_text(), statistics.get(reclaimable, "0")
        return int(numbers[0]), int(numbers[1]), int(numbers[2])
    except (OSError, ValueError):  # "max" is no limit
        return None
