"""Long-running tests: damaged files, random shapes, real meshes, faults and options, judged without the kernels.

    python -m fuzz.soak --hours 1                   `make soak HOURS=1`; resumes where it stopped
    python -m fuzz.soak --hours 1 --light           many small inputs a second in one warm process (`fuzz.light`)
    python -m fuzz.soak --hours 1 --only file       one kind of trial
    python -m fuzz.soak --totals                    totals of all runs
    python -m fuzz.soak --again soak/0-1234.json    rerun a failure
    python -m fuzz.soak --minimise CASE.json        reduce it to the options and triangles it needs

A trial is a function of the seed and its number alone (`fuzz.trials`, `fuzz.light`). A failure is written as a case, a
small JSON file; cases in ``tests/cases`` are rerun by every test run. The ledger holds the sums, one row for every
chunk of numbers.
"""

from __future__ import annotations

import argparse
import json
import sys
import threading
import time
from collections import Counter
from concurrent.futures import ThreadPoolExecutor
from itertools import count
from pathlib import Path
from typing import Any

from fuzz.cases import AnyLaboratory, case_of, file_of, minimised, try_case
from fuzz.light import KINDS as LIGHT
from fuzz.light import WarmTrials
from fuzz.seeds import seeds_from
from fuzz.trials import KINDS, WELL, Laboratory, Trial
from rlacd import __version__

CHUNK, LIGHT_CHUNK = 50, 1000
"""Number of trials per row of the ledger, and of light trials."""

TRIES = 40
"""Number of smaller inputs tried for every failure."""

Row = dict[str, Any]


class Ledger:
    """The finished trials, one JSON line per chunk of numbers.

    Parameters
    ----------
    path : Path
    """

    def __init__(self, path: Path) -> None:
        self._path = path
        self._lock = threading.Lock()
        lines = path.read_text(encoding="utf-8").splitlines() if path.exists() else []
        self.rows: list[Row] = [json.loads(line) for line in lines if line.endswith("}")]

    def done(self, seed: int, is_light: bool, only: str) -> set[int]:
        """The first numbers of a seed's finished chunks."""
        wanted = {"seed": seed, "light": is_light, "only": only}
        return {row["first"] for row in self.rows if {"light": False, "only": "", **row}.items() >= wanted.items()}

    def add(self, row: Row) -> None:
        """Append a row."""
        with self._lock, self._path.open("a") as file:
            file.write(json.dumps(row) + "\n")
        self.rows.append(row)


def do_chunk(
    laboratory: AnyLaboratory, first: int, size: int, until: float, folder: Path, only: str = ""
) -> Row | None:
    """Run the trials of a chunk, or only those of a kind; None if time runs out first."""
    ends, counts, cpu = Counter[str](), Counter[str](), 0.0
    for number in range(first, first + size):
        if time.monotonic() > until:
            return None
        if only and laboratory.kind(number) != only:
            continue
        trial = laboratory.trial(number)
        ends[f"{trial.kind} {trial.end}"] += 1
        counts += trial.counts
        cpu += trial.cpu
        if not trial.is_well:
            report(laboratory, trial, folder)
    return {
        "seed": laboratory.seed,
        "first": first,
        "light": isinstance(laboratory, WarmTrials),
        "only": only,
        "version": __version__,
        "cpu": round(cpu, 1),
        "ends": ends,
        "counts": counts,
    }


def report(laboratory: AnyLaboratory, trial: Trial, folder: Path) -> None:
    """Report a failure, and write it as a case, minimised as far as is quickly possible."""
    place = folder / f"{trial.seed}-{trial.number}.json"
    print(f"{trial.kind} {trial.number} {trial.end}: {'; '.join(trial.said)}\n  {place}", flush=True)
    case = case_of(trial)
    if trial.kind in ("read", "file"):
        case |= file_of(*laboratory.damaged(trial.number))
    write_case(place, case)
    write_case(place, minimised(laboratory, case, TRIES))


def write_case(place: Path, case: Row) -> None:
    place.write_text(json.dumps(case, indent=1) + "\n", encoding="utf-8")


