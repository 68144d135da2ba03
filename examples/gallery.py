"""Draw the objects of the documentation's gallery, and print its table.

    python examples/gallery.py MESHES docs/gallery_objects

MESHES holds V-HACD's and CoACD's examples, as `test/vhacd` and `test/coacd_examples`. Needs the extra ``view``.
"""

from __future__ import annotations

import sys
from pathlib import Path
from tempfile import TemporaryDirectory

from PIL import Image

import rlacd

OBJECTS = {
    "vhacd/al.ply": "y",
    "vhacd/beshon.ply": "y",
    "vhacd/bunny.ply": "y",
    "vhacd/cow-nonormals.ply": "y",
    "vhacd/hornbug.ply": "y",
    "vhacd/lamp.ply": "y",
    "vhacd/teapot.ply": "y",
    "vhacd/horse_walk.ply": "y",
    "vhacd/teddy.ply": "y",
    "coacd_examples/Bottle.ply": "y",
    "coacd_examples/Kettle.ply": "y",
    "coacd_examples/SnowFlake.ply": "z",
}
"""Meshes, and the axis that points up in each."""

WIDTH = 1200
"""Pixels of a picture."""

TITLE = 0.17
"""Share of a picture above what it shows: its caption, which the table repeats."""


def main(meshes: Path, out: Path) -> None:
    """Draw every object beside its hulls."""
    out.mkdir(parents=True, exist_ok=True)
    print("| object | triangles | hulls | their triangles | hulls reach |\n|---|---:|---:|---:|---:|")
    for name, up in OBJECTS.items():
        result = rlacd.decompose(meshes / "test" / name)
        stem = Path(name).stem.partition("-")[0].lower()
        with TemporaryDirectory() as folder:
            drawn = Path(folder) / "drawn.png"
            result.save_picture(drawn, up=up)
            with Image.open(drawn) as picture:
                shown = picture.convert("RGB").crop((0, int(TITLE * picture.height), picture.width, picture.height))
                shown.resize((WIDTH, shown.height * WIDTH // shown.width)).save(out / f"{stem}.webp", quality=80)
        report = result.report
        cells = [f"{len(result.source.faces):,}", str(report.hulls), f"{report.triangles:,}"]
        print(f"| {stem} | {' | '.join(cells)} | {report.hausdorff.added:.3f} |", flush=True)


if __name__ == "__main__":
    main(Path(sys.argv[1]), Path(sys.argv[2]))
