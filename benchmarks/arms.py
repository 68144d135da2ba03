"""The paper's experiments that train one policy per arm: all arms equally long, with the same seed and meshes.

They are short compared with the paper's million cuts; the page states their length. With the presets of the paper an
arm learns the values of planes by one-step targets; with `counting` the same rewards, discounts and inputs are learned
as values of components from whole episodes. An interrupted arm is resumed, and a finished one is not trained again.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.charts import Curve, curves_chart
from benchmarks.page import Figure, Heading, Page, Text
from benchmarks.tables import Spread, Table
from rlacd.errors import MissingExtraError, OptionError
from rlacd.learn.paper.options import TrainOptions

Changes = Mapping[str, Any]

Points = list[dict[str, float]]
"""The curves of one run, as in its ``curves.jsonl``."""

RATIOS = (0.01, 0.1, 1.0, 10.0, 100.0)
"""lambda 1 / lambda 2, as in 4.5.3."""

LARGEST_WEIGHT = 1000.0
"""The larger of the two weights, as in the paper; the ratio determines the smaller one."""


HULL: Changes = {"discount": "hull"}


def _static(discount: float) -> Changes:
    return {"discount": "static", "static_discount": discount}


def _weights(volume: float, finish: float, cut: float = 0.0) -> Changes:
    return {"volume_reward": volume, "finish_reward": finish, "cut_cost": cut}


def _ratio(ratio: float) -> Changes:
    return _weights(LARGEST_WEIGHT * min(1.0, ratio), LARGEST_WEIGHT * min(1.0, 1.0 / ratio))


ARMS: Mapping[str, Mapping[str, Changes]] = {
    "paper-rewards": {
        **{f"λ1/λ2 = {ratio:g}": {**_ratio(ratio), **HULL} for ratio in RATIOS},
        "without r1": {**_weights(0.0, LARGEST_WEIGHT), **HULL},
        "without r2": {**_weights(LARGEST_WEIGHT, 0.0), **HULL},
        "-1 a cut (not paper)": {**_weights(0.0, 0.0, 1.0), **_static(1.0)},
    },
    "paper-encoding": {
        "component and hull": {"scale_input": False},
        "component alone": {"scale_input": False, "encoder": "profile-without-hull"},
        "component and hull, sizes and creases (not paper)": {"scale_input": True},
    },
    "paper-curves": {
        "share of the hull (eq. 9)": HULL,
        **{f"{share:g} + {share:g}": _static(share) for share in (0.5, 0.9, 0.99)},
    },
}
"""Changes to the preset made by each arm of an experiment; they say all that the arms differ in, so that they hold for
every preset."""

TITLES = {
    "paper-rewards": "Weights of the rewards (4.5.3)",
    "paper-encoding": "State encoding without the hull (4.5.2)",
    "paper-curves": "Training curves by discount (Fig. 7)",
}

VALIDATIONS = 2
"""Number of validations of each arm."""


def train_arms(
    experiment: str,
    meshes: Path,
    folder: Path,
    preset: str,
    iterations: int | None,
    seeds: int = 1,
    say: Callable[[str], None] = print,
) -> Page:
    """Train every arm of an experiment with every seed; return a page with their last validations and their curves.

    Parameters
    ----------
    experiment : str
        A key of `ARMS`.
    meshes : Path
        Training meshes; some of them are held out.
    folder : Path
        Run folder; each arm and seed gets a subfolder.
    preset : str
        See `rlacd.learn.paper.options.PRESETS`.
    iterations : int, optional
        Cuts per arm; the preset's number by default.
    seeds : int
        Number of seeds, from 0 on; each has its own held-out meshes and first weights.
    say : callable

    Raises
    ------
    OptionError
        There is no such preset, or `folder` holds arms trained with other options.
    TrainingError
        There are no usable meshes.
    """
    arms = ARMS[experiment]
    first = _options(preset, iterations, 0, next(iter(arms.values())))
    curves: dict[str, list[Points]] = {label: [] for label in arms}
    for seed in range(seeds):
        for number, (label, changes) in enumerate(arms.items(), 1):
            say(f"seed {seed}, arm {number} of {len(arms)}: {label}")
            run = folder / f"{experiment}-{number}-seed-{seed}"
            curves[label].append(_train(meshes, run, _options(preset, iterations, seed, changes), say))
    page = Page(TITLES[experiment])
    page.add(
        Text(
            f"Every arm: preset {preset}, {first.iterations:,} cuts (the paper: 1,000,000), {seeds} seeds, meshes of "
            f"up to {first.max_faces} triangles, concavity {first.threshold:g}, {first.validation} meshes held out by "
            "each seed. Ratios are geometric means over those, to greedy over 150 planes by the least sum of hull "
            "volumes; deployed: the least sum among the network's ten best planes. Numbers are means over the seeds, "
            "± their standard deviation; a single seed says nothing of differences of a few percent."
        ),
        _last_validations(curves),
        Heading("Curves"),
    )
    for key, name in (("loss", "loss"), ("value", "mean greatest value"), ("validation_merged_ratio", "merged parts")):
        drawn = [curve for label, runs in curves.items() if (curve := _mean_curve(label, runs, key)).x]
        if drawn:
            chart = curves_chart(drawn, "cuts", name, log_y=key == "loss")
            page.add(Figure(f"{experiment}-{key}.svg", chart, name))
    return page


def _options(preset: str, iterations: int | None, seed: int, changes: Changes) -> TrainOptions:
    options = TrainOptions.preset(preset, seed=seed)
    length = iterations or options.iterations
    if length < VALIDATIONS:
        raise OptionError(f"iterations is {length}; it has to be at least {VALIDATIONS}.")
    lengths = {"iterations": length, "validate_every": length // VALIDATIONS, "log_every": max(1, length // 50)}
    lengths["warmup"] = min(options.warmup, length // 5)
    return TrainOptions.preset(preset, seed=seed, **lengths, **changes)


def _train(meshes: Path, run: Path, options: TrainOptions, say: Callable[[str], None]) -> Points:
    try:
        from rlacd.learn.paper.train import train
    except ModuleNotFoundError as error:
        raise MissingExtraError("training needs an extra: run  pip install 'rlacd[train]'  and try again.") from error

    finished = run / "finished"
    if not finished.exists():
        train(meshes, run, options, resume=(run / "checkpoint").exists(), say=say)
        finished.touch()
    return [json.loads(line) for line in (run / "curves.jsonl").read_text(encoding="utf-8").splitlines()]


def _mean_curve(label: str, runs: list[Points], key: str) -> Curve:
    """Average the runs' curves of `key` at the points of the first."""
    seen = [np.array([(p["cuts"], p[key]) for p in points if key in p]).reshape(-1, 2).T for points in runs]
    x = seen[0][0] if all(points.size for points in seen) else np.empty(0)
    y = np.mean([np.interp(x, *points) for points in seen], axis=0) if len(x) else x
    return Curve(label, x.tolist(), y.tolist())


def _last_validations(curves: Mapping[str, list[Points]]) -> Table:
    ratios = ("parts_ratio", "merged_ratio", "deployed_parts_ratio", "deployed_merged_ratio")
    cells = [*((f"validation_{key}", ".2f") for key in ratios), ("loss", ".3g"), ("seconds", ".0f")]
    lines = [[label, *(_over_seeds(runs, key, form) for key, form in cells)] for label, runs in curves.items()]
    header = ["arm", "parts ×", "merged ×", "deployed: parts ×", "deployed: merged ×", "loss", "seconds"]
    return Table(header, lines)


def _over_seeds(runs: list[Points], key: str, form: str) -> str:
    """Format the mean of the runs' last values, and their deviation if there are several."""
    last = [next((p[key] for p in reversed(points) if key in p), None) for points in runs]
    known = [value for value in last if value is not None]
    if not known:
        return "–"
    spread = Spread.of(known)
    return f"{spread.mean:{form}}" + (f" ± {spread.deviation:{form}}" if len(known) > 1 else "")
