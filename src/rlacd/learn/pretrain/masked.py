"""Masked point reconstruction: the 3-D half of I2P-MAE, in which the encoder skips everything hidden.

Most groups of the coarsest scale are hidden, and with them those of the finer scales that no seen group has as a
member. The encoder processes the rest. A light decoder then predicts, for each hidden group of the scale before the
last, the positions of its members around its centre; the loss is the Chamfer distance to the true ones. Its unit is the
mean squared distance of a cloud's members from their centres, so predicting all at the centre costs 2. I2P-MAE's other
half, which uses 2-D image networks to choose what is hidden and to add targets, is not implemented.

Source: Zhang et al., "Point-M2AE", NeurIPS 2022, and "I2P-MAE", CVPR 2023.
"""

from __future__ import annotations

import torch
from torch import Tensor, nn

from rlacd.learn.encoders.i2p_mae import HierarchicalEncoder, I2PMAEEncoder, Scale, Sizes, seen_below
from rlacd.learn.encoders.point_groups import gather, nearest_points
from rlacd.learn.encoders.transformer import Blocks, position_embedding

INTERPOLATED = 3
"""Coarse tokens from which a finer one is interpolated."""


class MaskedAutoencoder(nn.Module):
    """Encoder and decoder; only `encoder` is kept after pretraining.

    Parameters
    ----------
    sizes : Sizes
    """

    def __init__(self, sizes: Sizes) -> None:
        super().__init__()
        self.encoder = I2PMAEEncoder(sizes).requires_grad_(True)
        coarse, fine = sizes.widths[-1], sizes.widths[-2]
        self.hidden_coarse = nn.Parameter(0.02 * torch.randn(coarse))
        self.hidden_fine = nn.Parameter(0.02 * torch.randn(fine))
        self.coarse_positions = position_embedding(coarse)
        self.coarse_blocks = Blocks(coarse, sizes.heads, 1)
        self.down = nn.Linear(coarse, fine)
        self.fine_positions = position_embedding(fine)
        self.fine_blocks = Blocks(fine, sizes.heads, 1)
        self.norm = nn.LayerNorm(fine)
        self.members = nn.Linear(fine, 3 * sizes.neighbors[-2])

    def forward(self, clouds: Tensor, chances: Tensor, hidden: float) -> Tensor:
        """Get the mean loss of clouds [B, N, 3].

        Parameters
        ----------
        clouds : float32 [B, N, 3]
        chances : float32 [B, G]
            A random number per group of the coarsest scale; the groups with the greatest are hidden.
        hidden : float
            Fraction of groups to hide.
        """
        pyramid = self.encoder.h_encoder
        scales = pyramid.pyramid(clouds)
        seen = seen_below(scales, seen_groups(chances, hidden))
        tokens = encode_seen(pyramid, scales, seen)
        unseen = seen[-2] == 0
        found = self.members(self._decode(scales, seen, tokens)[unseen]).unflatten(-1, (-1, 3))
        # In the clouds' own unit members lie so close together that training gets stuck at "all at the centre".
        true = scales[-2].offsets
        unit = true.square().sum(-1).mean(dim=(1, 2)).sqrt()
        return chamfer(found, (true / unit[:, None, None, None])[unseen])

    def _decode(self, scales: list[Scale], seen: list[Tensor], tokens: list[Tensor]) -> Tensor:
        """Tokens [B, G, C] of the scale before the last, seen or not."""
        coarse, fine = scales[-1].centers, scales[-2].centers
        x = self.coarse_blocks(_placed(tokens[-1], seen[-1], self.hidden_coarse), self.coarse_positions(coarse))
        finer = interpolated(self.down(x), coarse, fine) + _placed(tokens[-2], seen[-2], self.hidden_fine)
        out: Tensor = self.norm(self.fine_blocks(finer, self.fine_positions(fine)))
        return out


def seen_groups(chances: Tensor, hidden: float) -> Tensor:
    """Which groups are seen, 1 or 0 [B, G]: the same number in every cloud, with at least one seen and one hidden."""
    groups = chances.shape[1]
    count = min(max(round(groups * (1 - hidden)), 1), groups - 1)
    return torch.zeros_like(chances).scatter(1, chances.argsort(dim=1, stable=True)[:, :count], 1.0)


def encode_seen(encoder: HierarchicalEncoder, scales: list[Scale], seen: list[Tensor]) -> list[Tensor]:
    """Encode only the seen groups.

    Returns
    -------
    list of float32 [S, C]
        Tokens of the seen groups per scale, in the order of ``seen == 1``, after the scale's norm.
    """
    normed = []
    below: Tensor | None = None
    for i, (scale, visible) in enumerate(zip(scales, (s > 0 for s in seen), strict=True)):
        cloud = visible.nonzero()[:, 0]
        members = scale.members[visible]
        embedded = encoder.token_embed[i](scale.offsets[visible] if below is None else below[cloud[:, None], members])
        # Clouds differ in their number of seen groups at finer scales: these are packed to the front of equal rows.
        longest = int(visible.sum(dim=1).max())
        slots = (~visible).int().argsort(dim=1, stable=True)[:, :longest]
        present = visible.gather(1, slots)
        packed = embedded.new_zeros(*present.shape, embedded.shape[-1])
        packed[present] = embedded
        positions = encoder.encoder_pos_embeds[i](gather(scale.centers, slots))
        tokens = encoder.encoder_blocks[i](packed, positions, present[:, None, None])[present]
        below = tokens.new_zeros(*visible.shape, tokens.shape[-1])
        below[visible] = tokens
        normed.append(encoder.encoder_norms[i](tokens))
    return normed


def interpolated(tokens: Tensor, at: Tensor, to: Tensor) -> Tensor:
    """Interpolate tokens [B, G, C] from centres `at` [B, G, 3] to others [B, F, 3], weighted by proximity."""
    nearest = nearest_points(at, to, INTERPOLATED)
    weight = 1 / ((gather(at, nearest) - to[:, :, None]).square().sum(-1, keepdim=True) + 1e-8)
    return (gather(tokens, nearest) * (weight / weight.sum(dim=2, keepdim=True))).sum(dim=2)


def chamfer(found: Tensor, true: Tensor) -> Tensor:
    """Mean squared distance of points [M, K, 3] to the nearest true one, plus the same in reverse."""
    squares = (found[:, :, None] - true[:, None]).square().sum(-1)
    return squares.amin(dim=2).mean() + squares.amin(dim=1).mean()


def _placed(tokens: Tensor, seen: Tensor, hidden: Tensor) -> Tensor:
    """Tokens [B, G, C]: those of seen groups in place, `hidden` [C] elsewhere."""
    return hidden.expand(*seen.shape, -1).masked_scatter(seen[:, :, None] > 0, tokens)
