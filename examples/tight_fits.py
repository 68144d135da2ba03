"""Count the hulls of one round hole at several tolerances, and with `keep_open`, and draw one of the results.

    python examples/tight_fits.py [PICTURE]

Prints the tables of the guide "Tight fits". The picture needs the extra ``view``.
"""

from __future__ import annotations

import math
import sys
from pathlib import Path
from tempfile import TemporaryDirectory

import trimesh
from manifold3d import Manifold
from PIL import Image

import rlacd

RADIUS = 10.0
"""Of the hole, mm."""


def block() -> trimesh.Trimesh:
    """A block of 60 x 60 x 30 mm with one round hole."""
    solid = Manifold.cube((60, 60, 30), True) - Manifold.cylinder(40, RADIUS, RADIUS, 128, True)
    mesh = solid.to_mesh()
    return trimesh.Trimesh(mesh.vert_properties[:, :3], mesh.tri_verts)


def chords(tolerance: float) -> int:
    """How many equal chords stay within the tolerance of the hole's circle."""
    return math.ceil(math.pi / math.acos(1 - tolerance / RADIUS))


def draw(result: rlacd.Decomposition, path: Path) -> None:
    """Draw the input and its hulls, without the caption, whose wall time differs from run to run."""
    with TemporaryDirectory() as folder:
        drawn = Image.open(result.save_picture(Path(folder) / "hulls.png", width=700, up="z"))
        drawn.crop((0, drawn.height // 6, *drawn.size)).save(path, quality=85)


def main(picture: Path) -> None:
    """Print a row a tolerance and a share, and draw the hulls at 1 mm."""
    for tolerance in (1.0, 0.3, 0.1):
        result = rlacd.decompose(block(), threshold_abs=tolerance, threads=1)
        print(f"{tolerance} mm: {chords(tolerance)} chords, {len(result)} hulls, at least {result.report.lower_bound}")
        if tolerance == 1.0:
            draw(result, picture)
    for share in (None, 0.8, 0.9, 0.97):
        result = rlacd.decompose(block(), threshold_abs=3.0, keep_open=share, threads=1)
        clear = RADIUS - result.report.hausdorff.added / result.report.scale
        print(f"3 mm, keep_open={share}: {len(result)} hulls, clear radius {clear:.1f} mm")


if __name__ == "__main__":
    main(Path(sys.argv[1] if len(sys.argv) > 1 else "tight_fits.webp"))
