"""The command `rlacd train`: its options are the fields of `TrainOptions`, and their help is the fields' own."""

from __future__ import annotations

import dataclasses
import inspect
from collections.abc import Callable
from contextlib import AbstractContextManager
from pathlib import Path
from typing import Annotated, Any

import typer

from rlacd.errors import MissingExtraError, OptionError
from rlacd.learn.options import PRESETS, TrainOptions

EXTRA = ("torch", "gymnasium", "tensorboard", "safetensors", "onnx", "onnxscript", "onnxruntime")

HELP = """Train a policy that chooses cuts, by the paper's reinforcement learning.

\b
[bold]Examples[/bold]
  rlacd train meshes/ --run run/ --preset quick
  rlacd train meshes/ --run run/ --preset two-cores --seed 1
  rlacd train meshes/ --run run/ --preset two-cores --seed 1 --resume
  tensorboard --logdir run/tensorboard

The run's folder gets the curves, a checkpoint to --resume from, and in the end policy.onnx. A preset sets all options;
those given beside it change it.
"""


def train_command(exit_codes: Callable[[], AbstractContextManager[None]]) -> Callable[..., None]:
    """Build the command; `exit_codes` turns errors into a sentence and an exit code."""

    def train(**given: Any) -> None:
        with exit_codes():
            meshes, run, preset, resume = (given.pop(name) for name in ("meshes", "run", "preset", "resume"))
            options = TrainOptions.preset(preset, **{k: v for k, v in given.items() if v is not None})
            if run.exists() and not run.is_dir():
                raise OptionError(f"--run {run} is a file; give a folder.")
            _learn()(meshes, run, options, resume=resume, say=typer.echo)

    parameters: dict[str, tuple[Any, Any]] = {
        "meshes": (inspect.Parameter.empty, Annotated[Path, typer.Argument(help="A folder of meshes, of any depth.")]),
        "run": (inspect.Parameter.empty, Annotated[Path, typer.Option("--run", "-o", help="A folder for this run.")]),
        "preset": ("paper", Annotated[str, typer.Option(help=f"One of {', '.join(PRESETS)}.")]),
        "resume": (False, Annotated[bool, typer.Option("--resume", help="Go on from the run's last checkpoint.")]),
    }
    for option in dataclasses.fields(TrainOptions):
        default = str(option.default).lower() if isinstance(option.default, bool) else option.default
        text = f"{option.metadata['help']} [dim]\\[paper: {default}][/dim]"
        kind = type(option.default)
        parameters[option.name] = (None, Annotated[kind | None, typer.Option(help=text, show_default=False)])
    train.__signature__ = inspect.Signature(  # type: ignore[attr-defined]
        [
            inspect.Parameter(name, inspect.Parameter.KEYWORD_ONLY, default=default, annotation=annotation)
            for name, (default, annotation) in parameters.items()
        ]
    )
    train.__annotations__ = {name: annotation for name, (_, annotation) in parameters.items()}
    train.__doc__ = HELP
    return train


def _learn() -> Callable[..., Path]:
    try:
        from rlacd.learn.train import train
    except ModuleNotFoundError as error:
        if (error.name or "").split(".")[0] in EXTRA:
            raise MissingExtraError(
                "training needs an extra: run  pip install 'rlacd[train]'  and try again."
            ) from error
        raise
    return train
