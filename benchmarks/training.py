"""The paper's experiments that train one policy per arm: all arms equally long, with the same seeds and meshes.

They are short compared with the paper's million cuts; the page states their length. An interrupted arm is resumed, and
a finished one is not trained again.
"""

from __future__ import annotations

import json
import statistics
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Annotated, Any

import numpy as np
import typer

from benchmarks.charts import Curve, curves_chart, need_charts
from benchmarks.cli import Meshes, Out, write
from benchmarks.runner import find_meshes
from benchmarks.tables import Page, Table
from benchmarks.tabular import Node, grow, middle_planes, process_of, q_learning
from rlacd.cli.exit_codes import exit_codes
from rlacd.criteria import Concavity
from rlacd.errors import MeshError, MissingExtraError, OptionError, RlacdError
from rlacd.io.read.load import load_mesh
from rlacd.learn.options import TrainOptions
from rlacd.repair.repair import repair
from rlacd.solid.component import Component

app = typer.Typer(add_completion=False, no_args_is_help=True, help="The paper's tables that train, one policy an arm.")

Changes = Mapping[str, Any]

Points = list[dict[str, float]]
"""The curves of one run, as in its ``curves.jsonl``."""

RATIOS = (0.1, 10.0, 0.01, 100.0)
"""lambda 1 / lambda 2 other than 1, as in 4.5.3."""

LARGEST_WEIGHT = 1000.0
"""The larger of the two weights, as in the paper; the ratio determines the smaller one."""


PAPER: Changes = {"objective": "rewards"}


def _static(discount: float) -> Changes:
    return {**PAPER, "static_discount": discount}


def _weights(volume: float, finish: float) -> Changes:
    return {**PAPER, "volume_reward": volume, "finish_reward": finish}


def _ratio(ratio: float) -> Changes:
    return _weights(LARGEST_WEIGHT * min(1.0, ratio), LARGEST_WEIGHT * min(1.0, 1.0 / ratio))


ARMS: Mapping[str, Mapping[str, Changes]] = {
    "rewards": {
        "λ1/λ2 = 1": PAPER,
        "without r1": _weights(0.0, LARGEST_WEIGHT),
        "without r2": _weights(LARGEST_WEIGHT, 0.0),
        **{f"λ1/λ2 = {ratio:g}": _ratio(ratio) for ratio in RATIOS},
        "fewest cuts (not paper)": {"objective": "fewest-cuts"},
    },
    "curves": {
        "share of the hull (eq. 9)": PAPER,
        **{f"{share:g} + {share:g}": _static(share) for share in (0.5, 0.9, 0.99)},
    },
}
"""Changes to the preset made by each arm of an experiment; they say all that the arms differ in, so that they hold for
every preset."""

TITLES = {
    "rewards": "Weights of the rewards (4.5.3)",
    "curves": "Training curves by discount (Fig. 7)",
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
        See `rlacd.learn.options.TRAIN_PRESETS`.
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
        (
            f"Every arm: preset {preset}, {first.iterations:,} cuts (the paper: 1,000,000), {seeds} seeds, meshes of "
            f"up to {first.max_faces} triangles, concavity {first.threshold:g}, {first.validation} meshes held out by "
            "each seed. Ratios are geometric means over those, to greedy over 150 planes by the least sum of hull "
            "volumes; deployed: the least sum among the network's ten best planes. Numbers are means over the seeds, "
            "± their standard deviation; a single seed says nothing of differences of a few percent."
        ),
        _last_validations(curves),
        "## Curves",
    )
    for key, name in (("loss", "loss"), ("target", "mean target"), ("validation_own_plane", "parts by the own plane")):
        drawn = [curve for label, runs in curves.items() if (curve := _mean_curve(label, runs, key)).x]
        if drawn:
            chart = curves_chart(drawn, "cuts", name, log_y=key == "loss")
            page.chart(f"{experiment}-{key}.svg", chart, name)
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
        from rlacd.learn.train import train
    except ModuleNotFoundError as error:
        raise MissingExtraError("training needs an extra: run  pip install 'rlacd[train]'  and try again.") from error

    finished = run / "finished"
    if not finished.exists():
        train(meshes, run, options, resume=(run / "checkpoint.npz").exists(), say=say)
        finished.touch()
    return [json.loads(line) for line in (run / "curves.jsonl").read_text(encoding="utf-8").splitlines()]


def _mean_curve(label: str, runs: list[Points], key: str) -> Curve:
    """Average the runs' curves of `key` at the points of the first."""
    seen = [np.array([(p["cuts"], p[key]) for p in points if key in p]).reshape(-1, 2).T for points in runs]
    x = seen[0][0] if all(points.size for points in seen) else np.empty(0)
    y = np.mean([np.interp(x, *points) for points in seen], axis=0) if len(x) else x
    return Curve(label, x.tolist(), y.tolist())


def _last_validations(curves: Mapping[str, list[Points]]) -> Table:
    ratios = ("own_plane", "ten_best", "random")
    cells = [*((f"validation_{key}", ".2f") for key in ratios), ("loss", ".3g"), ("seconds", ".0f")]
    lines = [[label, *(_over_seeds(runs, key, form) for key, form in cells)] for label, runs in curves.items()]
    header = ["arm", "own plane ×", "ten best ×", "random ×", "loss", "seconds"]
    return Table(header, lines)


