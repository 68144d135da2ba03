"""The Q network and its loss: values of a component's 150 planes from features (paper, 3.3, 3.5, 4.1)."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from itertools import pairwise
from pathlib import Path
from typing import Any

import torch
from torch import Tensor, nn

from rlacd.errors import OptionError
from rlacd.learn.encoders import Encoder, make_encoder
from rlacd.learn.options import TrainOptions
from rlacd.policies.network import KIND, Network, QPolicy, load_network

HIDDEN = (1024, 512, 256, 128)
"""Widths of the paper's layers."""

SHARED = (128, 128)
"""Widths for a network that values planes one by one: 22,000 weights."""


class QNetwork(nn.Module):
    """One or two multilayer perceptrons with ReLU; the lesser of two values is the value (clipped double Q-learning).

    Parameters
    ----------
    inputs, outputs : int
        Features, and values that they give: 1 where each plane has features of its own, and all share the network.
    count : int
    """

    def __init__(self, inputs: int, outputs: int, count: int = 1) -> None:
        super().__init__()
        hidden = SHARED if outputs == 1 else HIDDEN
        self.each = nn.ModuleList(multilayer((inputs, *hidden, outputs)) for _ in range(count))

    def forward(self, features: Tensor) -> Tensor:
        """Each network's Q(p, m) [N, B, 150] of features [B, inputs] or [B, 150, inputs]; [N, B] of one plane's."""
        return torch.stack([one(features).squeeze(-1) for one in self.each])

    def plain(self, about: Mapping[str, Any]) -> Network:
        """Copy the first network for a file (`rlacd.policies.network`)."""
        linear = [layer for layer in self.each[0].modules() if isinstance(layer, nn.Linear)]
        return Network([(x.weight.detach().cpu().numpy(), x.bias.detach().cpu().numpy()) for x in linear], about)


def multilayer(widths: Sequence[int]) -> nn.Sequential:
    """Linear layers with ReLU between them."""
    layers: list[nn.Module] = []
    for before, after in pairwise(widths):
        layers += [nn.Linear(before, after), nn.ReLU()]
    return nn.Sequential(*layers[:-1])


def soft_value(q: Tensor, mask: Tensor, temperature: float) -> Tensor:
    """V [B] = T log sum_p exp(Q(p) / T) over the planes in `mask` [B, A]; T = 0 gives the maximum (eq. 7).

    Every row needs a valid plane.
    """
    q = q.masked_fill(~mask, -torch.inf)
    if temperature == 0:
        return q.amax(dim=1)
    return temperature * torch.logsumexp(q / temperature, dim=1)


def dual_state_target(reward: Tensor, values: Tensor, discounts: Tensor, owner: Tensor) -> Tensor:
    """Right-hand side of eq. 8 [B]: each reward, plus the discounted values of the unfinished children of its cut.

    Parameters
    ----------
    reward : float32 [B]
    values, discounts : float32 [C]
        Of all unfinished children in the batch. Finished ones have value 0 and are not listed.
    owner : int64 [C]
        The transition of each child.
    """
    return reward.index_add(0, owner, discounts * values)


def bellman_loss(q: Tensor, planes: Tensor, target: Tensor, huber: float = 0.0) -> Tensor:
    """Half the mean squared error of Q(p, m): of q [N, B, A] of N networks, those of the planes taken, int64 [B].

    A network shared by the planes has seen those only: q [N, B]. Beyond an error of `huber`, if any, it is linear.
    """
    taken = q if q.dim() == 2 else q.gather(2, planes.expand(len(q), -1)[..., None])[..., 0]
    error = (taken - target).abs()
    square = 0.5 * error.square()
    return (torch.where(error < huber, square, huber * (error - huber / 2)) if huber else square).mean(dim=1).sum()


def policy_of(network: QNetwork | Network, encoder: Encoder, **deployment: int) -> QPolicy:
    """Make a policy of a network; `deployment` is `QPolicy`'s shortlist and concave_edges."""
    fixed = network if isinstance(network, Network) else network.plain({"threshold": 1.0})
    return QPolicy(lambda component: fixed(encoder.describe(component)).reshape(-1), **deployment)


def load_policy(run: Path, **deployment: int) -> QPolicy:
    """Get the best network of a run as a policy, whatever its encoder; `deployment` as in `policy_of`."""
    if not (run / "options.json").is_file():
        raise OptionError(f"{run} holds no run.")
    options = TrainOptions(**json.loads((run / "options.json").read_text(encoding="utf-8")))
    encoder = make_encoder(options)
    return policy_of(load_network(str(run / "policy.npz"), KIND, encoder.dim, encoder.outputs), encoder, **deployment)
