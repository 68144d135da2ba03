"""The published weights of I2P-MAE's point encoder."""

from __future__ import annotations

import pickle
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
import torch
from torch import Tensor

from rlacd.errors import WeightsError
from rlacd.policies.points import PointNetwork

PUBLISHED = "https://github.com/ZrrSkywalker/I2P-MAE"

WRAPPERS = ("base_model", "model", "state_dict")
"""Keys under which checkpoints keep the state; the published one uses the first."""

FIRST = "h_encoder.token_embed.0.first_conv.0.weight"
"""The first parameter of the encoder."""

HARMLESS = [np.dtype, np.dtypes.Float64DType, np.dtypes.Float32DType, np.dtypes.Int64DType]
"""Kinds of numpy numbers, used by checkpoints for their score; nothing else is allowed beyond torch's own list."""


def published_network(path: str | Path) -> PointNetwork:
    """Read the published checkpoint (see `load_weights`): tensors only, never arbitrary pickle."""
    network = PointNetwork()
    network.load_state_dict(load_weights(Path(path), network.state_dict()))
    return network


def load_weights(path: Path, expected: Mapping[str, Tensor]) -> dict[str, Tensor]:
    """Read the tensors that an encoder expects; keys may be nested under ``base_model`` and begin with ``module.``.

    Raises
    ------
    WeightsError
        The file is missing, damaged, or holds anything but named tensors; or the first tensor that is missing, has
        another shape, or is not finite.
    """
    if not path.is_file():
        raise WeightsError(f"there is no file {path}; give the pre-trained checkpoint that {PUBLISHED} links to.")
    try:
        state = {name.removeprefix("module."): value for name, value in _read(path).items()}
    except (pickle.UnpicklingError, RuntimeError, ValueError, EOFError, KeyError, OSError) as error:
        reason = (str(error).strip().splitlines() or [type(error).__name__])[0][:160].rstrip(".")
        said = f"{path} is damaged, cut off or not a file of weights ({reason}): {FIRST} and all after it are missing"
        raise WeightsError(f"{said}; fetch or make it again.") from error
    for name, wanted in expected.items():
        found = state.get(name)
        if found is None:
            raise WeightsError(f"{path} is not an I2P-MAE checkpoint: {name} is missing; give the published file.")
        if found.shape != wanted.shape:
            shapes = f"{list(found.shape)}, not {list(wanted.shape)}"
            raise WeightsError(f"{path} is not an I2P-MAE checkpoint of this size: {name} has shape {shapes}.")
        if not torch.isfinite(found).all():
            raise WeightsError(f"{path} is damaged: {name} holds values that are not finite.")
    return {name: state[name].to(wanted.dtype) for name, wanted in expected.items()}


def _read(path: Path) -> dict[str, Tensor]:
    scalar = np.float64(0).__reduce__()[0]
    harmless: list[Any] = [*HARMLESS, *((scalar, f"numpy.{core}.multiarray.scalar") for core in ("core", "_core"))]
    with torch.serialization.safe_globals(harmless):
        held = torch.load(path, map_location="cpu", weights_only=True)
    for wrapper in WRAPPERS:
        if isinstance(held, dict) and isinstance(held.get(wrapper), dict):
            held = held[wrapper]
    if not isinstance(held, dict):
        raise ValueError(f"it holds a {type(held).__name__}")
    return {str(name): value for name, value in held.items() if isinstance(value, Tensor)}
