"""Encoders by their names on the command line."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from types import MappingProxyType

import torch

from rlacd.errors import OptionError
from rlacd.learn.encoders.i2p_mae import I2PMAEEncoder
from rlacd.learn.encoders.profile import ProfileEncoder, ProfileWithoutHull

AnyEncoder = ProfileEncoder | I2PMAEEncoder

I2P_MAE = "i2p-mae"

_LIGHT: Mapping[str, type[ProfileEncoder]] = MappingProxyType(
    {"profile": ProfileEncoder, "profile-without-hull": ProfileWithoutHull}
)

PUBLISHED = "https://github.com/ZrrSkywalker/I2P-MAE"


def make_encoder(name: str, weights: str | Path = "", device: torch.device | str = "cpu") -> AnyEncoder:
    """Build the encoder called `name`.

    Parameters
    ----------
    name : str
        ``profile``, ``profile-without-hull`` or ``i2p-mae``.
    weights : path
        For ``i2p-mae``: the published checkpoint.
    device : torch.device
        Device of ``i2p-mae``; the light encoders run where the points are.

    Raises
    ------
    OptionError
        The name is unknown, or the encoder lacks weights that it needs or is given weights that it cannot use.
    WeightsError
        The file of weights cannot be used.
    """
    if name == I2P_MAE:
        if not str(weights):
            raise OptionError(
                f"encoder {I2P_MAE} needs weights: give --encoder-weights FILE, the pre-trained checkpoint that "
                f"{PUBLISHED} links to, or use --encoder profile, which needs none."
            )
        return I2PMAEEncoder.from_checkpoint(weights).to(device)
    if name not in _LIGHT:
        raise OptionError(f"encoder is {name!r}; it has to be {', '.join(_LIGHT)} or {I2P_MAE}.")
    if str(weights):
        raise OptionError(f"encoder {name} takes no weights; leave --encoder-weights out, or use --encoder {I2P_MAE}.")
    return _LIGHT[name]()
