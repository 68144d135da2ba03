"""Grouping of points in plain torch: farthest-point sampling, nearest neighbours, gathering by index.

Squared distances are written as explicit products and sums in a fixed order. A library's reduction may use another, and
one different bit makes farthest-point sampling pick another point, after which all later ones differ. Written this way,
CPU and GPU choose the same points.
"""

from __future__ import annotations

import torch
from torch import Tensor


def farthest_points(points: Tensor, count: int) -> Tensor:
    """Farthest-point sampling of points [B, N, 3]: the first, then repeatedly the one farthest from those chosen.

    Returns their indices, int64 [B, count]; ties go to the first point.
    """
    axes = points.permute(2, 0, 1).contiguous()  # [3, B, N]
    last = torch.zeros(1, points.shape[0], 1, dtype=torch.long, device=points.device)
    chosen = last.new_zeros(points.shape[0], count)
    nearest = torch.full_like(axes[0], torch.inf)
    for i in range(1, count):
        nearest = torch.minimum(nearest, _sum_of_squares(axes - axes.gather(2, last.expand(3, -1, 1))))
        torch.argmax(nearest, dim=1, out=chosen[:, i])
        last = chosen[None, :, i : i + 1]
    return chosen


def nearest_points(points: Tensor, centers: Tensor, count: int) -> Tensor:
    """Get the indices [B, G, count] of the points [B, N, 3] nearest to each centre [B, G, 3], in any order."""
    gaps = centers.transpose(1, 2)[:, :, :, None] - points.transpose(1, 2)[:, :, None, :]
    return torch.topk(_sum_of_squares(gaps.transpose(0, 1)), count, dim=-1, largest=False, sorted=False).indices


def gather(values: Tensor, index: Tensor) -> Tensor:
    """Get ``values[b, index[b, ...]]``, [B, ..., C], of values [B, N, C] by an index [B, ...] of any shape."""
    flat = index.flatten(1)[:, :, None].expand(-1, -1, values.shape[-1])
    return values.gather(1, flat).reshape(*index.shape, values.shape[-1])


def _sum_of_squares(gaps: Tensor) -> Tensor:
    """x^2 + y^2 + z^2 of gaps [3, ...]."""
    squares = gaps * gaps
    return (squares[0] + squares[1]) + squares[2]
