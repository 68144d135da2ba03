"""I2P-MAE's point encoder, the paper's F(m): a pyramid of transformers over ever fewer, ever wider point groups.

Source: Zhang et al., "Learning 3D Representations from 2D Pre-trained Models via Image-to-Point Masked Autoencoders",
CVPR 2023; the pyramid is Point-M2AE's (NeurIPS 2022). Parameters are named as in the published checkpoint.
"""

from __future__ import annotations

import dataclasses
import hashlib
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path

import torch
import torch.nn.functional as F
from torch import Tensor, nn

from rlacd.errors import OptionError
from rlacd.learn.encoders.point_groups import farthest_points, gather, nearest_points
from rlacd.learn.encoders.transformer import Blocks, position_embedding
from rlacd.learn.encoders.weights_file import load_weights


@dataclass(frozen=True)
class Sizes:
    """The sizes of the pyramid, finest scale first; the defaults are those of the published checkpoint.

    Attributes
    ----------
    groups, neighbors, widths : tuple of int
        Per scale: number of point groups, members of each, and channels of its token.
    depth, heads : int
        Transformer blocks per scale, and attention heads of each.
    embedding : int
        Channels of a point within its group, before the group is pooled into a token.
    """

    groups: tuple[int, ...] = (512, 256, 64)
    neighbors: tuple[int, ...] = (16, 8, 8)
    widths: tuple[int, ...] = (96, 192, 384)
    depth: int = 5
    heads: int = 6
    embedding: int = 256


class GroupEmbedding(nn.Module):
    """A shared MLP over the members of a group that concatenates the group's maximum to each, with a final maximum."""

    def __init__(self, inputs: int, first: int, inner: int, second: int, outputs: int) -> None:
        super().__init__()
        self.first_conv = _shared_mlp(inputs, first, inner)
        self.second_conv = _shared_mlp(2 * inner, second, outputs)

    def forward(self, members: Tensor) -> Tensor:
        """Tokens [M, C'] of groups [M, K, C]."""
        groups, size, _ = members.shape
        first, second = _matrix(self.first_conv[0]), _matrix(self.second_conv[0])
        inner = _rest(self.first_conv, F.linear(members.flatten(0, 1), *first)).reshape(groups, size, -1)
        # The second layer sees (group's maximum, member). It is linear, so the maximum's half is computed once per
        # group.
        of_group, of_member = second[0].chunk(2, dim=1)
        hidden = F.linear(inner, of_member) + F.linear(inner.amax(dim=1), of_group, second[1])[:, None]
        return _rest(self.second_conv, hidden.flatten(0, 1)).reshape(groups, size, -1).amax(dim=1)


@dataclass(frozen=True, eq=False)
class Scale:
    """The point groups of one scale.

    Attributes
    ----------
    centers : float32 [B, G, 3]
    members : int64 [B, G, K]
        Indices of the nearest centres of the previous scale (of points, for the first).
    offsets : float32 [B, G, K, 3]
        Positions relative to the centre.
    """

    centers: Tensor
    members: Tensor
    offsets: Tensor


def seen_below(scales: list[Scale], top: Tensor) -> list[Tensor]:
    """Tell for every scale which groups are seen, 1 or 0 [B, G], given those of the last scale.

    A group is seen if it is a member of a seen group of the next scale; the others are masked in attention. All groups
    of the last scale are seen, but occasionally a group of a finer scale belongs to no group: the published weights
    were never trained on it.
    """
    seen = [top]
    for below, above in pairwise(reversed(scales)):
        of_members = seen[0][:, :, None].expand(below.members.shape).flatten(1)
        hidden = top.new_zeros(above.centers.shape[:2])
        seen.insert(0, hidden.scatter_reduce(1, below.members.flatten(1), of_members, "amax"))
    return seen


