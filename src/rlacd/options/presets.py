"""The engines: their limits on hulls, and the format each reads.

The numbers are the engines' own where they have any:

- PhysX: at most 255 vertices and polygons a convex mesh. On a GPU 64 of both, at most 32 corners a polygon and 32
  polygons a corner, which 62 triangles cannot exceed, and no thickness below 1/100 of the largest extent
  (`PxConvexMeshDesc` and `PxConvexMeshCookingResult` in its reference).
- Unity: 255 triangles a convex `MeshCollider`.
- Newton: 64 vertices (`maxhullvert`), its default for meshes it imports.

MuJoCo, Bullet, Unreal and Godot need none (Jolt, in Godot 4, keeps 256 corners); there, every corner costs time in
every contact, so 64 are a good limit, and 32 for Unreal, the most that its own tool for convex collision offers, and
for Godot, the default of its own (``max_num_vertices_per_convex_hull``). Triangles stand for polygons, of which there
are never more. The engines themselves hold us to this: ``tests/engines``.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal, NamedTuple

from rlacd.options.fields import one_of, read

PresetName = Literal["mujoco", "physx", "physx-gpu", "unity", "unreal", "newton", "bullet", "godot"]


class HullLimits(NamedTuple):
    """Limits on the vertices and triangles of a hull, at least 4 each; None means no limit.

    A triangulated hull of V corners has 2 V - 4 triangles.
    """

    max_vertices: int | None = None
    max_faces: int | None = None

    def allow(self, vertices: int, faces: int) -> bool:
        """Whether a hull may have so many vertices and triangles."""
        return vertices <= (self.max_vertices or vertices) and faces <= (self.max_faces or faces)


@dataclass(frozen=True)
class Preset:
    """One engine."""

    engine: str
    """The engine's name in sentences."""
    max_vertices: int | None
    max_faces: int | None
    """Limits on each hull; None is no limit."""
    ending: str
    """Ending of its files."""
    file_type: str | None = None
    """The format, where the ending does not tell it."""
    slivers: bool = True
    """Whether it takes hulls that are thinner than 1/100 of their largest extent."""


PRESETS: dict[str, Preset] = {
    "mujoco": Preset("MuJoCo", 64, None, ".xml"),
    "physx": Preset("PhysX", 255, 255, ".usd"),
    "physx-gpu": Preset("PhysX on a GPU", 64, 62, ".usd", slivers=False),
    "unity": Preset("Unity", 255, 255, ".obj"),
    "unreal": Preset("Unreal", 32, None, ".glb", "unreal"),
    "newton": Preset("Newton", 64, None, ".usd"),
    "bullet": Preset("Bullet", 64, None, ".urdf"),
    "godot": Preset("Godot", 32, None, ".glb", "godot"),
}
"""The engines by the word that ``preset=`` and ``--preset`` take."""


def find_preset(name: str) -> Preset:
    """Look a preset up.

    Raises
    ------
    OptionError
        There is none of that name.
    """
    known: str = read(one_of(tuple(PRESETS)), "preset", name)
    return PRESETS[known]
