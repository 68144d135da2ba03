"""Checkpoints: a folder with the complete state of a run, replaced atomically and read without pickle.

``weights.safetensors`` holds the networks and Adam's moments, ``replay.npz`` the buffer, ``rollouts.npz`` the episodes
not yet learned from, ``state.json`` the rest.
"""

from __future__ import annotations

import json
import os
import shutil
import zipfile
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray
from safetensors import SafetensorError
from safetensors.torch import load_file, save_file
from torch import Tensor

from rlacd.errors import OutputError, TrainingError
from rlacd.io.read.open_file import read_file

FORMAT = 3

DAMAGE = (OSError, ValueError, KeyError, TypeError, RecursionError, MemoryError)
"""Exceptions that reading a damaged file may raise, beyond those of its format."""


@dataclass(frozen=True)
class Checkpoint:
    """The state of a run between two rounds.

    Attributes
    ----------
    weights : dict of Tensor
    replay : dict of ndarray
    state : dict
        Plain JSON values.
    rollouts : dict of ndarray
    """

    weights: Mapping[str, Tensor]
    replay: Mapping[str, NDArray[Any]]
    state: Mapping[str, Any]
    rollouts: Mapping[str, NDArray[Any]] = field(default_factory=dict)


def save_checkpoint(folder: Path, checkpoint: Checkpoint) -> None:
    """Write a checkpoint; if the process dies at any moment, a complete one remains, the old or the new.

    Raises
    ------
    OutputError
        The disk is full or the folder is not writable.
    """
    fresh, old = folder.with_name(folder.name + ".new"), folder.with_name(folder.name + ".old")
    try:
        shutil.rmtree(fresh, ignore_errors=True)
        fresh.mkdir(parents=True)
        save_file(
            {name: t.detach().cpu().contiguous() for name, t in checkpoint.weights.items()},
            fresh / "weights.safetensors",
        )
        np.savez(fresh / "replay.npz", allow_pickle=False, **checkpoint.replay)
        np.savez(fresh / "rollouts.npz", allow_pickle=False, **checkpoint.rollouts)
        (fresh / "state.json").write_text(json.dumps({"format": FORMAT, **checkpoint.state}), encoding="utf-8")
        for path in fresh.iterdir():
            with open(path, "rb") as file:
                os.fsync(file.fileno())
        shutil.rmtree(old, ignore_errors=True)
        if folder.exists():
            folder.rename(old)
        fresh.rename(folder)
        shutil.rmtree(old, ignore_errors=True)
    except OSError as error:
        raise OutputError(
            f"the checkpoint {folder} cannot be written ({error}); free some space and use --resume."
        ) from error


def load_checkpoint(folder: Path) -> Checkpoint | None:
    """Read a checkpoint; None if there is none.

    Raises
    ------
    TrainingError
        It is damaged, or was written by another version.
    """
    if not folder.exists():  # the process died between the two renames
        folder = folder.with_name(folder.name + ".old")
    if not folder.exists():
        return None
    try:
        state = json.loads(read_file(folder / "state.json"))
        weights = load_file(folder / "weights.safetensors")
        if state["format"] != FORMAT:
            raise TrainingError(f"{folder} has format {state['format']}, not {FORMAT}; train again from the beginning.")
        replay, rollouts = (_arrays(folder / name) for name in ("replay.npz", "rollouts.npz"))
    except (*DAMAGE, SafetensorError, zipfile.BadZipFile) as error:
        raise TrainingError(f"the checkpoint {folder} is damaged ({error}); remove it to train again.") from error
    return Checkpoint(weights, replay, state, rollouts)


def _arrays(path: Path) -> dict[str, NDArray[Any]]:
    """Read arrays; they are stored uncompressed, so a small file cannot expand in memory."""
    with zipfile.ZipFile(path) as archive:
        if any(member.compress_type != zipfile.ZIP_STORED for member in archive.infolist()):
            raise ValueError(f"{path.name} is compressed")
    with np.load(path, allow_pickle=False) as arrays:
        return {name: arrays[name] for name in arrays.files}


def adam_state(optimizer: torch.optim.Adam) -> dict[str, Tensor]:
    """Get Adam's moments and counts, by name."""
    parameters = optimizer.param_groups[0]["params"]
    return {
        f"adam.{i}.{key}": value
        for i, parameter in enumerate(parameters)
        for key, value in optimizer.state.get(parameter, {}).items()
    }


def restore_adam(optimizer: torch.optim.Adam, weights: Mapping[str, Tensor]) -> None:
    """Restore the result of `adam_state`."""
    state: dict[int, dict[str, Tensor]] = {}
    for name, value in weights.items():
        if name.startswith("adam."):
            _, i, key = name.split(".", 2)
            state.setdefault(int(i), {})[key] = value
    optimizer.load_state_dict({"state": state, "param_groups": optimizer.state_dict()["param_groups"]})
