"""The paper's training to the letter (4.1): the preset `paper` on the features of I2P-MAE."""

from __future__ import annotations

from pathlib import Path

import click

from benchmarks.cli import OUT, PATH
from rlacd.cli.exit_codes import exit_codes
from rlacd.learn.options import TrainOptions
from rlacd.policies import is_policy


@click.command()
@click.argument("meshes", type=PATH)
@OUT
@click.option("--weights", required=True, type=PATH, help="I2P-MAE's published checkpoint, or a policy.")
@click.option("--env-steps", type=int, help="Cuts.")
def app(meshes: Path, out: Path, weights: Path, env_steps: int | None) -> None:
    """Train on a folder of meshes, on a GPU if there is one; a run that was stopped goes on.

    \b
    python -m benchmarks paper MESHES --out RUN --weights i2p_mae.pth
    """
    with exit_codes():
        from benchmarks.learned.i2p_mae import published_network
        from rlacd.learn.train import train
        from rlacd.policies.network import named_encoder
        from rlacd.policies.points import PointEncoder

        of_policy = is_policy(str(weights))  # its encoder, whatever its network has learned
        encoder = named_encoder(str(weights)) if of_policy else PointEncoder(published_network(weights))
        options = TrainOptions.preset("paper", **({} if env_steps is None else {"env_steps": env_steps}))
        train(meshes, out, options, resume=True, say=click.echo, encoder=encoder)
