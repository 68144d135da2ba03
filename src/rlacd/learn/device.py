"""Choice of the torch device."""

from __future__ import annotations

import torch

from rlacd.errors import OptionError


def pick_device(name: str) -> torch.device:
    """Get the device for ``cpu``, ``cuda`` or ``auto``: a GPU when there is one.

    Raises
    ------
    OptionError
        A GPU is requested and there is none.
    """
    if name == "cuda" and not torch.cuda.is_available():
        raise OptionError("device is 'cuda', but torch finds no GPU; use cpu, or install torch for CUDA.")
    if name == "auto":
        name = "cuda" if torch.cuda.is_available() else "cpu"
    return torch.device(name)
