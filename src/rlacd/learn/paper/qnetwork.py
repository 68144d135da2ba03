"""The Q network: values of all 150 planes of a component from its features."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise

import torch
from torch import Tensor, nn

HIDDEN = (1024, 512, 256, 128)
"""Widths of the paper's layers."""

PLANES = 150


class QNetwork(nn.Module):
    """A multilayer perceptron with ReLU.

    Parameters
    ----------
    inputs : int
        Number of features per component.
    unit : float
        Factor applied to the outputs. Rewards are weighted by 1000; without the factor the last layer needs the first
        hundred thousand steps just to reach that scale.
    hidden : sequence of int
    outputs : int
    """

    def __init__(self, inputs: int, unit: float = 1.0, hidden: Sequence[int] = HIDDEN, outputs: int = PLANES) -> None:
        super().__init__()
        self.unit = unit
        layers: list[nn.Module] = []
        for before, after in pairwise((inputs, *hidden)):
            layers += [nn.Linear(before, after), nn.ReLU()]
        self.layers = nn.Sequential(*layers, nn.Linear((inputs, *hidden)[-1], outputs))

    def forward(self, features: Tensor) -> Tensor:
        """Values Q(p, m) [B, 150] of features [B, inputs]."""
        values: Tensor = self.unit * self.layers(features)
        return values

    @torch.no_grad()
    def copy_from(self, other: QNetwork) -> None:
        """Copy the weights of another network of the same shape."""
        for own, theirs in zip(self.parameters(), other.parameters(), strict=True):
            own.copy_(theirs)