def soak(args: argparse.Namespace) -> int:
    folder: Path = args.folder
    folder.mkdir(parents=True, exist_ok=True)
    ledger = Ledger(folder / "ledger.jsonl")
    before = len(list(folder.glob("*.json")))
    until = time.monotonic() + 3600 * args.hours
    size = LIGHT_CHUNK if args.light else CHUNK
    done = ledger.done(args.seed, args.light, args.only)
    chunks = (first for first in count(0, size) if first not in done)
    lock = threading.Lock()

    def work() -> None:
        laboratory = laboratory_of(args.seed, args.meshes, args.light)
        try:
            while time.monotonic() < until:
                with lock:
                    first = next(chunks)
                row = do_chunk(laboratory, first, size, until, folder, args.only)
                if row is not None:
                    ledger.add(row)
        finally:
            laboratory.close()

    with ThreadPoolExecutor(args.workers) as threads:
        for worker in [threads.submit(work) for _ in range(args.workers)]:
            worker.result()
    print(totals(ledger.rows))
    return len(list(folder.glob("*.json"))) - before


def laboratory_of(seed: int, meshes: Path | None, is_light: bool) -> AnyLaboratory:
    """What runs the trials of a seed."""
    meshes = meshes_of(meshes)
    return WarmTrials(seed, seeds_from(meshes)) if is_light else Laboratory(seed, meshes)


def meshes_of(folder: Path | None) -> Path | None:
    """The folder of real meshes, if it exists."""
    return folder if folder is not None and (folder / "index.csv").is_file() else None


def totals(rows: list[Row]) -> str:
    """Sums over the ledger, as Markdown."""
    ends, counts = Counter[str](), Counter[str]()
    for row in rows:
        ends.update(row["ends"])
        counts.update(row["counts"])
    kinds = sorted({end.split()[0] for end in ends})
    columns = [*WELL, *sorted({end.split()[1] for end in ends} - set(WELL))]
    lines = ["| trials | all | " + " | ".join(columns) + " |", "|---|--:|" + "--:|" * len(columns)]
    for kind in kinds:
        cells = [ends[f"{kind} {end}"] for end in columns]
        lines.append(f"| {kind} | {sum(cells)} | " + " | ".join(map(str, cells)) + " |")
    counted = ", ".join(f"{name} {number}" for name, number in counts.most_common())
    hours = sum(row["cpu"] for row in rows) / 3600
    return "\n".join([*lines, "", f"{hours:.2f} hours of a processor; {counted}"])


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--hours", type=float, default=1.0)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--workers", type=int, default=1, help="trials at a time")
    parser.add_argument("--meshes", type=Path, help="folder of real meshes, with its index.csv")
    parser.add_argument("--light", action="store_true", help="light trials only")
    parser.add_argument("--only", default="", choices=[*KINDS, *LIGHT], help="one kind of trial")
    parser.add_argument("--folder", type=Path, default=Path("soak"), help="for the ledger and the cases")
    parser.add_argument("--totals", action="store_true", help="sums over the ledger")
    parser.add_argument("--again", type=Path, help="a case to try once more")
    parser.add_argument("--minimise", type=Path, help="a case to make smaller, in place")
    args = parser.parse_args()
    args.light = args.only in LIGHT if args.only else args.light
    if args.only == "mesh" and meshes_of(args.meshes) is None:
        parser.error("--only mesh needs --meshes, the folder of real meshes")
    if args.totals:
        print(totals(Ledger(args.folder / "ledger.jsonl").rows))
        return 0
    if args.again or args.minimise:
        case = json.loads((args.again or args.minimise).read_text())
        laboratory = laboratory_of(case["seed"], args.meshes, case["kind"] in LIGHT)
        try:
            trial = try_case(laboratory, case)
            print(json.dumps(case_of(trial), indent=1))
            if args.minimise and not trial.is_well:
                write_case(args.minimise, minimised(laboratory, case, 50 * TRIES))
        finally:
            laboratory.close()
        return int(not trial.is_well)
    return min(soak(args), 1)


if __name__ == "__main__":
    sys.exit(main())
