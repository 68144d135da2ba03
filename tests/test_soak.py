"""The soak finds what is broken, makes it small, goes on where it was; and what it has found stays mended."""

from __future__ import annotations

import contextlib
import json
import signal
from collections import Counter
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import trimesh

import fuzz.light
from fuzz.cases import case_of, file_of, minimised, try_case
from fuzz.faults import Fault, Run, complaints, left_behind
from fuzz.light import LightTrials, WarmTrials
from fuzz.mutations import Seed
from fuzz.recipes import Shape
from fuzz.seeds import seeds_from
from fuzz.soak import totals
from fuzz.trials import Laboratory, Trial

CASES = sorted((Path(__file__).parent / "cases").glob("*.json"))


@pytest.fixture(scope="module")
def laboratory() -> Any:
    laboratory = Laboratory(0, None)
    yield laboratory
    laboratory.close()


def first_of(trials: Any, kind: str) -> int:
    return next(number for number in range(10_000) if trials.kind(number) == kind)


@pytest.mark.parametrize("path", CASES, ids=lambda path: path.stem)
def test_what_was_found_stays_mended(path: Path, laboratory: Laboratory) -> None:
    case = json.loads(path.read_text(encoding="utf-8"))
    assert case["kind"] in ("shape", "mesh", "small")
    assert "vertices" in case, "a case to keep holds its triangles: `python -m fuzz.soak --minimise`"
    trial = try_case(laboratory, case)
    assert trial.is_well, trial.said


@pytest.mark.slow
@pytest.mark.parametrize("kind", ["file", "shape"])
def test_a_number_is_always_the_same_trial(kind: str, laboratory: Laboratory) -> None:
    number = first_of(laboratory, kind)
    one, two = (laboratory.trial(number) for _ in range(2))
    assert one.is_well, one.said
    assert replace(one, cpu=0) == replace(two, cpu=0)


FULL = Fault("full disk", (0, 3))
KILLED = Fault("killed", (0, -int(signal.SIGKILL)))


@pytest.mark.parametrize(
    ("fault", "run", "says"),
    [
        (FULL, Run(3, "rlacd: the disk is full", 0), ""),
        (FULL, Run(0, "", 0), ""),
        (KILLED, Run(-9, "", 0), ""),
        (FULL, Run(1, "rlacd: a bug in rlacd", 0), "it ended with 1"),
        (FULL, Run(-11, "", 0), "it ended with -11"),
        (FULL, Run(3, "Traceback (most recent call last):\nOSError", 0), "a traceback"),
        (FULL, Run(3, "", 0), "did not say why"),
    ],
)
def test_a_wrong_end_is_seen(fault: Fault, run: Run, says: str) -> None:
    found = complaints(fault, run)
    assert (says in " ".join(found)) if says else not found


OLD, WHOLE = {"out.xml": b"old"}, {"out.xml": b"new", "out/a.obj": b"a"}


@pytest.mark.parametrize(
    ("fault", "code", "after", "says"),
    [
        (FULL, 0, WHOLE, ""),
        (FULL, 3, OLD, ""),
        (FULL, 3, {"out.xml": b"ne"}, "neither"),
        (FULL, 3, {}, "lost"),
        (FULL, 3, {**OLD, "tmp": b""}, "left behind"),
        (FULL, 3, {"out.xml": b"new"}, "names files that are not there"),
        (FULL, 0, OLD, "undisturbed"),
        (KILLED, -9, {**OLD, "tmp": b"", "out/a.obj": b"a"}, ""),
        (KILLED, -9, {**OLD, "out/a.obj": b""}, "neither"),
    ],
)
def test_half_a_file_is_seen(fault: Fault, code: int, after: dict[str, bytes], says: str) -> None:
    found = left_behind(fault, code, "out.xml", OLD, after, WHOLE)
    assert (says in " ".join(found)) if says else not found


SEEDS = seeds_from(None)


@pytest.fixture
def light(tmp_path: Path) -> LightTrials:
    return LightTrials(0, SEEDS, tmp_path)


