"""Time per stage, its growth with the number of faces, and peak memory.

    python benchmarks/scaling.py stages MESH [MESH ...]     seconds of each stage
    python benchmarks/scaling.py faces [--most 1000000]     one shape (a torus), from 1k faces up

Every run is a fresh process; seconds are wall time of a second run in it for `stages` (the first loads libraries) and
of the only run for `faces`; memory is the process' peak resident size.
"""

from __future__ import annotations

import argparse
import json
import resource
import subprocess
import sys
from typing import Any

STAGES = ("load", "repair", "cut", "merge", "finish", "measure", "total")


def run(mesh: Any, runs: int) -> dict[str, Any]:
    import rlacd

    for _ in range(runs):
        result = rlacd.decompose(mesh, quality="fast")
    report = result.report
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024
    return {"faces": len(result.source.faces), "parts": report["parts"], "seconds": report["seconds"], "peak_mb": peak}


def torus(faces: int) -> Any:
    import trimesh

    around = round((faces / 2) ** 0.5)
    return trimesh.creation.torus(1, 0.4, major_sections=around, minor_sections=around)


def in_fresh_process(*arguments: str) -> dict[str, Any]:
    output = subprocess.run([sys.executable, __file__, "one", *arguments], check=True, capture_output=True, text=True)
    row: dict[str, Any] = json.loads(output.stdout.splitlines()[-1])
    return row


def print_row(name: str, row: dict[str, Any]) -> None:
    seconds = " | ".join(f"{row['seconds'].get(stage, 0.0):.3f}" for stage in STAGES)
    print(f"| {name} | {row['faces']} | {row['parts']} | {seconds} | {row['peak_mb']:.0f} |", flush=True)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("what", choices=["stages", "faces", "one"])
    parser.add_argument("meshes", nargs="*")
    parser.add_argument("--most", type=int, default=1_000_000)
    args = parser.parse_args()
    if args.what == "one":
        (mesh,) = args.meshes
        print(json.dumps(run(torus(int(mesh)), 1) if mesh.isdigit() else run(mesh, 2)))
        return
    print(f"| mesh | faces | parts | {' | '.join(STAGES)} | peak MB |")
    print("|" + "---|" * (len(STAGES) + 4))
    if args.what == "stages":
        for mesh in args.meshes:
            print_row(mesh.rpartition("/")[2], in_fresh_process(mesh))
    else:
        faces = 1000
        while faces <= args.most:
            print_row("torus", in_fresh_process(str(faces)))
            faces = round(faces * 10**0.5)


if __name__ == "__main__":
    main()
