"""The light default: profiles of component and hull along the candidate planes' normals."""

from __future__ import annotations

import torch
from torch import Tensor, nn

SLABS = 26
"""Slabs that the 25 planes of each direction bound, including the outer two."""


class ProfileEncoder(nn.Module):
    """Profiles of component and hull along the candidate planes' normals; nothing is learned.

    Along each of the 6 directions the extent is divided into the 26 slabs that the 25 planes bound. Per slab: the share
    of the component's surface in it, the same of the hull's, and the root mean square distance of both from the axis
    through the centre of the component's box. A plane between two slabs that differ much is a promising cut; a slab
    where component and hull agree is convex. The features line up with the planes whose values are predicted, an
    alignment that an order-free set encoder first has to learn (research/learning.md compares them).
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


class ProfileWithoutHull(ProfileEncoder):
    """The same with the component's own points in place of its hull's: shows the hull's worth (the paper's 4.5.2)."""

    def forward(self, points: Tensor, directions: Tensor) -> Tensor:
        """See `Encoder.encode`."""
        return super().forward(points[:, :1].expand_as(points), directions)