def test_a_file_is_read_or_refused_for_a_reason(light: LightTrials) -> None:
    counts, ends = Counter[str](), Counter[str]()
    for number in range(200):
        if light.kind(number) == "read":
            trial = light.trial(number)
            assert trial.is_well, trial.said
            counts += trial.counts
            ends[trial.end] += 1
    assert ends["loaded"] > 20
    assert ends["refused"] > 20
    for what, end in (("read", "loaded"), ("refused", "refused")):
        assert sum(number for name, number in counts.items() if name.endswith(what)) == ends[end]
    rows = [{"ends": {f"read {end}": number for end, number in ends.items()}, "counts": counts, "cpu": 1}]
    assert f"| read | {ends.total()} | 0 | {ends['loaded']} | {ends['refused']} |" in totals(rows)


def test_a_small_shape_is_decomposed_and_judged(light: LightTrials, monkeypatch: pytest.MonkeyPatch) -> None:
    number = first_of(light, "small")
    trial = light.trial(number)
    assert trial.end == "done", trial.said
    assert trial.counts["decompositions"] == 1
    assert replace(light.trial(number), cpu=0) == replace(trial, cpu=0)
    monkeypatch.setattr(fuzz.light, "judge", lambda *_: ["it is wrong"])
    assert light.trial(number).said == ["it is wrong"]


@pytest.mark.parametrize(
    ("raised", "end", "opened"),
    [
        (KeyError("x"), "untyped", ""),
        (MemoryError(), "memory", ""),
        (fuzz.light.rlacd.RlacdError("two\nlines"), "wrong", ""),
        (fuzz.light.rlacd.MeshFileError("refused"), "wrong", "/etc/hostname"),
    ],
)
def test_what_is_no_sentence_or_opens_another_file_is_a_failure(
    raised: Exception, end: str, opened: str, light: LightTrials, monkeypatch: pytest.MonkeyPatch
) -> None:
    def fails(path: Path) -> None:
        Path(opened or path).read_bytes()
        raise raised

    monkeypatch.setattr(fuzz.light, "load_mesh", fails)
    trial = light.reread(Trial(0, 0, "read"), "obj", Seed(b"v 0 0 0"))
    assert trial.end == end
    assert (f"it opened '{opened}'" in trial.said) == bool(opened)


def test_a_failure_is_made_small(light: LightTrials, monkeypatch: pytest.MonkeyPatch) -> None:
    """To one triangle under the options that it takes, and to the bytes that it takes."""
    monkeypatch.setattr(fuzz.light, "judge", lambda *_: ["it is wrong"])
    monkeypatch.setattr(fuzz.light, "load_mesh", lambda path: {}[path.read_bytes().count(b"v")])
    trial = next(t for t in map(light.trial, range(0, 200)) if t.kind == "small" and len(t.options) > 4)
    small = minimised(light, case_of(trial), 100)
    assert (len(small["faces"]), len(small["vertices"]), len(small["options"])) == (1, 3, 2)
    assert try_case(light, small).said == ["it is wrong"]
    trial = light.reread(Trial(0, 0, "read"), "obj", Seed(b"v 0 0 0\n" * 20))
    small = minimised(light, case_of(trial) | file_of("obj", Seed(b"v 0 0 0\n" * 20)), 100)
    assert len(small["content"]) == 4, "a byte"


@pytest.mark.slow
def test_a_process_that_takes_too_long_is_replaced() -> None:
    with contextlib.closing(WarmTrials(0, SEEDS, cpu_seconds=6.0)) as trials:
        ball = trimesh.creation.icosphere(6)
        shape = Shape(np.array(ball.vertices), np.array(ball.faces), ("ball",))
        late = trials.retry(Trial(0, 5, "small"), shape, {"threshold": 0.002, "quality": "best", "threads": 1})
        assert (late.end, late.said) == ("hang", ["it took more than 6 s of a processor"])
        number = first_of(trials, "read")
        assert trials.trial(number).is_well
