"""The plane ranker's network: from the features of a sweep to the logarithm of the final number of parts per plane."""

from __future__ import annotations

from collections.abc import Sequence

import torch
from torch import Tensor, nn

from rlacd.policies.features import COMPONENT_FEATURES, MIRRORED, PLANE_FEATURES


class RankerNetwork(nn.Module):
    """Shared dilated convolutions along every direction, pooled over planes and directions.

    Reversing a direction (planes in reverse order, *below* and *above* exchanged) and permuting the coordinate axes or
    the principal axes permute the outputs likewise, by construction.

    Parameters
    ----------
    width : int
        Channels.
    """

    def __init__(self, width: int = 32) -> None:
        super().__init__()
        self.width = width
        self._mirrored = list(MIRRORED)
        self.enter = nn.Conv1d(PLANE_FEATURES + 1, width, 3, padding=1)
        self.along = nn.ModuleList(nn.Conv1d(width, width, 3, padding=d, dilation=d) for d in (1, 2, 4, 8))
        self.whole = nn.Sequential(
            nn.Linear(4 * width + COMPONENT_FEATURES, 2 * width), nn.ReLU(), nn.Linear(2 * width, 2 * width), nn.ReLU()
        )
        self.direction = nn.Linear(2 * width, width)
        self.context = nn.Linear(2 * width, width)
        self.plane = nn.Linear(width, width)
        self.judge = nn.Sequential(nn.ReLU(), nn.Linear(width, width), nn.ReLU(), nn.Linear(width, 1))
        self.value = nn.Linear(2 * width, 1)

    def forward(self, planes: Tensor, edges: Tensor, component: Tensor) -> tuple[Tensor, Tensor, Tensor]:
        """Predict log(final parts).

        Parameters
        ----------
        planes : Tensor [B, K, 22, M]
            K directions, the coordinate axes first, with M planes each.
        edges : Tensor [B, E, 22]
            Planes of concave edges, each its own direction.
        component : Tensor [B, 10]

        Returns
        -------
        q : Tensor [B, K * M]
            If the plane is taken.
        q_edges : Tensor [B, E]
        value : Tensor [B]
            If the best of the planes is taken.
        """
        is_axis = (torch.arange(planes.shape[1], device=planes.device) < 3).to(planes.dtype)
        h, along = self._along(planes, is_axis)
        whole = self.whole(torch.cat([along.mean(1), along.amax(1), component], dim=1))  # [B, 2W]
        value = self.value(whole)[:, 0]
        q = self._judge(h, along, whole)
        is_edge = torch.full_like(edges[0, :, 0], -1.0)
        q_edges = self._judge(*self._along(edges.unsqueeze(3), is_edge), whole)
        return value[:, None] + q, value[:, None] + q_edges, value

    def _along(self, planes: Tensor, kind: Tensor) -> tuple[Tensor, Tensor]:
        """Channels of planes [B, K, W, M], and of directions [B, K, 2W]."""
        b, k, f, m = planes.shape
        kinds = kind.reshape(1, k, 1, 1).expand(b, k, 1, m)
        flat = torch.cat([planes, kinds], dim=2).reshape(b * k, f + 1, m)
        back = torch.cat([planes[:, :, self._mirrored].flip(3), kinds], dim=2).reshape(b * k, f + 1, m)
        h = (self._trunk(flat) + self._trunk(back).flip(2)).reshape(b, k, self.width, m)
        return h, torch.cat([h.mean(3), h.amax(3)], dim=2)

    def _judge(self, h: Tensor, along: Tensor, whole: Tensor) -> Tensor:
        mixed = self.plane(h.transpose(2, 3)) + self.direction(along)[:, :, None] + self.context(whole)[:, None, None]
        q: Tensor = self.judge(mixed)
        return q.flatten(1)

    def _trunk(self, x: Tensor) -> Tensor:
        h = torch.relu(self.enter(x))
        for layer in self.along:
            h = h + torch.relu(layer(h))
        return h


class Ensemble(nn.Module):
    """The mean of several networks, which averages out noise of labels and training."""

    def __init__(self, members: Sequence[RankerNetwork]) -> None:
        super().__init__()
        self.members = nn.ModuleList(members)
        self.width = members[0].width

    def forward(self, planes: Tensor, edges: Tensor, component: Tensor) -> tuple[Tensor, Tensor, Tensor]:
        """Predict the mean of the members; shapes as in `RankerNetwork.forward`."""
        outputs = [member(planes, edges, component) for member in self.members]
        q, q_edges, value = (torch.stack(column).mean(0) for column in zip(*outputs, strict=True))
        return q, q_edges, value
