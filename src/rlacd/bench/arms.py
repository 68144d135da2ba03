"""The paper's experiments that train one policy per arm: all arms equally long, with the same seed and meshes.

They are short compared with the paper's million cuts; the page states their length. An interrupted arm is resumed, and
a finished one is not trained again.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

from rlacd.bench.charts import Curve, curves_chart
from rlacd.bench.page import Figure, Heading, Page, Text
from rlacd.bench.tables import Table
from rlacd.errors import MissingExtraError, OptionError
from rlacd.learn.paper.options import TrainOptions

Changes = Mapping[str, Any]

RATIOS = (0.01, 0.1, 1.0, 10.0, 100.0)
"""lambda 1 / lambda 2, as in 4.5.3."""

LARGEST_WEIGHT = 1000.0
"""The larger of the two weights, as in the paper; the ratio determines the smaller one."""


def _weights(ratio: float) -> Changes:
    return {
        "volume_reward": LARGEST_WEIGHT * min(1.0, ratio),
        "finish_reward": LARGEST_WEIGHT * min(1.0, 1.0 / ratio),
    }


ARMS: Mapping[str, Mapping[str, Changes]] = {
    "paper-rewards": {
        **{f"λ1/λ2 = {ratio:g}": _weights(ratio) for ratio in RATIOS},
        "without r1": {"volume_reward": 0.0},
        "without r2": {"finish_reward": 0.0},
    },
    "paper-encoding": {
        "component and hull": {},
        "component alone": {"encoder": "profile-without-hull"},
    },
    "paper-curves": {
        "share of the hull (eq. 9)": {},
        **{f"{share:g} + {share:g}": {"discount": "static", "static_discount": share} for share in (0.5, 0.9, 0.99)},
    },
}
"""Changes to the preset made by each arm of an experiment."""

TITLES = {
    "paper-rewards": "Weights of the rewards (4.5.3)",
    "paper-encoding": "State encoding without the hull (4.5.2)",
    "paper-curves": "Training curves by discount (Fig. 7)",
}

VALIDATIONS = 4
"""Number of validations of each arm."""


def train_arms(
    experiment: str,
    meshes: Path,
    folder: Path,
    preset: str,
    iterations: int | None,
    seed: int = 0,
    say: Callable[[str], None] = print,
) -> Page:
    """Train every arm of an experiment and return a page with their last validations and their curves.

    Parameters
    ----------
    experiment : str
        A key of `ARMS`.
    meshes : Path
        Training meshes; some of them are held out.
    folder : Path
        Run folder; each arm gets a subfolder.
    preset : str
        See `rlacd.learn.paper.options.PRESETS`.
    iterations : int, optional
        Cuts per arm; the preset's number by default.
    seed : int
    say : callable

    Raises
    ------
    OptionError
        There is no such preset, or `folder` holds arms trained with other options.
    TrainingError
        There are no usable meshes.
    """
    arms = {label: _options(preset, iterations, seed, changes) for label, changes in ARMS[experiment].items()}
    curves = {}
    for number, (label, options) in enumerate(arms.items(), 1):
        say(f"arm {number} of {len(arms)}: {label}")
        curves[label] = _train(meshes, folder / f"{experiment}-{number}", options, say)
    page = Page(TITLES[experiment])
    first = next(iter(arms.values()))
    page.add(
        Text(
            f"Every arm: preset {preset}, {first.iterations:,} cuts (the paper: 1,000,000), seed {seed}, meshes of up "
            f"to {first.max_faces} triangles, concavity {first.threshold:g}, {first.validation} meshes held out. "
            "Ratios are geometric means over those, to greedy over 150 planes by the least sum of hull volumes; "
            "deployed: the least sum among the network's ten best planes. One seed: differences of a few percent say "
            "nothing."
        ),
        _last_validations(curves),
        Heading("Curves"),
    )
    for key, name in (("loss", "loss"), ("value", "mean greatest value"), ("validation_merged_ratio", "merged parts")):
        drawn = [
            Curve(label, [p["cuts"] for p in points if key in p], [p[key] for p in points if key in p])
            for label, points in curves.items()
        ]
        drawn = [curve for curve in drawn if curve.x]
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


def _train(meshes: Path, run: Path, options: TrainOptions, say: Callable[[str], None]) -> list[dict[str, float]]:
    try:
        from rlacd.learn.paper.train import train
    except ModuleNotFoundError as error:
        raise MissingExtraError("training needs an extra: run  pip install 'rlacd[train]'  and try again.") from error

    finished = run / "policy.onnx"
    if not finished.exists():
        train(meshes, run, options, resume=(run / "checkpoint").exists(), say=say)
    return [json.loads(line) for line in (run / "curves.jsonl").read_text(encoding="utf-8").splitlines()]


def _last_validations(curves: Mapping[str, list[dict[str, float]]]) -> Table:
    keys = ("parts_ratio", "merged_ratio", "deployed_parts_ratio", "deployed_merged_ratio")
    lines = []
    for label, points in curves.items():
        last = next((p for p in reversed(points) if "validation_merged_ratio" in p), {})
        cells = [f"{last[f'validation_{key}']:.2f}" if f"validation_{key}" in last else "–" for key in keys]
        loss = next((f"{p['loss']:.3g}" for p in reversed(points) if "loss" in p), "–")
        lines.append([label, *cells, loss, f"{points[-1]['seconds']:.0f}" if points else "–"])
    header = ["arm", "parts ×", "merged ×", "deployed: parts ×", "deployed: merged ×", "loss", "seconds"]
    return Table(header, lines)
