"""Time per stage, its growth with the number of faces, and peak memory.

    python benchmarks/scaling.py stages MESH [MESH ...]     seconds of each stage
    python benchmarks/scaling.py faces [--most 1000000]     one shape (a torus), from 1k faces up
    python benchmarks/scaling.py surface MESH [MESH ...]    what does not cut: nanoseconds of CPU time per triangle

Every run is a fresh process; seconds are wall time of a second run in it for `stages` (the first loads libraries) and
of the only run for `faces`; memory is the process' peak resident size. `surface` reads and repairs a mesh, makes the
hull of the solid, cuts it into octants (not counted) and measures their hulls as a report does, in one thread; its last
line fits how each stage grows with the number of triangles above 50,000 (1 is linear), for files of one shape.
"""

from __future__ import annotations

import argparse
import json
import resource
import subprocess
import sys
import time
from typing import Any

import numpy as np

MANY = 50_000
"""Triangles above which the growth is fitted."""

SURFACE_STAGES = ("load", "repair", "hull", "distances", "mass")
STAGES = ("load", "repair", "cut", "merge", "finish", "measure", "total")


def run(mesh: Any, runs: int) -> dict[str, Any]:
    import rlacd

    for _ in range(runs):
        result = rlacd.decompose(mesh, quality="fast")
    report = result.report
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024
    return {"faces": len(result.source.faces), "parts": report["parts"], "seconds": report["seconds"], "peak_mb": peak}


def run_surface(path: str) -> dict[str, Any]:
    from rlacd.io.read.load import load_mesh
    from rlacd.repair.repair import repair
    from rlacd.solid.component import Component, Plane
    from rlacd.solid.distance import hull_distances
    from rlacd.solid.mass import mass_of

    clock = [time.process_time()]
    mesh = load_mesh(path)
    clock.append(time.process_time())
    solid = repair(mesh, threads=1)
    clock.append(time.process_time())
    parts = [Component(solid.shape)]
    clock.append(time.process_time())
    for normal in ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0)):
        parts = [side for part in parts for side in part.cut(Plane(normal, 0.0)) if side is not None]
    hulls = [part.hull for part in parts]
    cutting = time.process_time() - clock[-1]
    hull_distances(hulls, *solid.surface, threads=1)
    clock.append(time.process_time() - cutting)
    mass_of(*solid.mesh, solid.frame)
    clock.append(time.process_time() - cutting)
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024
    steps = ", ".join(sorted({body.step for body in solid.bodies}))
    seconds = dict(zip(SURFACE_STAGES, np.diff(clock).tolist(), strict=True))
    return {"faces": len(mesh.faces), "bodies": len(solid.bodies), "steps": steps, "seconds": seconds, "peak_mb": peak}


def print_surface_row(name: str, row: dict[str, Any]) -> None:
    cost = [1e9 * row["seconds"][stage] / row["faces"] for stage in SURFACE_STAGES]
    cells = " | ".join(f"{x:.0f}" for x in [*cost, sum(cost)])
    print(f"| {name} | {row['faces']} | {row['bodies']} {row['steps']} | {cells} | {row['peak_mb']:.0f} |", flush=True)


def print_growth(rows: list[dict[str, Any]]) -> None:
    """The exponents of the stages and of their sum, fitted over the rows with many triangles."""
    many = [row for row in rows if row["faces"] >= MANY]
    if len({row["faces"] for row in many}) < 2:
        return
    faces = np.log([row["faces"] for row in many])
    seconds = np.array([[row["seconds"][stage] for stage in SURFACE_STAGES] for row in many])
    exponents = np.polyfit(faces, np.log(np.column_stack([seconds, seconds.sum(axis=1)])), 1)[0]
    print(f"| exponent | | | {' | '.join(f'{x:.2f}' for x in exponents)} | |")


def torus(faces: int) -> Any:
    import trimesh

    around = round((faces / 2) ** 0.5)
    return trimesh.creation.torus(1, 0.4, major_sections=around, minor_sections=around)


def in_fresh_process(*arguments: str) -> dict[str, Any]:
    output = subprocess.run([sys.executable, __file__, *arguments], check=True, capture_output=True, text=True)
    row: dict[str, Any] = json.loads(output.stdout.splitlines()[-1])
    return row


def print_row(name: str, row: dict[str, Any]) -> None:
    seconds = " | ".join(f"{row['seconds'].get(stage, 0.0):.3f}" for stage in STAGES)
    print(f"| {name} | {row['faces']} | {row['parts']} | {seconds} | {row['peak_mb']:.0f} |", flush=True)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("what", choices=["stages", "faces", "surface", "one", "one-surface"])
    parser.add_argument("meshes", nargs="*")
    parser.add_argument("--most", type=int, default=1_000_000)
    args = parser.parse_args()
    if args.what == "one":
        (mesh,) = args.meshes
        print(json.dumps(run(torus(int(mesh)), 1) if mesh.isdigit() else run(mesh, 2)))
        return
    if args.what == "one-surface":
        print(json.dumps(run_surface(args.meshes[0])))
        return
    if args.what == "surface":
        print(f"| mesh | triangles | repair | {' | '.join(SURFACE_STAGES)} | all | peak MB |")
        print("|" + "---|" * (len(SURFACE_STAGES) + 5))
        rows = []
        for mesh in args.meshes:
            rows.append(in_fresh_process("one-surface", mesh))
            print_surface_row(mesh.rpartition("/")[2], rows[-1])
        print_growth(rows)
        return
    print(f"| mesh | faces | parts | {' | '.join(STAGES)} | peak MB |")
    print("|" + "---|" * (len(STAGES) + 4))
    if args.what == "stages":
        for mesh in args.meshes:
            print_row(mesh.rpartition("/")[2], in_fresh_process("one", mesh))
    else:
        faces = 1000
        while faces <= args.most:
            print_row("torus", in_fresh_process("one", str(faces)))
            faces = round(faces * 10**0.5)


if __name__ == "__main__":
    main()
