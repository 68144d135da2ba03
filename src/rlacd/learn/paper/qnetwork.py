"""The Q network: values of all 150 planes of a component from its features."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise

import torch
from torch import Tensor, nn

from rlacd.learn.paper.options import TrainOptions

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
    costs : bool
        The values are negative, and the layers' outputs are their logarithms.
    """

    def __init__(
        self,
        inputs: int,
        unit: float = 1.0,
        hidden: Sequence[int] = HIDDEN,
        outputs: int = PLANES,
        costs: bool = False,
    ) -> None:
        super().__init__()
        self.unit, self.outputs, self.costs = unit, outputs, costs
        layers: list[nn.Module] = []
        for before, after in pairwise((inputs, *hidden)):
            layers += [nn.Linear(before, after), nn.ReLU()]
        self.layers = nn.Sequential(*layers, nn.Linear((inputs, *hidden)[-1], outputs))

    def forward(self, features: Tensor) -> Tensor:
        """Values Q(p, m) [B, 150] of features [B, inputs]."""
        out: Tensor = self.layers(features)
        return -self.unit * out.exp() if self.costs else self.unit * out

    @classmethod
    def of(cls, inputs: int, options: TrainOptions) -> QNetwork:
        """Make the network of a training: values of planes, or the value of a component."""
        only_costs = options.lookahead > 0 and options.volume_reward == options.finish_reward == 0
        return cls(inputs, options.unit, outputs=1 if options.lookahead else PLANES, costs=only_costs)

    @torch.no_grad()
    def copy_from(self, other: QNetwork) -> None:
        """Copy the weights of another network of the same shape."""
        for own, theirs in zip(self.parameters(), other.parameters(), strict=True):
            own.copy_(theirs)
