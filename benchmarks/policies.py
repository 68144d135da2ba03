"""Parts and CPU seconds of several policies on the same meshes, as they are or turned at random.

    python benchmarks/policies.py MESHES --list MESHES/quick.txt --draw 40 [--turned] --out policies.jsonl
    python benchmarks/policies.py --table policies.jsonl

Ratios are to the first policy. Finished runs are not repeated, so a run can be stopped and resumed.
"""

from __future__ import annotations

import argparse
import csv
import json
import random
import time
import zlib
from collections import defaultdict
from pathlib import Path
from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation

import rlacd
from rlacd.io.read.load import load_mesh

POLICIES = ("greedy-excess-norm", "greedy", "greedy-hull-sum", "navacd")


def drawn(folder: Path, count: int) -> list[str]:
    """A fixed sample of files of train/ with fewer than 8,000 faces."""
    with (folder / "index.csv").open() as index:
        files = [row["file"] for row in csv.DictReader(index) if row["split"] == "train" and int(row["faces"]) < 8000]
    random.Random(7).shuffle(files)
    return files[:count]


def decompose_one(path: Path, policy: str, turned: bool) -> dict[str, Any]:
    mesh = load_mesh(path)
    vertices = np.asarray(mesh.vertices)
    if turned:
        vertices = Rotation.random(random_state=zlib.crc32(path.name.encode())).apply(vertices)
    start = time.process_time()
    report = rlacd.decompose((vertices, mesh.faces), policy=policy, quality="fast", threads=1, timeout=120).report
    return {"parts": report["parts"], "cpu": time.process_time() - start, "concavity": report["concavity"]["max"]}


def run(folder: Path, files: list[str], policies: list[str], turned: bool, out: Path) -> None:
    finished = (
        {(r["file"], r["policy"]) for r in map(json.loads, out.read_text(encoding="utf-8").splitlines())}
        if out.exists()
        else ()
    )
    with out.open("a", encoding="utf-8") as sink:
        for file in files:
            for policy in policies:
                if (file, policy) not in finished:
                    result = {"file": file, "policy": policy, **decompose_one(folder / file, policy, turned)}
                    print(json.dumps(result), file=sink, flush=True)


def table(out: Path) -> None:
    results: dict[str, dict[str, dict[str, Any]]] = defaultdict(dict)
    policies: dict[str, None] = {}
    for result in map(json.loads, out.read_text(encoding="utf-8").splitlines()):
        results[result["file"]][result["policy"]] = result
        policies[result["policy"]] = None
    whole = [r for r in results.values() if len(r) == len(policies)]
    first = next(iter(policies))
    print(f"{len(whole)} meshes\n\n| policy | parts | mean ratio | CPU seconds | median |\n|---|---|---|---|---|")
    for policy in policies:
        parts, base, cpu = (
            np.array([r[p][what] for r in whole]) for p, what in ((policy, "parts"), (first, "parts"), (policy, "cpu"))
        )
        logs = np.log(parts / base)
        ratio = f"{np.exp(logs.mean()):.3f} ± {logs.std() / np.sqrt(len(logs)):.3f}"
        print(f"| {policy} | {parts.sum()} | {ratio} | {cpu.sum():.1f} | {np.median(cpu):.2f} |")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("meshes", type=Path, nargs="?")
    parser.add_argument("--list", type=Path)
    parser.add_argument("--draw", type=int, default=0)
    parser.add_argument("--policies", nargs="+", default=list(POLICIES))
    parser.add_argument("--turned", action="store_true")
    parser.add_argument("--out", type=Path, default=Path("policies.jsonl"))
    parser.add_argument("--table", type=Path)
    options = parser.parse_args()
    if options.table is None:
        listed = options.list.read_text().split() if options.list else []
        files = listed + drawn(options.meshes, options.draw)
        run(options.meshes, files, options.policies, options.turned, options.out)
    table(options.table or options.out)


if __name__ == "__main__":
    main()
