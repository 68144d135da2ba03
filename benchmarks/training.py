"""The paper's experiments that train: one policy an arm, all equally long, with the same seeds and meshes.

They are short compared with the paper's million cuts; the page states their length. An interrupted arm is resumed, and
a finished one is not trained again.
"""

from __future__ import annotations

import json
import statistics
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import click
import numpy as np

from benchmarks.cli import OUT, PATH, write
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

app = click.Group(help="The paper's experiments that train one policy an arm, or a table.")

Points = list[dict[str, float]]
"""The curves of one run, as in its ``curves.jsonl``."""

WEIGHT = 1000.0
"""The larger of the two rewards' weights, as in the paper."""

ARMS: Mapping[str, Mapping[str, Any]] = {
    "λ1 = λ2": {"volume_reward": WEIGHT, "finish_reward": WEIGHT},
    "without r1": {"volume_reward": 0.0, "finish_reward": WEIGHT},
    "without r2": {"volume_reward": WEIGHT, "finish_reward": 0.0},
}
"""Changes to the preset made by each arm; they say all that the arms differ in, so that they hold for every preset."""

VALIDATIONS = 2
"""Number of validations of each arm."""


def train_arms(
    meshes: Path, folder: Path, preset: str, env_steps: int | None, seeds: int, say: Callable[[str], None] = print
) -> Page:
    """Train every arm with every seed, each in a folder of its own; return a page with their last validations.

    Raises
    ------
    OptionError
        There is no such preset, or `folder` holds arms trained with other options.
    TrainingError
        There are no usable meshes.
    """
    first = _options(preset, env_steps, 0, ARMS["λ1 = λ2"])
    curves: dict[str, list[Points]] = {label: [] for label in ARMS}
    for seed in range(seeds):
        for number, (label, changes) in enumerate(ARMS.items(), 1):
            say(f"seed {seed}, arm {number} of {len(ARMS)}: {label}")
            run = folder / f"rewards-{number}-seed-{seed}"
            curves[label].append(_train(meshes, run, _options(preset, env_steps, seed, changes), say))
    about = (
        f"Every arm: preset {preset}, {first.env_steps:,} cuts (the paper: 1,000,000), {seeds} seeds, meshes of "
        f"up to {first.max_faces} triangles, concavity {first.threshold:g}, {first.validation} meshes held out by "
        "each seed. Ratios are geometric means over those, to greedy over 150 planes by the least sum of hull "
        "volumes; deployed: the least sum among the network's ten best planes. Numbers are means over the seeds, "
        "± their standard deviation; a single seed says nothing of differences of a few percent."
    )
    ratios = ("own_plane", "ten_best", "random")
    cells = [*((f"validation_{key}", ".2f") for key in ratios), ("loss", ".3g"), ("seconds", ".0f")]
    lines = [[label, *(_over_seeds(runs, key, form) for key, form in cells)] for label, runs in curves.items()]
    header = ["arm", "own plane ×", "ten best ×", "random ×", "loss", "seconds"]
    return Page("Weights of the rewards (4.5.3)", [about, Table(header, lines)])


