"""One furnished room, twice: what a small ball can reach stays open, what a large one cannot reach is filled.

python examples/furnished_room.py [FOLDER]
"""

from __future__ import annotations

import sys
from pathlib import Path

import manifold3d
import trimesh

import rlacd


def box(lower: tuple[float, float, float], upper: tuple[float, float, float]) -> manifold3d.Manifold:
    """A box between two corners, in metres."""
    size = tuple(b - a for a, b in zip(lower, upper, strict=True))
    return manifold3d.Manifold.cube(size).translate(lower)


def table(x: float, y: float, wide: float, deep: float, high: float) -> list[manifold3d.Manifold]:
    """A top on four legs."""
    leg, top = 0.06, 0.05
    corners = [(x, y), (x + wide - leg, y), (x, y + deep - leg), (x + wide - leg, y + deep - leg)]
    legs = [box((cx, cy, 0), (cx + leg, cy + leg, high)) for cx, cy in corners]
    return [*legs, box((x, y, high - top), (x + wide, y + deep, high))]


def chair(x: float, y: float) -> list[manifold3d.Manifold]:
    """A stool with a back."""
    return [*table(x, y, 0.42, 0.42, 0.45), box((x, y + 0.38, 0.4), (x + 0.42, y + 0.42, 0.95))]


def shelf(x: float, y: float) -> list[manifold3d.Manifold]:
    """Two sides, a back and five boards."""
    boards = [box((x, y, z), (x + 1.0, y + 0.32, z + 0.03)) for z in (0.05, 0.42, 0.79, 1.16, 1.53)]
    sides = [box((x + dx, y, 0), (x + dx + 0.03, y + 0.32, 1.56)) for dx in (0.0, 0.97)]
    return [*boards, *sides, box((x, y + 0.3, 0), (x + 1.0, y + 0.32, 1.56))]


def room() -> trimesh.Trimesh:
    """A room of 4 m by 3 m, open in front and above, with a table, two chairs, a shelf and a bed."""
    parts = [
        box((0, 0, -0.1), (4, 3, 0)),
        box((0, 2.9, 0), (4, 3, 1.9)),
        box((0, 0, 0), (0.1, 3, 1.9)),
        *table(1.5, 0.9, 1.4, 0.8, 0.74),
        *chair(1.6, 0.35),
        *chair(2.3, 1.85),
        *shelf(0.6, 2.58),
        *table(3.1, 0.5, 0.85, 1.95, 0.45),
        box((3.1, 2.4, 0), (3.95, 2.45, 0.95)),
    ]
    mesh = manifold3d.Manifold.batch_boolean(parts, manifold3d.OpType.Add).to_mesh64()
    return trimesh.Trimesh(mesh.vert_properties[:, :3], mesh.tri_verts, process=False)


def main(folder: Path) -> None:
    """Decompose the room for a small and for a large ball and draw both."""
    folder.mkdir(parents=True, exist_ok=True)
    for share in (2, 10):
        space = rlacd.NavigableSpace(radius=f"{share}%", tolerance="1%")
        result = rlacd.decompose(room(), criterion=space, policy="navacd", quality="fast")
        name = f"room_radius_{share}_percent"
        result.save(folder / f"{name}.glb")
        result.save_balls(folder / f"{name}_balls.glb")
        result.save_picture(folder / f"{name}.png", width=1200)
        print(f"{name}: {result}")


if __name__ == "__main__":
    main(Path(sys.argv[1] if len(sys.argv) > 1 else "."))
