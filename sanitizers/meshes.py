"""Decompose a cross-section of a folder of real meshes in every way, on several threads, for the sanitizers to watch.

    python sanitizers/run.py thread meshes [--count 48] [--faces 3000]

Every mesh is decomposed in one of the ways below, in turn, so that each way meets every kind of mesh; every way is used
on $RLACD_MESHES (or ../shared/meshes) equally often.
"""

from __future__ import annotations

import argparse
import csv
import itertools
import os
import time
from collections import Counter
from pathlib import Path
from typing import Any

import rlacd
from rlacd.policies import POLICIES

THREADS = 4
SPACE = rlacd.NavigableSpace

WAYS: dict[str, dict[str, Any]] = {
    **{f"fast, {policy}": {"quality": "fast", "policy": policy} for policy in POLICIES},
    "balanced": {},
    "best": {"quality": "best", "search_steps": 40},
    "fine": {"threshold": 0.02, "quality": "fast"},
    "coarse, 8 corners": {"threshold": 0.2, "max_vertices": 8},
    "at most 3 hulls": {"max_hulls": 3, "threshold": 0.1},
    "for a GPU": {"preset": "physx-gpu"},
    "not merged": {"merge": False},
    "navigable": {"criterion": SPACE(0.05, 0.02), "quality": "fast"},
    "navigable, sealed rooms": {"criterion": SPACE(0.04, 0.02, reachable_only=False)},
    "navigable, ground": {"criterion": SPACE(0.1, 0.05, closed_planes=(((0, 0, 1), 0),)), "quality": "fast"},
}


def cross_section(folder: Path, count: int, most_faces: int) -> list[Path]:
    """Meshes of every set, closed and open ones, evenly over their sizes."""
    with (folder / "index.csv").open() as file:
        rows = [row for row in csv.DictReader(file) if int(row["faces"]) <= most_faces]
    rows.sort(key=lambda row: (row["set"], row["watertight"], int(row["faces"])))
    count = min(count, len(rows))
    return [folder / rows[(2 * i + 1) * len(rows) // (2 * count)]["file"] for i in range(count)]


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    beside = Path(__file__).resolve().parents[2] / "shared" / "meshes"
    parser.add_argument("folder", type=Path, nargs="?", default=os.environ.get("RLACD_MESHES", beside))
    parser.add_argument("--count", type=int, default=48)
    parser.add_argument("--faces", type=int, default=3000, help="leave out meshes with more")
    args = parser.parse_args()
    ways = itertools.cycle(WAYS.items())
    done = Counter[str]()
    for path in cross_section(Path(args.folder), args.count, args.faces):
        name, options = next(ways)
        start = time.perf_counter()
        try:
            outcome = f"{len(rlacd.decompose(path, threads=THREADS, **options))} hulls"
        except rlacd.RlacdError as error:
            outcome = str(error)
        done[name] += 1
        print(f"{path.name:40.40} {name:24} {time.perf_counter() - start:6.1f} s  {outcome}", flush=True)
    print(f"{done.total()} decompositions: {dict(done)}")


if __name__ == "__main__":
    main()
