"""Repair every mesh under a folder and report the steps and times.

python benchmarks/repair_corpus.py FOLDER [--every N] [--out results.jsonl]

Prints the steps taken, the seconds, the largest deviations and every failure; writes one JSON line per file.
"""

from __future__ import annotations

import argparse
import collections
import json
import time
from pathlib import Path
from typing import Any

from rlacd.errors import MeshError
from rlacd.io.read.load import load_mesh
from rlacd.repair.repair import repair

FORMATS = {".ply", ".stl", ".obj", ".off", ".glb", ".gltf", ".dae", ".3mf"}


def measure(path: Path) -> dict[str, Any]:
    """Load and repair one file."""
    row: dict[str, Any] = {"file": str(path)}
    started = time.perf_counter()
    try:
        mesh = load_mesh(path)
        row["load_seconds"] = time.perf_counter() - started
        started = time.perf_counter()
        solid = repair(mesh)
        row["seconds"] = time.perf_counter() - started
        row |= {
            "faces_in": len(mesh.faces),
            "faces_out": solid.manifold.num_tri(),
            "volume": solid.manifold.volume(),
            "status": solid.manifold.status().name,
            "steps": dict(collections.Counter(body.step for body in solid.bodies)),
            "deviation": max(body.deviation for body in solid.bodies),
            "warnings": list(solid.warnings),
        }
    except MeshError as error:
        row["error"] = f"{type(error).__name__}: {error}"
    except Exception as error:
        row["crash"] = f"{type(error).__name__}: {error}"
    return row


def table(rows: list[dict[str, Any]]) -> str:
    """Summarise the rows: steps by file and by body, times, the worst cases."""
    good = [row for row in rows if "seconds" in row]
    lines = [f"{len(rows)} files, {len(good)} repaired"]
    lines += [f"  {row['file']}: {row.get('error') or row['crash']}" for row in rows if row not in good]
    files: collections.Counter[str] = collections.Counter()
    bodies: collections.Counter[str] = collections.Counter()
    for row in good:
        files.update(row["steps"].keys())
        bodies.update(row["steps"])
    lines += [f"  {step:12} in {files[step]:5} files, {bodies[step]:6} bodies" for step in sorted(bodies)]
    seconds = sorted(row["seconds"] for row in good)
    if seconds:
        lines.append(
            f"seconds: median {seconds[len(seconds) // 2]:.3f}, worst {seconds[-1]:.2f}, sum {sum(seconds):.1f}"
        )
    for key in ("seconds", "deviation", "faces_out"):
        lines.append(f"most {key}:")
        worst = sorted(good, key=lambda row: -row[key])[:10]
        lines += [f"  {row[key]:10.4f}  {row['file']}  {row['steps']}" for row in worst]
    return "\n".join(lines)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folder", type=Path)
    parser.add_argument("--every", type=int, default=1, help="take only every Nth file")
    parser.add_argument("--out", type=Path, help="where the JSON lines go")
    options = parser.parse_args()
    paths = sorted(p for p in options.folder.rglob("*") if p.suffix.lower() in FORMATS)[:: options.every]
    rows = []
    sink = options.out.open("w") if options.out else None
    for path in paths:
        rows.append(measure(path))
        if sink:
            sink.write(json.dumps(rows[-1]) + "\n")
            sink.flush()
    if sink:
        sink.close()
    print(table(rows))


if __name__ == "__main__":
    main()