def _over_seeds(runs: list[Points], key: str, form: str) -> str:
    """Format the mean of the runs' last values, and their deviation if there are several."""
    last = [next((p[key] for p in reversed(points) if key in p), None) for points in runs]
    known = [value for value in last if value is not None]
    if not known:
        return "–"
    return f"{statistics.fmean(known):{form}}" + (f" ± {statistics.stdev(known):{form}}" if len(known) > 1 else "")


DISCOUNTS = {
    "share of the hull (eq. 9)": None,
    "0.4 + 0.4": 0.4,
    "0.5 + 0.5": 0.5,
    "0.7 + 0.7": 0.7,
    "0.9 + 0.9": 0.9,
    "0.99 + 0.99": 0.99,
}
THRESHOLD = 0.02
SMALL_FILE = 15_000
"""Bytes: cut trees of small meshes take little time to build."""

POINTS = 300
"""Number of points on each curve."""

ENDLESS = 1e12
"""Values beyond this are not drawn."""


def discounts_page(meshes: Path, names: list[str], count: int = 12, depth: int = 4, steps: int = 300_000) -> Page:
    """Solve the cut trees of `count` small meshes exactly and by tabular Q-learning, for several discounts.

    Parameters
    ----------
    meshes : Path
    names : list of str
        Meshes in that folder. A fixed sample is taken of those that are small and need a cut.
    count, depth, steps : int
        Number of meshes, depth of the cut trees, steps of Q-learning.

    Raises
    ------
    MeshError
        None of the meshes needs a cut.
    """
    roots = _trees(meshes, names, count, depth)
    every = max(1, steps // POINTS)
    sizes, errors, lines = [], [], []
    for name, discount in DISCOUNTS.items():
        process = process_of(roots, alike=True, static_discount=discount)
        exact = process.solve()
        history = q_learning(process, steps, np.random.default_rng(0), every=every)
        at = every * np.arange(1, len(history) + 1)
        size = np.array([np.abs(q).max() for q in history])
        shown = (size > 0) & (size < ENDLESS)
        sizes.append(Curve(name, at[shown].tolist(), size[shown].tolist()))
        cells = ["does not exist", f"|Q| {size[-1]:.3g}"]
        if exact is not None:
            away = np.array([np.abs(q - exact)[process.possible].max() for q in history])
            errors.append(Curve(name, at[away > 0].tolist(), away[away > 0].tolist()))
            cells = [f"{np.abs(exact).max():.3g}", f"error {away[-1]:.3g}"]
        lines.append([name, process.states, *cells])
    page = Page("Which discounts converge (appendix A)")
    page.add(
        (
            f"All that three planes can make of {count} real solids in {depth} cuts, concavity {THRESHOLD:g}. "
            "Components that look alike (share of the hull filled and proportions, in thirds) are one state. Tabular "
            f"Q-learning of {steps:,} steps against exact dynamic programming."
        ),
        Table(["discounts", "states", "greatest |Q*|", f"after {steps:,} steps"], lines),
    )
    page.chart("discounts-size.svg", *_drawn(sizes, "greatest |Q|"))
    page.chart("discounts-error.svg", *_drawn(errors, "greatest |Q − Q*|, where Q* exists"))
    return page


def _drawn(curves: list[Curve], what: str) -> tuple[bytes, str]:
    return curves_chart(curves, "steps of Q-learning", what, log_x=True, log_y=True, markers=False), what


def _trees(meshes: Path, names: list[str], count: int, depth: int) -> list[Node]:
    """Cut trees of the first `count` small meshes that need a cut, in a fixed random order."""
    roots: list[Node] = []
    used = 0
    small = [name for name in sorted(names) if (meshes / name).stat().st_size < SMALL_FILE]
    for name in [small[i] for i in np.random.default_rng(0).permutation(len(small))]:
        try:
            solid = Component(repair(load_mesh(meshes / name)).shape)
            found = grow(solid, Concavity(THRESHOLD), middle_planes(), depth)
        except (RlacdError, ValueError):
            continue
        if any(node.outcomes for node in found):
            roots += found
            used += 1
        if used == count:
            break
    if not roots:
        raise MeshError(f"none of the {len(names)} meshes is small and needs a cut; give a folder with others.")
    return roots


def _command(name: str, about: str) -> None:
    @app.command(name, help=about)
    def run(
        meshes: Meshes,
        out: Out,
        preset: Annotated[str, typer.Option(help="Of `rlacd train`.")] = "two-cores",
        iterations: Annotated[int | None, typer.Option(help="Cuts an arm.", show_default=False)] = None,
        seeds: Annotated[int, typer.Option(min=1, help="Training runs of each arm.")] = 1,
    ) -> None:
        with exit_codes():
            need_charts()
            find_meshes(meshes)
            write(train_arms(name, meshes, out, preset, iterations, seeds, typer.echo), out, name)


_command("rewards", "Train with other weights of the two rewards, and without each (4.5.3).")
_command("curves", "Train with other discounts, and draw the curves (Fig. 7).")


@app.command("discounts")
def discounts(
    meshes: Meshes,
    out: Out,
    count: Annotated[int, typer.Option(min=1, help="Small meshes whose cut trees are grown.")] = 12,
    depth: Annotated[int, typer.Option(min=1, help="Cuts deep.")] = 4,
    steps: Annotated[int, typer.Option(min=1, help="Steps of Q-learning.")] = 300_000,
) -> None:
    """Find by tabular Q-learning on real cut trees which discounts converge (appendix A)."""
    with exit_codes():
        need_charts()
        write(discounts_page(meshes, find_meshes(meshes), count, depth, steps), out, "discounts")