def _options(preset: str, env_steps: int | None, seed: int, changes: Mapping[str, Any]) -> TrainOptions:
    options = TrainOptions.preset(preset, seed=seed)
    length = env_steps or options.env_steps
    if length < VALIDATIONS:
        raise OptionError(f"env_steps is {length}; it has to be at least {VALIDATIONS}.")
    lengths = {"env_steps": length, "validate_every": length // VALIDATIONS, "log_every": max(1, length // 50)}
    lengths["learning_starts"] = min(options.learning_starts, length // 5)
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


def _over_seeds(runs: list[Points], key: str, form: str) -> str:
    """Format the mean of the runs' last values, and their deviation if there are several."""
    last = [next((p[key] for p in reversed(points) if key in p), None) for points in runs]
    known = [value for value in last if value is not None]
    if not known:
        return "–"
    return f"{statistics.fmean(known):{form}}" + (f" ± {statistics.stdev(known):{form}}" if len(known) > 1 else "")


DISCOUNTS = {"share of the hull (eq. 9)": None, **{f"{x:g} + {x:g}": x for x in (0.4, 0.5, 0.7, 0.9, 0.99)}}

THRESHOLD = 0.02

SMALL_FILE = 15_000
"""Bytes: cut trees of small meshes take little time to build."""


def discounts_page(meshes: Path, names: list[str], count: int, depth: int, steps: int) -> Page:
    """Solve the cut trees of `count` small meshes exactly and by tabular Q-learning, for several discounts.

    Raises
    ------
    MeshError
        None of the meshes needs a cut.
    """
    roots, lines = _trees(meshes, names, count, depth), []
    for name, discount in DISCOUNTS.items():
        process = process_of(roots, alike=True, static_discount=discount)
        exact = process.solve()
        learned = q_learning(process, steps, np.random.default_rng(0))[-1]
        cells = ["does not exist", f"|Q| {np.abs(learned).max():.3g}"]
        if exact is not None:
            away = np.abs(learned - exact)[process.possible].max()
            cells = [f"{np.abs(exact).max():.3g}", f"error {away:.3g}"]
        lines.append([name, process.states, *cells])
    about = (
        f"All that three planes can make of {count} real solids in {depth} cuts, concavity {THRESHOLD:g}. "
        "Components that look alike (share of the hull filled and proportions, in thirds) are one state. Tabular "
        f"Q-learning of {steps:,} steps against exact dynamic programming."
    )
    table = Table(["discounts", "states", "greatest |Q*|", f"after {steps:,} steps"], lines)
    return Page("Which discounts converge (appendix A)", [about, table])


def _trees(meshes: Path, names: list[str], count: int, depth: int) -> list[Node]:
    """Cut trees of the first `count` small meshes that need a cut, in a fixed random order."""
    trees: list[list[Node]] = []
    small = [name for name in sorted(names) if (meshes / name).stat().st_size < SMALL_FILE]
    for name in np.random.default_rng(0).permutation(small).tolist():
        try:
            solid = Component(repair(load_mesh(meshes / name)).shape)
            found = grow(solid, Concavity(THRESHOLD), middle_planes(), depth)
        except (RlacdError, ValueError):
            continue
        if any(node.outcomes for node in found):
            trees.append(found)
        if len(trees) == count:
            break
    if not trees:
        raise MeshError(f"none of the {len(names)} meshes is small and needs a cut; give a folder with others.")
    return [node for tree in trees for node in tree]


@app.command()
@click.argument("meshes", type=PATH)
@OUT
@click.option("--preset", default="returns", show_default=True, help="Of `rlacd train`.")
@click.option("--env-steps", type=int, help="Cuts an arm.")
@click.option("--seeds", type=click.IntRange(1), default=1, show_default=True, help="Training runs of each arm.")
def rewards(meshes: Path, out: Path, preset: str, env_steps: int | None, seeds: int) -> None:
    """Train with both rewards, and without each (4.5.3)."""
    with exit_codes():
        find_meshes(meshes)
        write(train_arms(meshes, out, preset, env_steps, seeds, click.echo), out, "rewards")


@app.command()
@click.argument("meshes", type=PATH)
@OUT
@click.option("--weights", required=True, type=PATH, help="I2P-MAE's published checkpoint.")
@click.option("--env-steps", type=int, help="Cuts.")
def paper(meshes: Path, out: Path, weights: Path, env_steps: int | None) -> None:
    """Train to the letter (4.1): the preset `paper` on I2P-MAE's features, on a GPU if there is one."""
    with exit_codes():
        from benchmarks.learned.i2p_mae import I2PMAEEncoder, PublishedEncoder
        from rlacd.learn.train import train

        encoder = PublishedEncoder(I2PMAEEncoder.from_checkpoint(weights))
        options = TrainOptions.preset("paper", **({} if env_steps is None else {"env_steps": env_steps}))
        train(meshes, out, options, resume=True, say=click.echo, encoder=encoder)


@app.command()
@click.argument("meshes", type=PATH)
@OUT
@click.option("--count", type=click.IntRange(1), default=12, help="Small meshes whose cut trees are grown.")
@click.option("--depth", type=click.IntRange(1), default=4, help="Cuts deep.")
@click.option("--steps", type=click.IntRange(1), default=300_000, help="Steps of Q-learning.")
def discounts(meshes: Path, out: Path, count: int, depth: int, steps: int) -> None:
    """Find by tabular Q-learning on real cut trees which discounts converge (appendix A)."""
    with exit_codes():
        write(discounts_page(meshes, find_meshes(meshes), count, depth, steps), out, "discounts")
