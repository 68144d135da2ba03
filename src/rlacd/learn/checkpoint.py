"""Checkpoints: the complete state of a run in one .npz, replaced atomically and read without pickle."""

from __future__ import annotations

import io
import json
import zipfile
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray

from rlacd._version import __version__
from rlacd.errors import TrainingError
from rlacd.io.write.atomic import write_file

Arrays = Mapping[str, NDArray[Any]]


def packed(arrays: Arrays) -> bytes:
    """Pack arrays as the content of an .npz file."""
    file = io.BytesIO()
    np.savez(file, allow_pickle=False, **arrays)
    return file.getvalue()


def unpacked(content: bytes) -> dict[str, NDArray[Any]]:
    """Unpack the content of an .npz file."""
    with np.load(io.BytesIO(content), allow_pickle=False) as arrays:
        return dict(arrays)


def save_checkpoint(path: Path, arrays: Mapping[str, Mapping[str, Any]], state: Mapping[str, Any]) -> None:
    """Write arrays or tensors by owner and name, and plain JSON values; at any moment the old file or the new is whole.

    Raises
    ------
    OutputError
        The disk is full or the folder is not writable.
    """
    plain = {"state": np.frombuffer(json.dumps({"version": __version__, **state}).encode(), np.uint8)}
    for owner, own in arrays.items():
        for name, value in own.items():
            plain[f"{owner}.{name}"] = value.cpu().numpy() if isinstance(value, torch.Tensor) else value
    write_file(path, packed(plain))


def load_checkpoint(path: Path) -> tuple[dict[str, dict[str, NDArray[Any]]], dict[str, Any]] | None:
    """Read the arrays by owner and name, and the plain values; None if there is no checkpoint.

    Raises
    ------
    TrainingError
        It is damaged, or was written by another version.
    """
    if not path.exists():
        return None
    damage = (OSError, ValueError, KeyError, TypeError, EOFError, RecursionError, MemoryError, zipfile.BadZipFile)
    try:
        with zipfile.ZipFile(path) as archive:
            if any(member.compress_type != zipfile.ZIP_STORED for member in archive.infolist()):
                raise ValueError("it is compressed")  # a small file must not expand in memory
        with np.load(path, allow_pickle=False) as file:
            state = json.loads(file["state"].tobytes())
            arrays: dict[str, dict[str, NDArray[Any]]] = {}
            for whole in file.files:
                owner, _, name = whole.partition(".")
                if name:
                    arrays.setdefault(owner, {})[name] = file[whole]
        version = state["version"]
    except damage as error:
        raise TrainingError(f"the checkpoint {path} is damaged ({error}); remove it to train again.") from error
    if version != __version__:
        raise TrainingError(f"{path} is of rlacd {version}, not {__version__}; train again from the beginning.")
    return arrays, state


def tensors(arrays: Arrays) -> dict[str, torch.Tensor]:
    """The same as tensors."""
    return {name: torch.from_numpy(np.array(value)) for name, value in arrays.items()}


def adam_state(optimizer: torch.optim.Adam) -> dict[str, torch.Tensor]:
    """Get Adam's moments and counts, by name."""
    return {f"{i}.{key}": v for i, of_one in optimizer.state_dict()["state"].items() for key, v in of_one.items()}


def restore_adam(optimizer: torch.optim.Adam, saved: Mapping[str, torch.Tensor]) -> None:
    """Restore the result of `adam_state`."""
    state: dict[int, dict[str, torch.Tensor]] = {}
    for name, value in saved.items():
        i, key = name.split(".", 1)
        state.setdefault(int(i), {})[key] = value
    optimizer.load_state_dict({"state": state, "param_groups": optimizer.state_dict()["param_groups"]})
