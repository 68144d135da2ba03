"""Decompose random shapes with random options, and check the results with independent judges.

    python -m fuzz.shapes --seconds 600              `make fuzz-shapes MINUTES=10`
    python -m fuzz.shapes --count 300 --first 5000
    python -m fuzz.shapes --again 4711               one seed in this process, with full details
    python -m fuzz.shapes --totals fuzz.jsonl        sums over a log

A seed determines the shape (`fuzz.recipes`), the options (`fuzz.choices`) and the format. It is decomposed in its own
process with limits on time and memory; every fourth is decomposed again with another number of threads and must give
the same bytes. The log has one JSON line per seed.
"""

from __future__ import annotations

import argparse
import json
import sys
import tempfile
import time
from collections import Counter
from dataclasses import asdict, dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np

import rlacd
from fuzz.choices import draw_options
from fuzz.files import read_hulls, write_mesh
from fuzz.judges import Case, finite_faces, judge
from fuzz.recipes import Shape, make_shape
from fuzz.worker import InProcess, Watched
from rlacd.batch import JobSpec
from rlacd.pool import ProcessLimits, WorkerDiedError

AGAIN = 4
"""One in this many seeds is decomposed twice."""

FORMATS = ("obj", "obj", "obj", "ply", "ply", "glb", "stl", "urdf")


@dataclass
class Row:
    """Outcome of a seed.

    Attributes
    ----------
    seed
    status
        ``done``, ``refused`` (rightly), ``crash``, ``hang`` (or too much memory), ``bug`` (an error that is not one of
        the package's own), ``wrong`` (according to a judge).
    said
        The reason, unless done.
    steps, options, faces
        Facts about the input.
    parts, seconds
    cpu
        CPU seconds.
    twice
        Whether it was decomposed again, with the same bytes.
    """

    seed: int
    status: str
    said: list[str] = field(default_factory=list)
    steps: list[str] = field(default_factory=list)
    options: dict[str, Any] = field(default_factory=dict)
    faces: int = 0
    parts: int = 0
    seconds: float = 0.0
    cpu: float = 0.0
    twice: bool = False


def run_seed(seed: int, worker: Watched | InProcess, folder: Path) -> Row:
    """Decompose and judge the shape of a seed."""
    random = np.random.default_rng([seed, 3])
    ending, twice = str(random.choice(FORMATS)), bool(random.random() < 1 / AGAIN)
    return judged(Row(seed, "done"), make_shape(seed), draw_options(seed), ending, twice, worker, folder)


def judged(
    row: Row,
    shape: Shape,
    options: dict[str, Any],
    ending: str,
    twice: bool,
    worker: Watched | InProcess,
    folder: Path,
) -> Row:
    """Decompose a shape, possibly again with another number of threads, and fill in its row."""
    spec = JobSpec.of(options, file_format=ending)
    row = replace(row, steps=list(shape.steps), options=spec.options, faces=len(shape.faces))
    mesh = write_mesh(folder / f"{row.seed}.ply", shape.vertices, shape.faces)
    start = time.perf_counter()
    try:
        answer, files = worker.run(spec, mesh, mesh.name, "out")
        row.seconds, row.cpu = round(time.perf_counter() - start, 3), answer["cpu"]
        if "error" in answer:
            row.status, row.said = _refusal(shape, ending, answer)
            return row
        row.parts = answer["report"]["parts"]
        if twice and answer["report"]["complete"]:
            other = JobSpec.of({**options, "threads": options["threads"] % 3 + 1}, file_format=ending)
            again, same = worker.run(other, mesh, mesh.name, "out")
            row.cpu += again["cpu"]
            row.twice = files == same
            if not row.twice:
                return replace(row, status="wrong", said=[f"other bytes on other threads {again.get('error', '')}"])
    except WorkerDiedError as error:
        row.seconds = round(time.perf_counter() - start, 3)
        is_hang = error.reason.startswith("it ")
        return replace(row, status="hang" if is_hang else "crash", said=[error.reason, error.last_words])
    finally:
        mesh.unlink()
    if ending in ("obj", "ply"):
        row.said = judge(Case(shape, options, read_hulls(files[f"out.{ending}"], ending), answer["report"]))
        row.status = "wrong" if row.said else "done"
    return row


