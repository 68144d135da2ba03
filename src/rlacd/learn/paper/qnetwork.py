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
        Features a component.
    unit : float
        What the outputs are multiplied by. Rewards weigh 1000; a network whose last layer has to grow to that spends
        its first hundred thousand steps on it.
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
        """Take over the weights of another network of the same shape."""
        for own, theirs in zip(self.parameters(), other.parameters(), strict=True):
            own.copy_(theirs)
