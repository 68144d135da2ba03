"""Real meshes in every simulator: decompose, write, load, drop, and count failures.

    python benchmarks/simulators.py LIST_OF_FILES FOLDER_OF_MESHES [--every N]

Prints a line per failing mesh and simulator (not loaded, wrong number of hulls or mass, not finite after the fall), and
totals. Run from the root of a checkout with the extras sim, usd and drake.
"""

from __future__ import annotations

import argparse
import sys
import tempfile
from collections import Counter
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parent.parent))

import numpy as np
from tests.models import fall_in_bullet, fall_in_drake, fall_in_mujoco

import rlacd
from rlacd.io.read.load import load_mesh

SECONDS = 0.3


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("list", type=Path)
    parser.add_argument("folder", type=Path)
    parser.add_argument("--every", type=int, default=1)
    parser.add_argument("--preset", default="mujoco")
    options = parser.parse_args()
    names = options.list.read_text().split()[:: options.every]
    count: Counter[str] = Counter()
    for name in names:
        mesh = load_mesh(options.folder / name)
        used = mesh.vertices[np.unique(mesh.faces)]
        low, size = used.min(axis=0), float(np.ptp(used, axis=0).max())
        # All meshes in one size, on the ground: simulators are tuned for objects of about a metre.
        standing = ((mesh.vertices - low) / size, mesh.faces)
        result = rlacd.decompose(standing, policy="navacd", quality="fast", preset=options.preset, threads=1)
        mass = result.report["mass"]["volume_abs"] * 1000.0
        for kind, ending, fall in (
            ("MuJoCo", "xml", fall_in_mujoco),
            ("Bullet", "urdf", fall_in_bullet),
            ("Drake", "sdf", fall_in_drake),
        ):
            with tempfile.TemporaryDirectory() as folder:
                try:
                    rest = fall(result.save(Path(folder) / f"body.{ending}"), SECONDS)
                except Exception as error:
                    count[f"{kind} failed"] += 1
                    print(f"{name} {kind}: {type(error).__name__}: {str(error)[:150]}", flush=True)
                    continue
            right = rest.hulls == len(result) and abs(rest.mass - mass) < 1e-4 * mass and np.isfinite(rest.speed)
            count[f"{kind} as it should be" if right else f"{kind} wrong"] += 1
            if not right:
                print(f"{name} {kind}: {rest}, should be {len(result)} hulls and {mass}", flush=True)
    print(len(names), "meshes:", dict(sorted(count.items())))


if __name__ == "__main__":
    main()
