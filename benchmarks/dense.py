"""Dense, noisy meshes: rlacd beside CoACD and V-HACD, in CPU seconds of one thread, hulls and triangles a hull.

    python benchmarks/dense.py MESH ...

The same process measures all tools on a mesh, one after the other, at their defaults (threshold 0.05; 32 hulls).
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import coacd
import numpy as np
import trimesh
import vhacdx

import rlacd

TOOLS = ("fast", "balanced", "CoACD", "V-HACD")


def tools(path: str) -> dict[str, Callable[[], list[int]]]:
    """Functions that decompose a mesh, each returning the triangles of its hulls."""
    mesh: Any = trimesh.load(path, force="mesh", process=False)

    def by_coacd() -> list[int]:
        return [len(faces) for _, faces in coacd.run_coacd(coacd.Mesh(mesh.vertices, mesh.faces), threshold=0.05)]

    def by_vhacd() -> list[int]:
        quads = np.column_stack([np.full(len(mesh.faces), 3), mesh.faces]).astype(np.uint32)
        return [len(faces) for _, faces in vhacdx.compute_vhacd(mesh.vertices, quads.ravel(), maxConvexHulls=32)]

    def by_rlacd(quality: Any) -> Callable[[], list[int]]:
        return lambda: [len(hull.faces) for hull in rlacd.decompose(path, quality=quality, threads=1)]

    return {"fast": by_rlacd("fast"), "balanced": by_rlacd("balanced"), "CoACD": by_coacd, "V-HACD": by_vhacd}


def main(paths: list[str]) -> None:
    """Print a row for each mesh, then the median ratios."""
    coacd.set_log_level("error")
    rlacd.decompose(trimesh.creation.box(), threads=1)  # loads the libraries; manifold3d too gets one thread
    columns = " | ".join(f"{tool}: s, hulls, tri/hull" for tool in TOOLS)
    print(f"| mesh | {columns} |\n|---|{'---|' * len(TOOLS)}", flush=True)
    seconds: dict[str, list[float]] = {tool: [] for tool in TOOLS}
    for path in paths:
        cells = []
        for tool, run in tools(path).items():
            start = time.process_time()
            faces = run()
            seconds[tool].append(time.process_time() - start)
            cells.append(f"{seconds[tool][-1]:.2f}, {len(faces)}, {sum(faces) / len(faces):.0f}")
        print(f"| {Path(path).stem} | {' | '.join(cells)} |", flush=True)
    for ours in TOOLS[:2]:
        for other in TOOLS[2:]:
            ratios = np.array(seconds[other]) / np.array(seconds[ours])
            print(f"{ours}: {np.median(ratios):.1f} times as fast as {other} (median)")


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("meshes", nargs="+", metavar="MESH")
    main(parser.parse_args().meshes)
