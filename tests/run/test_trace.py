"""`RLACD_TRACE`: what each thread did, and what other numbers of cores would take."""

from __future__ import annotations

import json
from pathlib import Path

import pytest
import trimesh
from benchmarks.replay import Cost, Step, replayed, steps_of

import rlacd


def tasks(count: int, locked: float, unlocked: float) -> list[Step]:
    return [Step("map", [Cost(locked, unlocked, 0.0, 0.0, 50)] * count)]


@pytest.mark.parametrize(("threads", "seconds"), [(1, 8.0), (2, 4.0), (8, 1.0), (16, 1.0)])
def test_what_needs_no_lock_is_divided_among_the_cores(threads: int, seconds: float) -> None:
    assert replayed(tasks(8, 0.0, 1.0), threads) == pytest.approx(seconds, rel=0.01)


def test_a_trace_holds_the_work_of_all_threads(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    torus = trimesh.creation.torus(1.0, 0.4, major_sections=24, minor_sections=12)
    monkeypatch.setenv("RLACD_TRACE", str(tmp_path / "missing" / "torus.json"))
    with pytest.raises(rlacd.OutputError, match="correct RLACD_TRACE"):
        rlacd.decompose(torus, progress=lambda _: pytest.fail("work was begun"))
    monkeypatch.setenv("RLACD_TRACE", str(tmp_path / "torus.json"))
    rlacd.decompose(torus, threads=2)
    spans = json.loads((tmp_path / "torus.json").read_text())["traceEvents"]
    (whole,) = (span for span in spans if span["cat"] == "run")
    assert {"repair", "cut", "merge", "search", "measure"} <= {s["name"] for s in spans if s["cat"] == "stage"}
    assert all(whole["ts"] <= s["ts"] and s["ts"] + s["dur"] <= whole["ts"] + whole["dur"] + 1 for s in spans)
    assert len({span["tid"] for span in spans}) in (2, 3)
    steps = list(steps_of(spans))
    used = sum(c.locked + c.unlocked - c.in_loops + c.of_loops for step in steps for c in step.costs)
    assert replayed(steps, 1) == pytest.approx(used, rel=0.1)
    assert used / 2 <= replayed(steps, 2) < used