class HierarchicalEncoder(nn.Module):
    """The pyramid; for its use see `I2PMAEEncoder.features`."""

    def __init__(self, sizes: Sizes) -> None:
        super().__init__()
        self.sizes = sizes
        inner = sizes.embedding
        embeddings = [GroupEmbedding(3, inner // 2, inner, 2 * inner, sizes.widths[0])]
        for before, width in pairwise(sizes.widths):
            embeddings.append(GroupEmbedding(before, before, before, width, width))
        self.token_embed = nn.ModuleList(embeddings)
        self.encoder_pos_embeds = nn.ModuleList(position_embedding(width) for width in sizes.widths)
        self.encoder_blocks = nn.ModuleList(Blocks(width, sizes.heads, sizes.depth) for width in sizes.widths)
        self.encoder_norms = nn.ModuleList(nn.LayerNorm(width) for width in sizes.widths)

    def pyramid(self, points: Tensor) -> list[Scale]:
        """Group points [B, N, 3]; each scale's centres are chosen among those of the previous one."""
        scales = []
        for count, size in zip(self.sizes.groups, self.sizes.neighbors, strict=True):
            centers = gather(points, farthest_points(points, count))
            members = nearest_points(points, centers, size)
            scales.append(Scale(centers, members, gather(points, members) - centers[:, :, None]))
            points = centers
        return scales

    def forward(self, points: Tensor) -> Tensor:
        """Tokens [B, G, C] of the last scale of points [B, N, 3]."""
        scales = self.pyramid(points)
        top = points.new_ones(scales[-1].centers.shape[:2])
        tokens: Tensor | None = None
        for i, (scale, seen) in enumerate(zip(scales, seen_below(scales, top), strict=True)):
            members = scale.offsets if tokens is None else gather(tokens, scale.members)
            batch, groups = members.shape[:2]
            embedded = self.token_embed[i](members.flatten(0, 1)).reshape(batch, groups, -1)
            positions = self.encoder_pos_embeds[i](scale.centers)
            tokens = self.encoder_blocks[i](embedded, positions, seen[:, None, None] > 0)
        normed: Tensor = self.encoder_norms[-1](tokens)
        return normed


class I2PMAEEncoder(nn.Module):
    """The frozen encoder: 384 features of a component and 384 of its hull.

    Parameters
    ----------
    sizes : Sizes, optional
        As published by default.
    """

    def __init__(self, sizes: Sizes | None = None) -> None:
        super().__init__()
        self.sizes = sizes = sizes or Sizes()
        self.dim = 2 * sizes.widths[-1]
        self.h_encoder = HierarchicalEncoder(sizes)
        self.eval().requires_grad_(False)

    @classmethod
    def from_checkpoint(cls, path: str | Path) -> I2PMAEEncoder:
        """Read the published checkpoint.

        Only tensors are read, never arbitrary pickle; anything else in the file is ignored.

        Raises
        ------
        WeightsError
            The file is missing, damaged, or for another encoder; the message names the first missing parameter.
        """
        encoder = cls()
        encoder.load_state_dict(load_weights(Path(path), encoder.state_dict()))
        return encoder

    def features(self, clouds: Tensor) -> Tensor:
        """Describe point clouds without normalising them: float32 [B, N, 3] to [B, 384]."""
        self.require_points(clouds.shape[1])
        tokens: Tensor = self.h_encoder(clouds)
        return tokens.amax(dim=1)

    def require_points(self, count: int) -> None:
        """Check that clouds of `count` points can be grouped.

        Raises
        ------
        OptionError
            `count` is too small.
        """
        if count < self.sizes.groups[0]:
            raise OptionError(f"{count} points; this encoder needs at least {self.sizes.groups[0]} (--points).")

    def encode(self, points: Tensor) -> Tensor:
        """Features [B, 768] of components by points [B, 2, N, 3] of their surface and their hull's, on the CPU.

        Component and hull are scaled together into the unit ball, as the published pretraining does. Each component is
        encoded alone, so that the others of a call do not affect its bits.
        """
        device = next(self.parameters()).device
        found = []
        for pair in points:
            radius = pair.square().sum(-1).amax().sqrt().clamp_min(1e-12)
            found.append(self.features((pair / radius).to(device)).reshape(self.dim).cpu())
        return torch.stack(found)

    def digest(self) -> str:
        """Identify sizes and weights, independent of the device and the file they came from."""
        found = hashlib.sha256(repr(dataclasses.astuple(self.sizes)).encode())
        for name, value in sorted(self.state_dict().items()):
            found.update(name.encode() + value.cpu().contiguous().numpy().tobytes())
        return found.hexdigest()


def _shared_mlp(inputs: int, inner: int, outputs: int) -> nn.Sequential:
    return nn.Sequential(nn.Conv1d(inputs, inner, 1), nn.BatchNorm1d(inner), nn.ReLU(), nn.Conv1d(inner, outputs, 1))


def _matrix(layer: nn.Module) -> tuple[Tensor, Tensor | None]:
    """Weight and bias of a width-one convolution as a matrix: much faster on rows than on sequences of K."""
    assert isinstance(layer, nn.Conv1d)
    return layer.weight[:, :, 0], layer.bias


def _rest(mlp: nn.Sequential, hidden: Tensor) -> Tensor:
    """Apply the layers of a shared MLP after the first."""
    return F.linear(F.relu(mlp[1](hidden), inplace=True), *_matrix(mlp[3]))
