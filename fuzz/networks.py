"""Small Q networks as files, written without training."""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType
from typing import Any

import numpy as np

from rlacd.policies.network import KIND, Network
from rlacd.policies.plane_features import FEATURES

ABOUT: Mapping[str, Any] = MappingProxyType({"kind": KIND, "threshold": 0.05})
"""What a sound network says of itself."""


def q_network(about: Mapping[str, Any] = ABOUT, inputs: int = FEATURES, outputs: int = 1) -> bytes:
    """A network whose values are a fixed random function of the features."""
    rng = np.random.default_rng(0)
    shapes = ((4, inputs), (outputs, 4))
    layers = [(rng.standard_normal(shape), rng.standard_normal(shape[0])) for shape in shapes]
    return Network(layers, {"threshold": 1.0, **about}).to_bytes()
