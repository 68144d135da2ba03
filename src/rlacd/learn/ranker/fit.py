"""Fitting the network to labels: regression of log(parts), and a listwise loss among the planes of one state."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor

from rlacd.learn.files import unpacked
from rlacd.learn.ranker.network import RankerNetwork
from rlacd.policies.features import features

SHARPNESS = 8.0
"""Temperature of the distributions in the listwise loss: 10 % more parts halve a plane's weight (2 ** -1.1)."""

THINNED = 0.3
"""Fraction of batches with every second plane left out, since rollouts see components that way."""


@dataclass
class Dataset:
    """States with up to W labelled planes each.

    Attributes
    ----------
    planes : float32 [S, 6, 22, M]
    edges : float32 [S, 12, 22]
    component : float32 [S, 10]
    index : int64 [S, W]
        Indices of the labelled planes, those of concave edges last; padded with 0 up to W.
    parts : float32 [S, W]
        log(parts).
    known : bool [S, W]
        Whether there is a label.
    given_up : bool [S, W]
        Whether the rollout was given up, so that the true number may be larger.
    """

    planes: Tensor
    edges: Tensor
    component: Tensor
    index: Tensor
    parts: Tensor
    known: Tensor
    given_up: Tensor

    def __len__(self) -> int:
        return len(self.component)

    def take(self, rows: Tensor) -> Dataset:
        """Select states."""
        return Dataset(*(getattr(self, name)[rows] for name in self.__dataclass_fields__))

    def thinned(self) -> Dataset:
        """Leave out every second plane of each direction: the sweep of half as many planes."""
        planes = self.planes[..., 1::2]
        per_axis, fewer = self.planes.shape[3], planes.shape[3]
        total, total_fewer = (self.planes.shape[1] * m for m in (per_axis, fewer))
        direction, j = self.index // per_axis, self.index % per_axis
        of_edge = self.index >= total
        kept = (j % 2 == 1) | of_edge
        index = torch.where(of_edge, self.index - total + total_fewer, direction * fewer + j // 2)
        index = torch.where(kept, index, 0)
        known = self.known & kept
        thinned = Dataset(planes, self.edges, self.component, index, self.parts, known, self.given_up)
        return thinned.take(known.any(1).nonzero()[:, 0])

    @property
    def least(self) -> Tensor:
        """log(parts) of the best labelled plane of each state [S]."""
        return self.parts.masked_fill(~self.known, np.inf).amin(1)


def load_labels(paths: Sequence[Path]) -> Dataset:
    """Read shards of labels (see `rlacd.learn.ranker.label`); those without any are skipped."""
    shards = [arrays for path in paths if len(arrays := unpacked(path.read_bytes()))]
    inputs = [
        features(*(np.asarray(shard[k], np.float64) for k in ("grid", "edges", "whole", "scale"))) for shard in shards
    ]
    rows = []
    for shard in shards:
        for state in range(len(shard["scale"])):
            mine = shard["state"] == state
            rows.append((shard["plane"][mine], shard["parts"][mine], shard["given_up"][mine]))
    width = max(len(row[0]) for row in rows)

    def padded(column: int, dtype: type) -> Tensor:
        out: NDArray[np.generic] = np.zeros((len(rows), width), dtype)
        for i, row in enumerate(rows):
            out[i, : len(row[column])] = row[column]
        return torch.from_numpy(out)

    known = torch.arange(width)[None] < torch.tensor([len(row[0]) for row in rows])[:, None]
    planes, edges, component = (torch.from_numpy(np.concatenate(column)) for column in zip(*inputs, strict=True))
    parts = padded(1, np.float32).clamp(min=1).log()
    return Dataset(planes, edges, component, padded(0, np.int64), parts, known, padded(2, np.bool_))


def loss(network: RankerNetwork, batch: Dataset, listwise: float) -> Tensor:
    """Mean loss of a batch.

    A label that was given up is only a lower bound: predictions above it are not penalised.
    """
    q, value = _of_labels(network, batch)
    known = batch.known
    miss = q - batch.parts
    miss = torch.where(batch.given_up, miss.clamp(max=0), miss)
    regression = (_huber(miss) * known).sum() / known.sum()
    impossible = -1e9
    target = torch.softmax((-SHARPNESS * batch.parts).masked_fill(~known, impossible), dim=1)
    logits = torch.log_softmax((-SHARPNESS * q).masked_fill(~known, impossible), dim=1)
    ranking = -(target * logits.masked_fill(~known, 0)).sum(1).mean()
    return regression + _huber(value - batch.least).mean() + listwise * ranking


def _of_labels(network: RankerNetwork, batch: Dataset) -> tuple[Tensor, Tensor]:
    """Predictions for the labelled planes [S, W], and values [S]."""
    q, q_edges, value = network(batch.planes, batch.edges, batch.component)
    return torch.cat([q, q_edges], dim=1).gather(1, batch.index), value


def _huber(miss: Tensor) -> Tensor:
    return torch.nn.functional.smooth_l1_loss(miss, torch.zeros_like(miss), reduction="none", beta=0.3)


def fit(
    data: Dataset,
    *,
    seed: int,
    epochs: int,
    held_out: Dataset | None = None,
    batch: int = 256,
    rate: float = 2e-3,
    width: int = 32,
    listwise: float = 0.3,
    log: Callable[[dict[str, float]], None] = lambda _: None,
) -> RankerNetwork:
    """Fit a new network; the same data and seed give the same weights."""
    torch.manual_seed(seed)
    network = RankerNetwork(width)
    generator = torch.Generator().manual_seed(seed)
    steps = epochs * -(-len(data) // batch)
    optimizer = torch.optim.AdamW(network.parameters(), lr=rate, weight_decay=1e-3)
    schedule = torch.optim.lr_scheduler.OneCycleLR(optimizer, rate, total_steps=steps, pct_start=0.1)
    for epoch in range(epochs):
        network.train()
        total = 0.0
        for rows in torch.split(torch.randperm(len(data), generator=generator), batch):
            part = data.take(rows)
            if torch.rand((), generator=generator) < THINNED:
                part = part.thinned()
            if len(part) == 0:
                continue
            value = loss(network, part, listwise)
            optimizer.zero_grad()
            value.backward()  # type: ignore[no-untyped-call]
            torch.nn.utils.clip_grad_norm_(network.parameters(), 1.0)
            optimizer.step()
            schedule.step()
            total += float(value.detach()) * len(rows)
        curve = {"epoch": epoch + 1, "loss": total / len(data)}
        if held_out is not None:
            curve |= judge(network, held_out, listwise)
        log(curve)
    return network.eval()


@torch.no_grad()
def judge(network: RankerNetwork, data: Dataset, listwise: float) -> dict[str, float]:
    """Loss on held-out labels, and the regret of network and policy against the best labelled plane."""
    network.eval()
    total, regret, policy = 0.0, 0.0, 0.0
    for rows in torch.split(torch.arange(len(data)), 1024):
        part = data.take(rows)
        total += float(loss(network, part, listwise)) * len(rows)
        q, _ = _of_labels(network, part)
        pick = q.masked_fill(~part.known, np.inf).argmin(1, keepdim=True)
        regret += float((part.parts.gather(1, pick)[:, 0] - part.least).sum())
        policy += float((part.parts[:, 0] - part.least).sum())
    n = len(data)
    return {"held_out_loss": total / n, "held_out_regret": regret / n, "policy_regret": policy / n}