def _refusal(shape: Shape, ending: str, answer: dict[str, Any]) -> tuple[str, list[str]]:
    """Tell whether an error is the right one for this input."""
    error = answer["error"]
    if error.startswith("a bug in rlacd") or "memory" in error:
        return "bug", [error]
    if answer.get("unusable"):
        return ("refused" if len(finite_faces(shape)) == 0 else "wrong"), [error]
    # Single precision cannot hold every hull.
    return ("refused" if ending in ("glb", "urdf") and "precision" in error else "wrong"), [error]


def again(seed: int) -> None:
    """Run one seed in this process and print everything about it."""
    shape, options = make_shape(seed), draw_options(seed)
    print(f"{len(shape.vertices)} points, {len(shape.faces)} faces: {', '.join(shape.steps)}\n{options}")
    result = rlacd.decompose((shape.vertices, shape.faces), **options)
    report = result.report.as_dict()
    report["concavity"] = report.get("concavity", {}).get("max")
    print({key: report[key] for key in ("parts", "hausdorff", "concavity", "complete", "warnings", "seconds")})
    print([(body["step"], round(body["deviation"], 6)) for body in report["repair"]])
    hulls = [(np.array(hull.vertices), np.array(hull.faces)) for hull in result]
    print(judge(Case(shape, options, hulls, report)) or "all is well")


def totals(rows: list[dict[str, Any]]) -> str:
    """Sums over a log."""
    kinds = Counter[str]()
    for row in rows:
        options = row["options"]
        kinds["navigable space" if isinstance(options.get("criterion"), dict) else "concavity"] += 1
        kinds[f"quality {options.get('quality') or ('balanced' if options.get('merge', True) else 'fast')}"] += 1
        kinds[f"policy {options.get('policy', 'greedy')}"] += 1
        for name in ("max_hulls", "max_vertices", "max_faces", "preset", "timeout"):
            kinds[name] += name in options
    seconds = sum(row["seconds"] for row in rows)
    lines = [
        f"{len(rows)} inputs, {seconds / 60:.1f} minutes of decomposing, {sum(row['parts'] for row in rows)} hulls, "
        f"{sum(row['twice'] for row in rows)} decomposed twice with the same bytes",
        ", ".join(f"{status}: {n}" for status, n in Counter(row["status"] for row in rows).most_common()),
        ", ".join(f"{kind}: {n}" for kind, n in kinds.most_common()),
    ]
    lines += [
        f"  {row['status']} {row['seed']}: {'; '.join(row['said'])} [{', '.join(row['steps'])}] {row['options']}"
        for row in rows
        if row["status"] not in ("done", "refused")
    ]
    return "\n".join(lines)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--first", type=int, default=0, help="the first seed")
    parser.add_argument("--count", type=int, default=10**9, help="how many")
    parser.add_argument("--seconds", type=float, default=600.0, help="stop after this many")
    parser.add_argument("--limit", type=float, default=180.0, help="seconds a shape may take")
    parser.add_argument("--memory", type=float, default=3.0, help="gigabytes it may take; 0 for no limit")
    parser.add_argument("--here", action="store_true", help="in this process, without limits")
    parser.add_argument("--log", type=Path, default=Path("fuzz.jsonl"), help="added to")
    parser.add_argument("--again", type=int, help="repeat one seed in this process")
    parser.add_argument("--totals", type=Path, help="sums over a log")
    args = parser.parse_args()
    if args.again is not None:
        again(args.again)
        return
    if args.totals is not None:
        print(totals([json.loads(line) for line in args.totals.read_text().splitlines()]))
        return
    rows: list[dict[str, Any]] = []
    worker = InProcess() if args.here else Watched(ProcessLimits(seconds=args.limit, memory=int(args.memory * 2**30)))
    until = time.monotonic() + args.seconds
    with tempfile.TemporaryDirectory() as folder, args.log.open("a") as log:
        for seed in range(args.first, args.first + args.count):
            if time.monotonic() > until:
                break
            row = asdict(run_seed(seed, worker, Path(folder)))
            rows.append(row)
            log.write(json.dumps(row) + "\n")
            log.flush()
            if row["status"] not in ("done", "refused"):
                print(f"{row['status']} {seed}: {'; '.join(row['said'])}", flush=True)
    worker.close()
    print(totals(rows))
    sys.exit(any(row["status"] not in ("done", "refused") for row in rows))


if __name__ == "__main__":
    main()
