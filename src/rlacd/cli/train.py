"""The command `rlacd train`; its options and help are the fields of a dataclass."""

from __future__ import annotations

import importlib
from collections.abc import Callable
from pathlib import Path
from typing import Annotated, Any

import typer

from rlacd.cli.exit_codes import exit_codes
from rlacd.cli.parameters import REQUIRED, Parameters, chosen, command, option_parameters
from rlacd.errors import MissingExtraError, OptionError
from rlacd.learn.options import PRESETS, TrainOptions

EXTRA = ("torch", "safetensors")

DEFAULT_PRESET = "two-cores"

TRAIN_HELP = """Train a policy that chooses cuts, by the paper's reinforcement learning.

\b
[bold]Examples[/bold]
  rlacd train one_mesh/ --run run/ --preset one-mesh
  rlacd train meshes/ --run run/ --seed 1
  rlacd train meshes/ --run run/ --seed 1 --resume --jobs 8
  rlacd train meshes/ --run run/ --environments 256 --ray auto
  rlacd train meshes/ --run run/ --preset paper --encoder-weights i2p_mae.pth

The run's folder gets the curves, a checkpoint to --resume from, and policy.npz, the best network so far, which
decompose takes as --policy. A preset sets all options; those given beside it change it.
"""

MESHES = (REQUIRED, Annotated[Path, typer.Argument(help="A folder of meshes, of any depth.")])
WHERE: Parameters = {
    "jobs": (
        None,
        Annotated[
            int | None,
            typer.Option(
                min=0, help="Processes that cut; 0: the one that learns. [dim]\\[default: 1][/dim]", show_default=False
            ),
        ],
    ),
    "ray": (
        None,
        Annotated[
            str | None, typer.Option(metavar="ADDRESS", help="Cut on a Ray cluster: its address, auto, or local.")
        ],
    ),
    "limit": (
        600.0,
        Annotated[float, typer.Option(metavar="SECONDS", min=0.1, help="What one episode may take.")],
    ),
    "memory": (
        4.0,
        Annotated[float, typer.Option(metavar="GB", min=0.0, help="What a process that cuts may hold; 0: no limit.")],
    ),
}
"""Where episodes are played; affects only the time taken."""

RESUME = (False, Annotated[bool, typer.Option("--resume", help="Go on from the run's last checkpoint.")])


def train_command() -> Callable[..., None]:
    """Build `rlacd train`."""

    def train(**given: Any) -> None:
        with exit_codes():
            meshes, run, preset, resume = (given.pop(name) for name in ("meshes", "run", "preset", "resume"))
            from rlacd.pool import ProcessLimits, open_pool

            jobs, ray, limit, memory = (given.pop(name) for name in WHERE)
            options = TrainOptions.preset(preset, **chosen(given))
            if run.exists() and not run.is_dir():
                raise OptionError(f"--run {run} is a file; give a folder.")
            learn, limits = _learn("rlacd.learn.train", "train"), ProcessLimits(limit, int(memory * 2**30))
            with open_pool(jobs, ray) as pool:
                learn(meshes, run, options, resume=resume, say=typer.echo, pool=pool, limits=limits)

    own: Parameters = {
        "meshes": MESHES,
        "run": (REQUIRED, Annotated[Path, typer.Option("--run", "-o", help="A folder for this run.")]),
        "preset": (DEFAULT_PRESET, Annotated[str, typer.Option(help=f"One of {', '.join(PRESETS)}.")]),
        "resume": RESUME,
        **WHERE,
    }
    return command(train, TRAIN_HELP, own | option_parameters(TrainOptions, note="without a preset: "))


def _learn(module: str, name: str) -> Callable[..., Path]:
    try:
        run: Callable[..., Path] = getattr(importlib.import_module(module), name)
    except ModuleNotFoundError as error:
        if (error.name or "").split(".")[0] in EXTRA:
            raise MissingExtraError(
                "training needs an extra: run  pip install 'rlacd[train]'  and try again."
            ) from error
        raise
    return run
