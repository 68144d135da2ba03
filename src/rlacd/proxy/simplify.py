"""A proxy: a copy of a dense solid with few triangles, near enough for choosing cuts.

What a decomposition costs grows with the triangles, what it needs only with the shape. Noise costs parts too, and a
proxy averages it: its faces lie in the middle of those they replace (M. Garland and P. Heckbert, "Surface
Simplification Using Quadric Error Metrics", SIGGRAPH 1997). Nothing is promised about a proxy: `rlacd.proxy.model`
makes and checks every hull on the solid itself.

Where noisy walls of two bodies touch, their union is riddled with tunnels, sometimes thousands, which no simplification
removes. So the pieces that repair united are simplified one by one, and united again.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import NamedTuple, TypeAlias

import numpy as np

from rlacd import _native
from rlacd.criteria import Criterion
from rlacd.repair.union import CrossingsError, unite
from rlacd.solid.arrays import FloatArray, IntArray
from rlacd.solid.component import DENSE, Component
from rlacd.solid.distance import PLACES
from rlacd.solid.solid import Shape, mesh_of
from rlacd.solid.topology import point_bodies

NEAR = 0.1
"""A proxy deviates by at most this share of the threshold, but for `OFTEN`."""

OFTEN = 0.99
"""Share of the vertices looked at whose distance counts as the deviation: single spots may be worse."""

ANYWHERE = 0.6
"""No vertex looked at is farther from the proxy than this share of the threshold."""

STEP = 0.7
"""Ratio of the numbers of triangles of one proxy and the next. Planes are fitted to each anew: those of the original
are noisy, and tell nothing about points far from them."""

COARSEST = 12
"""Fewest triangles of a proxy or a piece of one, unless the original has fewer: those of a box."""

LOST_OF_SOLID, LOST_OF_PIECES = 0.02, 0.1
"""A proxy's volume may differ from the solid's by this share: thin walls would fold up sooner than they deviate. Pieces
may lose more: a sheet of even thickness has less volume once its noise, and so some of its area, is gone."""

WORTHWHILE = 0.5
"""A proxy has at most this share of the solid's triangles; also the step while it is larger than any looked at."""

MARGIN = 1.5
"""Parts of a proxy have to be tighter by this share of its deviation: their hulls still have to grow to the solid."""

Mesh: TypeAlias = tuple[FloatArray, IntArray]
"""Vertices float64 ``[V, 3]`` and faces int32 ``[F, 3]``, closed."""


@dataclass(frozen=True)
class Proxy:
    """A simpler copy of a solid.

    Attributes
    ----------
    component : Component
    deviation : float
        Distance of all but a few of the solid's vertices from the proxy's surface.
    """

    component: Component
    deviation: float

    def margin(self, goal: Criterion) -> float:
        """Share of what the goal allows by which parts of the proxy have to be tighter than those of the solid."""
        return MARGIN * self.deviation / goal.outward_deviation


class _Copy(NamedTuple):
    """A simpler copy of a mesh, and the distances of some of the mesh's vertices from it."""

    mesh: Mesh
    distances: FloatArray


def simplify(solid: Component, threshold: float, threads: int = 1, pieces: Sequence[Shape] = ()) -> Proxy | None:
    """Make the smallest proxy that is near enough for a threshold; None if none is worthwhile.

    Parameters
    ----------
    solid : Component
    threshold : float
        Largest concavity of a part.
    threads : int
    pieces : sequence of Manifold or (vertices, faces)
        Closed solids whose union, without its cavities, the solid is; not needed if it is only one.
    """
    copy = next(filter(None, _copies(solid, threshold, threads, pieces)), None)
    try:
        return copy and Proxy(Component(copy.mesh), float(np.quantile(copy.distances, OFTEN)))
    except ValueError:  # flat
        return None


def _copies(solid: Component, threshold: float, threads: int, pieces: Sequence[Shape]) -> Iterator[_Copy | None]:
    """Copies of a solid made in several ways, the best first; None for each way in which none is near enough."""
    mesh = solid.vertices, solid.faces
    if pieces:
        yield _smallest(mesh, threshold, threads, DENSE)
        yield _of_pieces(pieces, solid, threshold, threads)
    yield _smallest(mesh, threshold, threads)


def _of_pieces(pieces: Sequence[Shape], solid: Component, threshold: float, threads: int) -> _Copy | None:
    """The union of the smallest copies of a solid's pieces that are near enough."""
    meshes = [mesh_of(piece) for piece in pieces]
    size = sum(len(faces) for _, faces in meshes)
    copies = []
    for mesh in meshes:
        samples = PLACES * len(mesh[1]) // size
        copy = _smallest(mesh, threshold, threads, DENSE, samples, LOST_OF_PIECES)
        copies.append(copy or _Copy(mesh, np.zeros(1)))
    if sum(len(copy.mesh[1]) for copy in copies) > WORTHWHILE * size:
        return None
    try:
        union = mesh_of(unite([copy.mesh for copy in copies]))
    except CrossingsError:
        return None
    if len(union[1]) > WORTHWHILE * len(solid.faces) or not _is_alike(union, solid.volume, LOST_OF_PIECES):
        return None
    return _Copy(union, np.concatenate([copy.distances for copy in copies]))


def _smallest(
    mesh: Mesh,
    threshold: float,
    threads: int,
    largest: float = math.inf,
    samples: int = PLACES,
    lost: float = LOST_OF_SOLID,
) -> _Copy | None:
    """The smallest copy that is near enough; None if none with at most `largest` triangles is."""
    largest = min(largest, WORTHWHILE * len(mesh[1]))
    if largest < COARSEST:
        return None
    volume = _native.mesh_volume(*mesh)
    looked_at = mesh[0][_samples(mesh, samples)]
    best: _Copy | None = None
    copy = mesh
    while (count := math.floor((STEP if len(copy[1]) <= largest else WORTHWHILE) * len(copy[1]))) >= COARSEST:
        simplifier = _native.Simplifier(*copy)
        simplifier.reduce(count, threads)
        copy = simplifier.mesh()
        if len(copy[1]) <= largest:
            if not _is_alike(copy, volume, lost):
                break
            distances = _native.Surface(*copy).distance(looked_at, 1)
            if np.quantile(distances, OFTEN) > NEAR * threshold or distances.max() > ANYWHERE * threshold:
                break
            best = _Copy(copy, distances)
        if len(copy[1]) > count:  # hardly any edge can be collapsed any more
            break
    return best


def _samples(mesh: Mesh, samples: int) -> IntArray:
    """Indices of one vertex of each body and of some others, the same ones every time."""
    _, firsts = np.unique(point_bodies(*mesh), return_index=True)
    count = len(mesh[0])
    others = np.random.default_rng(0).choice(count, min(samples, count), replace=False)
    return np.concatenate([firsts, others]).astype(np.int32)


def _is_alike(copy: Mesh, volume: float, lost: float) -> bool:
    return bool(abs(_native.mesh_volume(*copy) - volume) <= lost * volume)
