"""Pretraining of the I2P-MAE encoder on a folder of meshes, from top to bottom.

The random numbers of a step come from the seed and the step's number alone, so a resumed run equals an uninterrupted
one, and on CPU the same seed gives the same weights.
"""

from __future__ import annotations

import dataclasses
import math
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np
import torch

from rlacd._version import __version__
from rlacd.errors import OptionError, TrainingError
from rlacd.fields import require_same
from rlacd.learn.checkpoint import Checkpoint, adam_state, load_checkpoint, restore_adam, save_checkpoint
from rlacd.learn.curves import Curves
from rlacd.learn.device import pick_device
from rlacd.learn.encoders.i2p_mae import SIZES
from rlacd.learn.encoders.weights_file import save_weights
from rlacd.learn.meshes import MeshList, list_once
from rlacd.learn.pretrain.clouds import Clouds, augmented, epoch_rows
from rlacd.learn.pretrain.masked import MaskedAutoencoder
from rlacd.learn.pretrain.options import PretrainOptions
from rlacd.policies.observe import Float32Array

Say = Callable[[str], None]

MAY_CHANGE = frozenset({"threads", "device", "log_every", "validate_every", "checkpoint_seconds"})
"""Options that may change when a run is resumed."""

VALIDATION_BATCH = 32


def pretrain(meshes: Path, out: Path, options: PretrainOptions, *, resume: bool = False, say: Say = print) -> Path:
    """Pretrain encoder weights on a folder of meshes, without labels.

    Parameters
    ----------
    meshes : Path
        Folder of mesh files, searched to any depth.
    out : Path
        Output file of the weights, ``.safetensors``. The folder ``<name>.run`` beside it gets the points, the curves
        (``curves.jsonl``, ``tensorboard/``) and the checkpoint.
    options : PretrainOptions
    resume : bool
        Continue exactly from the checkpoint; without one, start afresh.
    say : callable
        Receives lines of progress.

    Returns
    -------
    Path
        `out`.

    Raises
    ------
    OptionError
        `out` has another ending or already has a run, or the options do not match the run to be resumed.
    TrainingError
        There are no usable meshes, or the checkpoint is damaged.
    """
    if out.suffix != ".safetensors":
        raise OptionError(f"--out is {out}; its name has to end in .safetensors.")
    sizes = SIZES[options.size]
    if options.points < sizes.groups[0]:
        raise OptionError(f"points is {options.points}; size {options.size} needs at least {sizes.groups[0]}.")
    torch.set_num_threads(options.threads)
    folder = out.with_suffix(".run")
    checkpoint = load_checkpoint(folder / "checkpoint")
    if checkpoint is not None and not resume:
        raise OptionError(f"{folder} holds a run already; use --resume to go on with it, or another --out.")
    listed = list_once(meshes, folder, options.max_faces, options.validation, options.seed)
    run = Pretraining(meshes, folder, options, listed, say)
    try:
        if checkpoint is None:
            run.curves.restart(0)
        else:
            run.restore(checkpoint)
            say(f"resuming at step {run.step}")
        run.run()
    finally:
        run.curves.close()
    about = {"sizes": dataclasses.asdict(sizes), "pretrain": dataclasses.asdict(options), "rlacd": __version__}
    save_weights(out, run.model.encoder.state_dict(), about)
    return out


