"""Clouds, weights and trained networks of the I2P-MAE encoder, small enough for tests."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import torch

from rlacd.learn.encoders.i2p_mae import I2PMAEEncoder, Sizes

TINY = Sizes((32, 16, 8), (8, 4, 4), (12, 24, 48), depth=1, heads=2, embedding=16)


def clouds(count: int, points: int = 128, seed: int = 0) -> torch.Tensor:
    """Clouds [count, points, 3] in the unit ball, each of another shape."""
    rng = np.random.default_rng(seed)
    found = rng.standard_normal((count, points, 3)) * rng.uniform(0.2, 1, (count, 1, 3))
    found /= np.linalg.norm(found, axis=2).max(axis=1)[:, None, None]
    return torch.from_numpy(found.astype(np.float32))


def tiny_encoder(seed: int = 0) -> I2PMAEEncoder:
    """An encoder of the least size whose batch norms are no identities."""
    torch.manual_seed(seed)
    encoder = I2PMAEEncoder(TINY)
    for name, value in encoder.state_dict().items():
        if name.endswith("running_var"):
            value.uniform_(0.5, 1.5)
        elif name.endswith("running_mean"):
            value.normal_(0, 0.1)
    return encoder


def write_tiny_weights(path: Path, seed: int = 0) -> Path:
    """Its weights as a file."""
    torch.save(tiny_encoder(seed).state_dict(), path)
    return path
