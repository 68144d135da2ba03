"""Failures of a soak as small JSON files, which can be rerun by number, or from the triangles and options they hold."""

from __future__ import annotations

import base64
from collections.abc import Callable
from dataclasses import asdict
from typing import Any, Protocol

import numpy as np

from fuzz.mutations import Seed
from fuzz.recipes import Shape
from fuzz.trials import Trial
from rlacd import NavigableSpace

Case = dict[str, Any]

SHAPES = ("shape", "mesh", "small")
"""Kinds of trials that are a shape with options."""

SMALL = 60
"""Maximum number of triangles stored in a case; larger shapes are regenerated from their number."""


class AnyLaboratory(Protocol):
    """What runs trials: `fuzz.trials.Laboratory` or `fuzz.light.WarmTrials`."""

    seed: int

    def kind(self, number: int) -> str: ...
    def trial(self, number: int) -> Trial: ...
    def shape(self, number: int) -> tuple[Shape, dict[str, Any]]: ...
    def damaged(self, number: int) -> tuple[str, Seed]: ...
    def retry(self, trial: Trial, shape: Shape, options: dict[str, Any]) -> Trial: ...
    def reread(self, trial: Trial, kind: str, file: Seed) -> Trial: ...
    def close(self) -> None: ...


def case_of(trial: Trial, shape: Shape | None = None) -> Case:
    """Collect everything needed to rerun and understand a trial."""
    options = {name: _plain(value) for name, value in trial.options.items()}
    case: Case = {"seed": trial.seed, "number": trial.number, "kind": trial.kind, "end": trial.end, "said": trial.said}
    case |= {"story": trial.story, "options": options}
    if shape is not None:
        case |= {"vertices": shape.vertices.tolist(), "faces": shape.faces.tolist(), "closed": shape.is_closed}
    return case


def file_of(kind: str, file: Seed) -> Case:
    """What a case stores of a damaged file."""
    beside = {name: base64.b64encode(content).decode() for name, content in file.beside.items()}
    return {"format": kind, "content": base64.b64encode(file.content).decode(), "beside": beside}


def inputs(laboratory: AnyLaboratory, case: Case) -> tuple[Shape, dict[str, Any]]:
    """Return the shape and options of a case of the kinds ``shape`` and ``mesh``."""
    if "vertices" in case:
        vertices, faces = np.array(case["vertices"], float), np.array(case["faces"], np.int64)
        shape = Shape(vertices, faces, tuple(case["story"]), case["closed"])
    else:
        shape, _ = laboratory.shape(case["number"])
    return shape, {name: _lively(name, value) for name, value in case["options"].items()}


def try_case(laboratory: AnyLaboratory, case: Case) -> Trial:
    """Rerun a case."""
    if "content" in case:
        beside = {name: base64.b64decode(content) for name, content in case["beside"].items()}
        trial = Trial(case["seed"], case["number"], case["kind"])
        return laboratory.reread(trial, case["format"], Seed(base64.b64decode(case["content"]), beside))
    if case["kind"] not in SHAPES:
        return laboratory.trial(case["number"])
    return laboratory.retry(Trial(case["seed"], case["number"], case["kind"]), *inputs(laboratory, case))


def minimised(laboratory: AnyLaboratory, case: Case, tries: int) -> Case:
    """Remove options and triangles, or bytes, in ever smaller pieces, as long as the case still fails the same way."""
    if case["end"] == "hang" or ("content" not in case and case["kind"] not in SHAPES):
        return case
    then = Trial(case["seed"], case["number"], case["kind"], case["end"], case["said"])
    smallest, left = case, tries

    def fails(less: Case) -> bool:
        nonlocal smallest, left
        left -= 1
        if left < 0:
            return False
        now = try_case(laboratory, less)
        if now.end != then.end or not _alike(now, then):
            return False
        smallest = less if len(less.get("faces", ())) <= SMALL else smallest
        return True

    if "content" in case:
        content = np.frombuffer(base64.b64decode(case["content"]), np.uint8)
        _thin(len(content), lambda kept: fails({**case, "content": base64.b64encode(content[kept].tobytes()).decode()}))
        return smallest
    options = case["options"]
    for name in [name for name in options if name != "threads"]:
        fewer = {other: value for other, value in options.items() if other != name}
        if ("threshold" in fewer or "criterion" in fewer) and fails({**case, "options": fewer}):
            options = fewer
    shape, _ = inputs(laboratory, case)
    _thin(len(shape.faces), lambda kept: fails({**case, "options": options, **_only(shape, shape.faces[kept])}))
    return smallest


def _thin(count: int, fails: Callable[[np.ndarray], bool]) -> None:
    """Leave out ever smaller pieces of so many things; `fails` gets the numbers of those that are left."""
    kept, step = np.arange(count), count // 2
    while step:
        at = 0
        while at < len(kept):
            less = np.delete(kept, slice(at, at + step))
            if len(less) and fails(less):
                kept = less
            else:
                at += step
        step //= 2


def _only(shape: Shape, faces: np.ndarray) -> Case:
    """Some faces of a shape, as a case holds them."""
    used, index = np.unique(faces, return_inverse=True)
    return {"vertices": shape.vertices[used].tolist(), "faces": index.reshape(-1, 3).tolist(), "closed": False}


def _alike(now: Trial, then: Trial) -> bool:
    """Tell whether the complaints agree except for their numbers."""
    words = [{word for line in said for word in line.split() if word.isalpha()} for said in (now.said, then.said)]
    return len(words[0] & words[1]) >= 0.7 * len(words[1])


def _plain(value: Any) -> Any:
    if not isinstance(value, NavigableSpace):
        return value
    return {name: given for name, given in asdict(value).items() if given is not None and given != ()}


def _lively(name: str, value: Any) -> Any:
    """Convert an option to the value that `rlacd.decompose` takes."""
    return NavigableSpace(**value) if name == "criterion" and isinstance(value, dict) else value