class Pretraining:
    """The state of a run, and the loop."""

    def __init__(self, meshes: Path, folder: Path, options: PretrainOptions, listed: MeshList, say: Say) -> None:
        self.options, self.folder, self.say = options, folder, say
        self.device = pick_device(options.device)
        self.clouds = Clouds(meshes, listed.training, folder / "training.npy")
        self.held_out = Clouds(meshes, listed.validation, folder / "validation.npy")
        say(f"{len(self.clouds)} meshes to learn on, {len(self.held_out)} held out")
        torch.manual_seed(options.seed)
        self.model = MaskedAutoencoder(SIZES[options.size]).to(self.device)
        self.groups = SIZES[options.size].groups[-1]
        self.optimizer = torch.optim.AdamW(
            self.model.parameters(), lr=options.learning_rate, weight_decay=options.weight_decay
        )
        self.step = 0
        self.seconds = 0.0
        self.losses: list[float] = []
        self.curves = Curves(folder, "step")

    def run(self) -> None:
        """Train until the last step."""
        options, started, saved, before = self.options, time.perf_counter(), time.perf_counter(), self.seconds
        while self.step < options.steps:
            self.losses.append(self.learn())
            self.step += 1
            self.seconds = before + time.perf_counter() - started
            if self.step % options.log_every == 0:
                self.log()
            if len(self.held_out) and (self.step % options.validate_every == 0 or self.step == options.steps):
                loss = self.validate()
                self.curves.add(self.step, {"validation_loss": loss}, self.seconds)
                self.say(f"step {self.step}  loss on held-out meshes {loss:.5f}")
            if time.perf_counter() - saved >= options.checkpoint_seconds:
                self.save()
                saved = time.perf_counter()
        self.save()

    def learn(self) -> float:
        """Take one gradient step; returns the loss."""
        options = self.options
        rng = np.random.default_rng([options.seed, 2, self.step])
        rows = epoch_rows(len(self.clouds), options.batch, self.step, options.seed)
        clouds = augmented(
            self.clouds.draw(rows, options.points, rng), rotate=options.rotate, stretch=options.stretch, rng=rng
        )
        for group in self.optimizer.param_groups:
            group["lr"] = learning_rate(options, self.step)
        self.model.train()
        loss = self._loss(clouds, rng)
        if not torch.isfinite(loss):
            raise TrainingError(f"the loss is not finite at step {self.step}; try a smaller --learning-rate.")
        self.optimizer.zero_grad()
        loss.backward()  # type: ignore[no-untyped-call]
        self.optimizer.step()
        return float(loss.detach())

    @torch.no_grad()
    def validate(self) -> float:
        """Return the loss on the held-out clouds: always the same points, with the same groups hidden."""
        self.model.eval()
        rng = np.random.default_rng([self.options.seed, 3])
        total = 0.0
        for first in range(0, len(self.held_out), VALIDATION_BATCH):
            rows = range(first, min(first + VALIDATION_BATCH, len(self.held_out)))
            total += len(rows) * float(self._loss(self.held_out.draw(rows, self.options.points, rng), rng))
        return total / len(self.held_out)

    def log(self) -> None:
        """Append a point to the curves: the mean loss since the last one."""
        loss = sum(self.losses) / len(self.losses)
        self.losses = []
        rate = learning_rate(self.options, self.step)
        self.curves.add(self.step, {"loss": loss, "learning_rate": rate}, self.seconds)
        left = self.seconds / self.step * (self.options.steps - self.step)
        self.say(f"step {self.step} of {self.options.steps}  loss {loss:.5f}  {self.seconds:.0f} s, {left:.0f} s to go")

    def save(self) -> None:
        """Write a checkpoint."""
        state = {
            "options": dataclasses.asdict(self.options),
            "step": self.step,
            "seconds": self.seconds,
            "losses": self.losses,
        }
        weights = {f"model.{k}": v for k, v in self.model.state_dict().items()} | adam_state(self.optimizer)
        save_checkpoint(self.folder / "checkpoint", Checkpoint(weights, {}, state))

    def restore(self, checkpoint: Checkpoint) -> None:
        """Restore a checkpoint."""
        state = checkpoint.state
        require_same(state["options"], self.options, MAY_CHANGE)
        self.model.load_state_dict({k[6:]: v for k, v in checkpoint.weights.items() if k.startswith("model.")})
        restore_adam(self.optimizer, checkpoint.weights)
        self.step, self.seconds, self.losses = state["step"], state["seconds"], list(state["losses"])
        self.curves.restart(self.step)

    def _loss(self, clouds: Float32Array, rng: np.random.Generator) -> torch.Tensor:
        chances = rng.random((len(clouds), self.groups), dtype=np.float32)
        loss: torch.Tensor = self.model(
            torch.from_numpy(clouds).to(self.device), torch.from_numpy(chances).to(self.device), self.options.hidden
        )
        return loss


def learning_rate(options: PretrainOptions, step: int) -> float:
    """Return the learning rate of a step: linear warm-up, then half a cosine down to zero."""
    rise = options.rise * options.steps
    if step < rise:
        return options.learning_rate * (step + 1) / (rise + 1)
    return options.learning_rate * (1 + math.cos(math.pi * (step - rise) / (options.steps - rise))) / 2


__all__ = ["Pretraining", "learning_rate", "pretrain"]
