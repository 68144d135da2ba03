"""The command `rlacd train`; its options and help are the fields of a dataclass."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import click

from rlacd.cli.commands import Argument, Command, Option, chosen, options_of, taken
from rlacd.cli.options import PoolOptions
from rlacd.errors import OptionError, import_extra
from rlacd.learn.options import TRAIN_PRESETS, TrainOptions

DEFAULT_PRESET = "returns"


def _train(meshes: Path, run: Path, preset: str, resume: bool, **given: Any) -> None:
    """Train a policy that chooses the cuts.

    \b
    Examples:
      rlacd train one_mesh/ --run run/ --preset one-mesh
      rlacd train meshes/ --run run/ --seed 1
      rlacd train meshes/ --run run/ --seed 1 --resume --jobs 8
      rlacd train meshes/ --run run/ --environments 256 --ray auto
      rlacd train meshes/ --run run/ --preset paper

    The training is the reinforcement learning of RL-ACD (Luo et al. 2025); numbers in parentheses are the paper's
    sections. The run's folder receives the curves, a checkpoint for --resume, and policy.npz, the best network so far,
    which decompose takes as --policy. A preset sets all options; other options override it.
    """
    where = PoolOptions(**taken(given, PoolOptions))
    options = TrainOptions.preset(preset, **chosen(given))
    if run.exists() and not run.is_dir():
        raise OptionError(f"--run {run} is a file; give a folder.")
    import_extra("torch", "training", "train")
    from rlacd.learn.train import train

    with where.open(1) as pool:
        train(meshes, run, options, resume=resume, say=click.echo, pool=pool, limits=where.limits())


COMMAND = Command(
    "train",
    _train,
    [
        Argument("meshes", "MESHES", "A folder of meshes, of any depth."),
        Option("--run", "-o", type=click.Path(path_type=Path), required=True, help="The folder of this run."),
        Option("--preset", default=DEFAULT_PRESET, show_default=True, help=f"One of {', '.join(TRAIN_PRESETS)}."),
        Option("--resume", is_flag=True, default=False, help="Continue from the run's last checkpoint."),
        Option("--jobs", type=int, panel="Processes", help="Processes that play episodes.  [default: 1]"),
        *options_of(PoolOptions, only=("ray", "limit", "memory")),
        *options_of(TrainOptions, note="the preset's, or "),
    ],
)
