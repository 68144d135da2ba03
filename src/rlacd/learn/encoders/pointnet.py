"""A point-cloud encoder that needs no weights file: random features of points, pooled."""

from __future__ import annotations

import torch
from torch import Tensor, nn


class PointNetEncoder(nn.Module):
    """A frozen PointNet with seeded random weights: the maximum and the mean of random features over the points.

    Source: Qi et al., "PointNet", CVPR 2017, for the architecture; as in extreme learning machines, weights stay
    random.
    """

    def __init__(self, width: int = 128, seed: int = 0) -> None:
        super().__init__()
        generator = torch.Generator().manual_seed(seed)
        self.first = nn.Linear(3, 32)
        self.second = nn.Linear(32, width)
        for layer in (self.first, self.second):
            with torch.no_grad():
                layer.weight.copy_(torch.randn(layer.weight.shape, generator=generator) / layer.in_features**0.5)
                layer.bias.copy_(torch.rand(layer.bias.shape, generator=generator) - 0.5)
        self.requires_grad_(False)
        self.dim = 4 * width

    def forward(self, points: Tensor, directions: Tensor) -> Tensor:
        """See `Encoder.encode`; the directions are ignored."""
        hidden = torch.relu(self.second(torch.relu(self.first(3 * points))))
        return torch.cat([hidden.amax(dim=2), hidden.mean(dim=2)], dim=-1).flatten(1)

    def encode(self, points: Tensor, directions: Tensor) -> Tensor:
        """See `Encoder.encode`."""
        features: Tensor = self(points, directions)
        return features
