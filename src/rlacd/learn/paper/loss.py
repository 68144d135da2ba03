"""The dual-state Bellman loss: a cut leads to two successor states, and the values of both are added.

Values are additive over components, so the target of Q(p, m) is the reward plus the discounted values of both sides of
the cut (eq. 8): r + gamma_l V(m_l) + gamma_r V(m_r). The unfinished connected pieces of a side stand for it. Soft
Q-learning (Haarnoja et al., "Reinforcement Learning with Deep Energy-Based Policies", 2017) makes V a soft maximum.
"""

from __future__ import annotations

import torch
from torch import Tensor


def soft_value(q: Tensor, mask: Tensor, temperature: float) -> Tensor:
    """V [B] = T log sum_p exp(Q(p) / T) over the planes in `mask` [B, A]; T = 0 gives the maximum (eq. 7).

    Every row needs a valid plane.
    """
    q = q.masked_fill(~mask, -torch.inf)
    if temperature == 0:
        return q.amax(dim=1)
    return temperature * torch.logsumexp(q / temperature, dim=1)


def boltzmann(q: Tensor, mask: Tensor, temperature: float) -> Tensor:
    """Probabilities [B, A] proportional to exp(Q(p) / T) over valid planes; T = 0 takes the first best plane."""
    q = q.masked_fill(~mask, -torch.inf)
    if temperature == 0:
        return torch.nn.functional.one_hot(q.argmax(dim=1), q.shape[1]).to(q.dtype)
    return torch.softmax(q / temperature, dim=1)


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


def bellman_loss(q: Tensor, planes: Tensor, target: Tensor, unit: float) -> Tensor:
    """Half the mean squared error of Q(p, m), in units of `unit`.

    Parameters
    ----------
    q : float32 [B, A]
    planes : int64 [B]
        The planes taken.
    target : float32 [B]

    Returns
    -------
    float32 scalar
    """
    taken = q.gather(1, planes[:, None])[:, 0]
    return 0.5 * ((taken - target) / unit).square().mean()


def cost_loss(values: Tensor, target: Tensor) -> Tensor:
    """Half the mean squared error of the logarithm of negative values [B]: the same for 3 cuts of 2 as for 30 of 20."""
    return 0.5 * (values / target).log().square().mean()
