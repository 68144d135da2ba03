"""State encoders: from points of a component and of its hull to the features that the Q network sees.

An encoder is a torch module without state of its own in training: it is fixed (or frozen), the features of a component
are computed once and kept in the replay buffer, and the module is exported to ONNX in front of the Q network.
"""

from __future__ import annotations

from typing import Protocol, runtime_checkable

import numpy as np
import torch
from torch import Tensor, nn

from rlacd.errors import OptionError
from rlacd.learn.observe import Float32Array, Observation

SLABS = 26
"""Slabs between and beyond the 25 planes along each direction."""


@runtime_checkable
class Encoder(Protocol):
    """What the training asks of an encoder; a `torch.nn.Module` with a `dim` is one."""

    @property
    def dim(self) -> int:
        """Features a component."""

    def encode(self, points: Tensor, directions: Tensor) -> Tensor:
        """Describe components by points of their surface and their hull's.

        Parameters
        ----------
        points : float32 [B, 2, N, 3]
            In each component's own frame: bounding box centred, longest side 2.
        directions : float32 [B, 6, 3]
            The unit normals of the candidate planes. An encoder need not look at them.

        Returns
        -------
        float32 [B, dim]
        """


class ProfileEncoder(nn.Module):
    """How component and hull are spread along the candidate planes' own directions; nothing learned.

    Along each of the 6 directions the extent is divided into the 26 slabs that the 25 planes bound. Per slab: the share
    of the component's surface in it, the same of the hull's, and the root mean square distance of both from the middle
    of the component's box across the direction. A plane between two slabs that differ much is a promising cut; a slab
    where component and hull agree is convex there. This is the light default: features line up with the planes that
    the values are asked for, which an order-free set encoder first has to learn (docs/experiments.md compares).
    """

    dim = 6 * SLABS * 4

    def forward(self, points: Tensor, directions: Tensor) -> Tensor:
        """See `Encoder.encode`."""
        batch, surfaces, count, _ = points.shape
        heights = torch.einsum("bsnc,bdc->bsdn", points, directions)
        lower = heights.amin(dim=(1, 3), keepdim=True)
        extent = heights.amax(dim=(1, 3), keepdim=True) - lower
        slab = ((heights - lower) * (SLABS / extent.clamp_min(1e-12))).long().clamp(0, SLABS - 1)
        # |x|^2 - (n.x)^2 is the squared distance from the axis through the centre.
        across = (points.square().sum(-1)[:, :, None] - heights.square()).clamp_min(0)
        empty = heights.new_zeros(batch, surfaces, 6, SLABS)
        number = empty.scatter_add(3, slab, torch.ones_like(heights))
        spread = empty.scatter_add(3, slab, across)
        share = number * (SLABS / count)
        distance = (spread / number.clamp_min(1)).sqrt()
        return torch.stack([share, distance], dim=2).transpose(1, 3).reshape(batch, self.dim)

    def encode(self, points: Tensor, directions: Tensor) -> Tensor:
        """See `Encoder.encode`."""
        features: Tensor = self(points, directions)
        return features


class PointNetEncoder(nn.Module):
    """A frozen PointNet with seeded random weights: the largest and the mean of random features over the points.

    Source: Qi et al., "PointNet", CVPR 2017, for the architecture; extreme-learning style, the weights stay random.
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
        """See `Encoder.encode`; the directions are not looked at."""
        hidden = torch.relu(self.second(torch.relu(self.first(3 * points))))
        return torch.cat([hidden.amax(dim=2), hidden.mean(dim=2)], dim=-1).flatten(1)

    def encode(self, points: Tensor, directions: Tensor) -> Tensor:
        """See `Encoder.encode`."""
        features: Tensor = self(points, directions)
        return features


class ProfileWithoutHull(ProfileEncoder):
    """The same of the component's own points in place of its hull's: what the hull is worth (the paper's 4.5.2)."""

    def forward(self, points: Tensor, directions: Tensor) -> Tensor:
        """See `Encoder.encode`."""
        return super().forward(points[:, :1].expand_as(points), directions)


def make_encoder(name: str) -> ProfileEncoder | PointNetEncoder:
    """Build the encoder called `name`.

    Raises
    ------
    OptionError
        There is none of this name.
    """
    if name == "profile":
        return ProfileEncoder()
    if name == "profile-without-hull":
        return ProfileWithoutHull()
    if name == "pointnet":
        return PointNetEncoder()
    raise OptionError(f"encoder is {name!r}; it has to be profile, profile-without-hull or pointnet.")


def describe(encoder: Encoder, observations: list[Observation], scale_input: bool) -> Float32Array:
    """Features [B, dim (+ 3)] of components, as they are kept in replay: rounded to half precision."""
    points = torch.from_numpy(np.stack([o.points for o in observations]))
    directions = torch.from_numpy(np.stack([o.directions for o in observations]))
    with torch.inference_mode():
        features: Float32Array = encoder.encode(points, directions).numpy()
    if scale_input:
        features = np.concatenate([features, np.stack([o.scale for o in observations])], axis=1)
    return features.astype(np.float16).astype(np.float32)
