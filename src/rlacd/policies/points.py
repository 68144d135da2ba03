"""The paper's F(m): a pyramid of transformers over ever fewer, ever wider groups of points (extra `train`).

Source: Zhang et al., "Learning 3D Representations from 2D Pre-trained Models via Image-to-Point Masked Autoencoders",
CVPR 2023 (I2P-MAE); the pyramid is Point-M2AE's (NeurIPS 2022). Parameters are named as in the published checkpoint.
"""

from __future__ import annotations

import dataclasses
import hashlib
from collections.abc import Mapping
from dataclasses import dataclass
from itertools import pairwise
from typing import Any

import numpy as np
import torch
import torch.nn.functional as F
from numpy.typing import NDArray
from torch import Tensor, nn

from rlacd import _native
from rlacd.errors import OptionError
from rlacd.policies.plane_features import PLANES
from rlacd.policies.point_groups import farthest_points, gather, nearest_points
from rlacd.solid.arrays import Float32Array
from rlacd.solid.component import Component

MOST = 4096
"""No size of a pyramid is larger."""


@dataclass(frozen=True)
class Sizes:
    """The sizes of the pyramid, finest scale first; the defaults are those of the published checkpoint.

    Per scale: number of point groups, members of each, and channels of its token; transformer blocks per scale and
    their attention heads; `embedding` is the channels of a point before its group is pooled into a token.

    Raises
    ------
    ValueError
        There is no such pyramid.
    """

    groups: tuple[int, ...] = (512, 256, 64)
    neighbors: tuple[int, ...] = (16, 8, 8)
    widths: tuple[int, ...] = (96, 192, 384)
    depth: int = 5
    heads: int = 6
    embedding: int = 256

    def __post_init__(self) -> None:
        scales = (self.groups, self.neighbors, self.widths)
        counts = [*self.groups, *self.neighbors, *self.widths, self.depth, self.heads, self.embedding]
        if not all(type(count) is int and 1 <= count <= MOST for count in counts) or {*map(len, scales)} != {3}:
            raise ValueError(f"sizes have to be whole numbers from 1 to {MOST}, of three scales")
        members = zip(self.neighbors, (self.groups[0], *self.groups), strict=False)
        if any(width % self.heads for width in self.widths) or any(size > held for size, held in members):
            raise ValueError("widths have to be multiples of heads, and groups smaller than what is grouped")


REDUCED = Sizes((128, 64, 16), (16, 8, 8), (48, 96, 192), depth=2, embedding=64), 512
"""Sizes and points that take under 20 ms a component; the published sizes with 2,048 points take 360."""


class Attention(nn.Module):
    """Multi-head self-attention without bias in the query, key and value projection."""

    def __init__(self, width: int, heads: int) -> None:
        super().__init__()
        self.heads = heads
        self.qkv = nn.Linear(width, 3 * width, bias=False)
        self.proj = nn.Linear(width, width)

    def forward(self, x: Tensor, mask: Tensor | None = None) -> Tensor:
        """Attend among tokens x [B, T, C]; `mask`, bool [B, 1, 1, T], is True where a token may be attended to."""
        q, k, v = self.qkv(x).unflatten(-1, (3, self.heads, -1)).permute(2, 0, 3, 1, 4).unbind(0)
        seen = F.scaled_dot_product_attention(q, k, v, attn_mask=mask)
        out: Tensor = self.proj(seen.transpose(1, 2).flatten(2))
        return out


class Mlp(nn.Module):
    """Two linear layers, four times as wide between them, with GELU."""

    def __init__(self, width: int) -> None:
        super().__init__()
        self.fc1, self.fc2 = nn.Linear(width, 4 * width), nn.Linear(4 * width, width)

    def forward(self, x: Tensor) -> Tensor:
        """[..., C] to [..., C]."""
        out: Tensor = self.fc2(F.gelu(self.fc1(x)))
        return out


