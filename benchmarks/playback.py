"""How long a decomposition takes on n idle cores, from a trace of it on a busy machine with fewer.

python -m benchmarks.playback MESH CORES [--quality fast]

Threads are recorded with the CPU time of all that they did (`RLACD_TRACE`), which hardly depends on what else the
machine does. Played back, the main thread goes on where it did: it begins work, waits for it, or shares the items of a
map with the others; threads of the pool take what was begun in that order, and those that are ready share the cores.
The interpreter's lock is left out: freeing it gains 4 to 5 % on two cores.
"""

from __future__ import annotations

import argparse
import json
import os
import tempfile
from collections import deque
from pathlib import Path
from typing import Any

import rlacd

Step = tuple[str, Any]
"""What the main thread does next: "alone" for some seconds, "begin" or "wait" for a number, "map" items' seconds."""


def recorded(mesh: Path, cores: int, **options: Any) -> list[dict[str, Any]]:
    """The spans of a decomposition with a thread for each core."""
    with tempfile.TemporaryDirectory() as folder:
        os.environ["RLACD_TRACE"] = str(Path(folder) / "trace.json")
        rlacd.decompose(mesh, threads=cores, **options)
        spans: list[dict[str, Any]] = json.loads(Path(os.environ.pop("RLACD_TRACE")).read_text())["traceEvents"]
    return spans


def steps_of(spans: list[dict[str, Any]]) -> tuple[list[Step], dict[int, float]]:
    """What the main thread does, and the seconds of what was begun, by number."""
    begun = {span["args"]["number"]: span["tdur"] / 1e6 for span in spans if span["cat"] == "begun"}
    (whole,) = (span for span in spans if span["cat"] == "run")
    items = [span for span in spans if span["cat"] == "item"]
    steps: list[Step] = []
    at = whole["tts"]
    for span in sorted((one for one in spans if one["tid"] == whole["tid"]), key=lambda one: one["ts"]):
        if span["cat"] not in ("begin", "wait", "map") or span["tts"] < at:  # inside the one before
            continue
        steps.append(("alone", (span["tts"] - at) / 1e6))
        at = span["tts"] + span["tdur"]
        if span["cat"] == "map":
            end = span["ts"] + span["dur"]
            steps.append(("map", [one["tdur"] / 1e6 for one in items if span["ts"] <= one["ts"] < end]))
        else:
            steps.append((span["cat"], span["args"]["number"]))
    return [*steps, ("alone", (whole["tts"] + whole["tdur"] - at) / 1e6)], begun


def seconds_on(cores: int, steps: list[Step], begun: dict[int, float]) -> float:
    """Play the steps back."""
    clock, queue, working = 0.0, deque[tuple[int, float]](), dict[int, float]()
    done: set[int] = set()

    def let(seconds: float, until: set[int]) -> None:
        """Let the main thread work for some seconds, or wait until some work is done."""
        nonlocal clock
        while seconds > 0 or not until <= done:
            while queue and len(working) < cores:
                number, takes = queue.popleft()
                working[number] = takes
            rate = min(1.0, cores / (len(working) + (seconds > 0)))
            step = min([*working.values(), *([seconds] if seconds > 0 else [])])
            clock += step / rate
            seconds = max(seconds - step, 0.0)
            for number in [*working]:
                working[number] -= step
                if working[number] <= 1e-12:
                    done.add(number)
                    del working[number]

    for number, (kind, what) in enumerate(steps):
        if kind == "alone":
            let(what, set())
        elif kind == "begin":
            queue.append((what, begun.get(what, 0.0)))  # nothing of what was left before it was begun in earnest
        elif kind == "wait":
            let(0.0, {what})
        else:
            own = {-1 - 1000 * number - i: takes for i, takes in enumerate(what)}
            queue.extendleft(reversed(own.items()))
            let(0.0, {*own})
    return clock


def main() -> None:
    """Print the seconds on one core and on several."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("mesh", type=Path)
    parser.add_argument("cores", type=int, nargs="+")
    parser.add_argument("--quality", default="balanced")
    arguments = parser.parse_args()
    times = {
        cores: seconds_on(cores, *steps_of(recorded(arguments.mesh, cores, quality=arguments.quality)))
        for cores in (1, *arguments.cores)
    }
    for cores, seconds in times.items():
        print(f"{cores} cores: {seconds:.3f} s, {times[1] / seconds:.2f} times as fast as one")


if __name__ == "__main__":
    main()
