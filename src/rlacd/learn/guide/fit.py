"""Fitting the network to labels: regression of log(parts), and a listwise loss among the planes of one state."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor

from rlacd.learn.guide.files import load_arrays
from rlacd.learn.guide.network import GuideNetwork
from rlacd.policies.features import features


@dataclass
class Dataset:
    """States with up to W labelled planes each.

    Attributes
    ----------
    planes : float32 [S, K, 22, M]
    component : float32 [S, 10]
    index : int64 [S, W]
        Numbers of the labelled planes; 0 where there are fewer than W.
    parts : float32 [S, W]
        log(parts).
    known : bool [S, W]
        Whether there is a label.
    given_up : bool [S, W]
        The true number may be larger.
    """

    planes: Tensor
    component: Tensor
    index: Tensor
    parts: Tensor
    known: Tensor
    given_up: Tensor

    def __len__(self) -> int:
        return len(self.component)

    def take(self, rows: Tensor) -> Dataset:
        """Pick states."""
        return Dataset(*(getattr(self, name)[rows] for name in self.__dataclass_fields__))

    def thinned(self) -> Dataset:
        """Leave out every second plane of each direction: the sweep of half as many planes."""
        per_axis = self.planes.shape[3]
        direction, j = self.index // per_axis, self.index % per_axis
        kept = j % 2 == 1
        index = torch.where(kept, direction * (per_axis // 2) + j // 2, 0)
        known = self.known & kept
        some = known.any(1)
        return Dataset(self.planes[..., 1::2], self.component, index, self.parts, known, self.given_up).take(
            some.nonzero()[:, 0]
        )


def load_labels(paths: Sequence[Path]) -> Dataset:
    """Read shards of labels (see `rlacd.learn.guide.label`); those without any are skipped."""
    shards = [arrays for path in paths if len(arrays := load_arrays(path))]
    planes, component, rows = [], [], []
    for shard in shards:
        p, c = features(*(np.asarray(shard[k], np.float64) for k in ("table", "whole", "scale")))
        planes.append(p)
        component.append(c)
        for state in range(len(c)):
            mine = shard["state"] == state
            rows.append((shard["plane"][mine], shard["parts"][mine], shard["given_up"][mine]))
    width = max(len(r[0]) for r in rows)

    def padded(column: int, dtype: type) -> Tensor:
        out: NDArray[np.generic] = np.zeros((len(rows), width), dtype)
        for i, r in enumerate(rows):
            out[i, : len(r[column])] = r[column]
        return torch.from_numpy(out)

    known = torch.arange(width)[None] < torch.tensor([len(r[0]) for r in rows])[:, None]
    return Dataset(
        torch.from_numpy(np.concatenate(planes)),
        torch.from_numpy(np.concatenate(component)),
        padded(0, np.int64),
        padded(1, np.float32).clamp(min=1).log(),
        known,
        padded(2, np.bool_),
    )


SHARPNESS = 8.0
"""Of the distributions that the listwise loss compares: 10 % more parts halve a plane's weight (2 ** -1.1)."""


def loss(network: GuideNetwork, batch: Dataset, listwise: float) -> Tensor:
    """Mean loss of a batch.

    A label that was given up is only a lower bound: predictions above it cost nothing.
    """
    q, value = network(batch.planes, batch.component)
    q = q.gather(1, batch.index)
    known = batch.known
    miss = q - batch.parts
    miss = torch.where(batch.given_up, miss.clamp(max=0), miss)
    regression = (_huber(miss) * known).sum() / known.sum()
    far = -1e9
    target = torch.softmax((-SHARPNESS * batch.parts).masked_fill(~known, far), dim=1)
    logits = torch.log_softmax((-SHARPNESS * q).masked_fill(~known, far), dim=1)
    ranking = -(target * logits.masked_fill(~known, 0)).sum(1).mean()
    least = batch.parts.masked_fill(~known, np.inf).amin(1)
    worth = _huber(value - least).mean()
    return regression + worth + listwise * ranking


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
) -> GuideNetwork:
    """Fit a new network; the same data and seed give the same weights."""
    torch.manual_seed(seed)
    network = GuideNetwork(width)
    generator = torch.Generator().manual_seed(seed)
    steps = epochs * -(-len(data) // batch)
    optimizer = torch.optim.AdamW(network.parameters(), lr=rate, weight_decay=1e-3)
    schedule = torch.optim.lr_scheduler.OneCycleLR(optimizer, rate, total_steps=steps, pct_start=0.1)
    for epoch in range(epochs):
        network.train()
        total = 0.0
        for rows in torch.split(torch.randperm(len(data), generator=generator), batch):
            part = data.take(rows)
            if torch.rand((), generator=generator) < 0.3:
                part = part.thinned()
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
def judge(network: GuideNetwork, data: Dataset, listwise: float) -> dict[str, float]:
    """Loss on held-out labels, and how much worse than the best labelled plane the network's and the policy's are."""
    network.eval()
    total, regret, policy = 0.0, 0.0, 0.0
    for rows in torch.split(torch.arange(len(data)), 1024):
        part = data.take(rows)
        total += float(loss(network, part, listwise)) * len(rows)
        q, _ = network(part.planes, part.component)
        pick = q.gather(1, part.index).masked_fill(~part.known, np.inf).argmin(1, keepdim=True)
        least = part.parts.masked_fill(~part.known, np.inf).amin(1)
        regret += float((part.parts.gather(1, pick)[:, 0] - least).sum())
        policy += float((part.parts[:, 0] - least).sum())
    n = len(data)
    return {"held_out_loss": total / n, "held_out_regret": regret / n, "policy_regret": policy / n}
