"""Does noise change what repair makes of a mesh? Compares solids of meshes with those of dense, noisy copies.

    python -m benchmarks.noise MESHES --list LIST [--faces 10000] [--noise 0.001] [--out noise.jsonl]
    python -m benchmarks.noise --table noise.jsonl

MESHES is a folder of meshes with `dense.py`, which makes the copies; LIST names some of them. Volumes are in the unit
of the files. A copy is not as solid as its mesh, or more so, if their volumes differ by more than a few per cent.
"""

from __future__ import annotations

import argparse
import importlib.util
import json
import math
import time
from pathlib import Path
from typing import Any

import trimesh

from rlacd.io.read.load import load_mesh
from rlacd.repair.repair import repair
from rlacd.repair.union import volume_of

SHARES = (0.02, 0.05, 0.1, 0.2)


def solid_volume(mesh: Any) -> float:
    """Volume of the solid that repair makes, in the mesh's unit."""
    solid = repair(load_mesh(trimesh.Trimesh(mesh.vertices, mesh.faces, process=False)), threads=1)
    return volume_of(solid.shape) / solid.frame.scale**3


def densifier(folder: Path) -> Any:
    """The function of `dense.py` that makes a copy."""
    spec = importlib.util.spec_from_file_location("dense", folder / "dense.py")
    if spec is None or spec.loader is None or not (folder / "dense.py").is_file():
        raise SystemExit(f"{folder} has no dense.py.")
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module.densify


def table(rows: list[dict[str, Any]]) -> str:
    """Count the copies whose volume differs, and name those that differ most."""
    change = [abs(math.log(row["copy"] / row["mesh"])) for row in rows]
    lines = [
        f"{sum(c > math.log1p(share) for c in change)} of {len(rows)} by more than {share:.0%}" for share in SHARES
    ]
    worst = sorted(zip(change, rows, strict=True), key=lambda pair: -pair[0])[:20]
    return "\n".join(lines + [f"{row['copy'] / row['mesh']:.3f} {row['name']}" for _, row in worst])


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("meshes", type=Path, nargs="?")
    parser.add_argument("--list", type=Path)
    parser.add_argument("--faces", type=int, default=10_000, help="About so many triangles in a copy.")
    parser.add_argument("--noise", type=float, default=0.001, help="Standard deviation, where the longest side is 2.")
    parser.add_argument("--out", type=Path, default=Path("noise.jsonl"))
    parser.add_argument("--table", type=Path)
    args = parser.parse_args()
    if args.table is None:
        if args.meshes is None or args.list is None:
            parser.error("MESHES and --list are needed to measure.")
        densify = densifier(args.meshes)
        with args.out.open("w") as out:
            for name in args.list.read_text().split():
                mesh = trimesh.load(args.meshes / name, force="mesh", process=False)
                start = time.process_time()
                row = {"name": name, "mesh": solid_volume(mesh)}
                row |= {"copy": solid_volume(densify(mesh, args.faces, args.noise))}
                row |= {"seconds": time.process_time() - start}
                out.write(json.dumps(row) + "\n")
                out.flush()
    rows = [json.loads(line) for line in (args.table or args.out).read_text().splitlines()]
    print(table(rows))


if __name__ == "__main__":
    main()