class Block(nn.Module):
    """Attention and MLP, each after a layer norm and added to its input."""

    def __init__(self, width: int, heads: int) -> None:
        super().__init__()
        self.norm1 = nn.LayerNorm(width)
        self.attn = Attention(width, heads)
        self.norm2 = nn.LayerNorm(width)
        self.mlp = Mlp(width)

    def forward(self, x: Tensor, mask: Tensor | None = None) -> Tensor:
        """Tokens [B, T, C] to tokens; see `Attention` for the mask."""
        x = x + self.attn(self.norm1(x), mask)
        out: Tensor = x + self.mlp(self.norm2(x))
        return out


class Blocks(nn.Module):
    """A stack of blocks; positions are added before each."""

    def __init__(self, width: int, heads: int, depth: int) -> None:
        super().__init__()
        self.blocks = nn.ModuleList(Block(width, heads) for _ in range(depth))

    def forward(self, x: Tensor, positions: Tensor, mask: Tensor | None = None) -> Tensor:
        """Tokens x and their positions, both [B, T, C], to tokens."""
        for block in self.blocks:
            x = block(x + positions, mask)
        return x


def position_embedding(width: int) -> nn.Sequential:
    """Build the map from a position in space to the embedding added to the token there."""
    return nn.Sequential(nn.Linear(3, width), nn.GELU(), nn.Linear(width, width))


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

    `centers` float32 [B, G, 3]; `members` int64 [B, G, K], the nearest centres of the previous scale (points, for the
    first), and their `offsets` from the centre float32 [B, G, K, 3].
    """

    centers: Tensor
    members: Tensor
    offsets: Tensor


def seen_below(scales: list[Scale], top: Tensor) -> list[Tensor]:
    """Tell for every scale which groups are seen, 1 or 0 [B, G], given those of the last scale.

    A group is seen if it is a member of a seen group of the next scale; the others are masked in attention: the
    published weights were never trained on a group that belongs to no other.
    """
    seen = [top]
    for below, above in pairwise(reversed(scales)):
        of_members = seen[0][:, :, None].expand(below.members.shape).flatten(1)
        hidden = top.new_zeros(above.centers.shape[:2])
        seen.insert(0, hidden.scatter_reduce(1, below.members.flatten(1), of_members, "amax"))
    return seen


class HierarchicalEncoder(nn.Module):
    """The pyramid; for its use see `PointNetwork.features`."""

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
        farthest = gather(points, farthest_points(points, self.sizes.groups[0]))
        for count, size in zip(self.sizes.groups, self.sizes.neighbors, strict=True):
            centers = farthest[:, :count]  # of points in this order, those are the farthest again
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


class PointNetwork(nn.Module):
    """The pyramid, frozen, with its features: 384 of a component and 384 of its hull, with the published sizes."""

    def __init__(self, sizes: Sizes | None = None) -> None:
        super().__init__()
        self.sizes = sizes = sizes or Sizes()
        self.dim = 2 * sizes.widths[-1]
        self.h_encoder = HierarchicalEncoder(sizes)
        self.eval().requires_grad_(False)

    def features(self, clouds: Tensor) -> Tensor:
        """Describe point clouds without normalising them: float32 [B, N, 3] to [B, 384]."""
        tokens: Tensor = self.h_encoder(clouds)
        return tokens.amax(dim=1)

    def encode(self, points: Tensor) -> Tensor:
        """Features [768], on the CPU, of a component by points [2, N, 3] of its surface and its hull's.

        Both are scaled together into the unit ball, as the published pretraining does.
        """
        radius = points.square().sum(-1).amax().sqrt().clamp_min(1e-12)
        return self.features((points / radius).to(next(self.parameters()).device)).reshape(self.dim).cpu()

    def digest(self) -> str:
        """Identify sizes and weights, independent of the device and the file they came from."""
        found = hashlib.sha256(repr(dataclasses.astuple(self.sizes)).encode())
        for name, value in sorted(self.state_dict().items()):
            found.update(name.encode() + value.cpu().contiguous().numpy().tobytes())
        return found.hexdigest()


class PointEncoder:
    """What the paper's network sees (3.3): points on a component's surface and on its hull's; an `Encoder`.

    Raises
    ------
    OptionError
        There are fewer points than groups.
    """

    def __init__(self, network: PointNetwork, points: int = 2048) -> None:
        if points < network.sizes.groups[0]:
            raise OptionError(f"{points} points; this encoder needs at least {network.sizes.groups[0]}.")
        self.dim, self.outputs, self.digest = network.dim, PLANES, network.digest()
        self._network, self._points = network, points

    @classmethod
    def reduced(cls, seed: int) -> PointEncoder:
        """Get an encoder of `REDUCED` size whose weights are random."""
        with torch.random.fork_rng(devices=[]):
            torch.manual_seed(seed)
            return cls(PointNetwork(REDUCED[0]), REDUCED[1])

    @classmethod
    def stored(cls, about: Mapping[str, Any], weights: Mapping[str, NDArray[Any]]) -> PointEncoder:
        """Get the encoder of a file; one of many exceptions if it holds none."""
        sizes: dict[str, Any] = {
            name: tuple(size) if isinstance(size, list) else size for name, size in about["sizes"].items()
        }
        with torch.device("meta"):  # whatever the sizes, memory is taken by the weights alone
            network = PointNetwork(Sizes(**sizes))
        state = {name: torch.from_numpy(value.copy()) for name, value in weights.items()}
        network.load_state_dict(state, assign=True)
        encoder = cls(network.float().requires_grad_(False), min(int(about["points"]), 16 * MOST))
        if encoder.digest != about["digest"]:
            raise ValueError("its weights are others")
        return encoder

    def about(self) -> dict[str, Any]:
        """Describe it for a file, beside its `weights`."""
        sizes = dataclasses.asdict(self._network.sizes)
        return {"digest": self.digest, "points": self._points, "sizes": sizes}

    def weights(self) -> dict[str, NDArray[Any]]:
        """Get its weights by name."""
        return {name: value.cpu().numpy() for name, value in self._network.state_dict().items()}

    def describe(self, component: Component) -> Float32Array:
        """Features of a component [768], with the published sizes."""
        points = torch.from_numpy(surface_points(component, self._points))
        network = self._network.to("cuda" if torch.cuda.is_available() else "cpu")
        with torch.inference_mode():
            features: Float32Array = network.encode(points).numpy()
        return features


def surface_points(component: Component, count: int) -> Float32Array:
    """Points on the surfaces of a component and of its hull [2, count, 3]; box centred, longest side 2.

    The same component gives the same points.
    """
    lower, upper = component.box
    shapes = (component, component.hull)
    points = np.stack([_native.sample_surface(shape.vertices, shape.faces, count, 0)[0] for shape in shapes])
    seen: Float32Array = ((points - (lower + upper) / 2) / (float((upper - lower).max()) / 2)).astype(np.float32)
    return seen


def _shared_mlp(inputs: int, inner: int, outputs: int) -> nn.Sequential:
    return nn.Sequential(nn.Conv1d(inputs, inner, 1), nn.BatchNorm1d(inner), nn.ReLU(), nn.Conv1d(inner, outputs, 1))


def _matrix(layer: nn.Module) -> tuple[Tensor, Tensor | None]:
    """Weight and bias of a width-one convolution as a matrix: much faster on rows than on sequences of K."""
    assert isinstance(layer, nn.Conv1d)
    return layer.weight[:, :, 0], layer.bias


def _rest(mlp: nn.Sequential, hidden: Tensor) -> Tensor:
    """Apply the layers of a shared MLP after the first."""
    return F.linear(F.relu(mlp[1](hidden), inplace=True), *_matrix(mlp[3]))
