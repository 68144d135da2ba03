"""A proxy: a copy of a dense solid with few triangles, near enough for choosing cuts.

What a decomposition costs grows with the triangles, what it needs only with the shape. Noise costs parts too, and a
proxy averages it: its faces lie in the middle of those they replace (M. Garland and P. Heckbert, "Surface
Simplification Using Quadric Error Metrics", SIGGRAPH 1997). Nothing is promised about a proxy: `rlacd.proxy.lift` makes
and checks every hull on the solid itself.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from rlacd import _native
from rlacd.solid.arrays import FloatArray, IntArray
from rlacd.solid.component import Component

FEW = 10_000
"""Solids with fewer triangles are decomposed as they are: little time is to be gained, and a few parts to be lost."""

NEAR = 0.1
"""A proxy deviates by at most this share of the threshold, but for `OFTEN`."""

OFTEN = 0.99
"""Share of the vertices looked at whose distance counts as the deviation: single spots may be worse."""

ANYWHERE = 0.6
"""No vertex looked at is farther from the proxy than this share of the threshold."""

STEP = 0.7
"""Ratio of the numbers of triangles of one proxy and the next. Planes are fitted to each anew: those of the original
are noisy, and tell nothing about points far from them."""

COARSEST = 100
"""No proxy has fewer triangles."""

LOST = 0.02
"""A proxy's volume may differ from the solid's by this share: thin walls would fold up sooner than they deviate."""

WORTHWHILE = 0.5
"""A proxy has at most this share of the solid's triangles."""

LARGE_STEP = 0.5
"""The same while the proxy is larger than any that is looked at."""

TYPICAL = 8
"""Proxies with more than one triangle in this many are only looked at where smaller ones are not near enough."""

SAMPLES = 2000
"""Number of the solid's vertices whose distances are measured, besides one of each body."""


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


def simplify(solid: Component, threshold: float, threads: int = 1) -> Proxy | None:
    """Make the smallest proxy that is near enough for a threshold; None if none is worthwhile."""
    looked_at = solid.vertices[_samples(solid)]
    for largest in (max(FEW, len(solid.faces) // TYPICAL), WORTHWHILE * len(solid.faces)):
        proxy = _smallest(solid, looked_at, threshold, largest, threads)
        if proxy is not None:
            return proxy
    return None


def _smallest(solid: Component, looked_at: FloatArray, threshold: float, largest: float, threads: int) -> Proxy | None:
    """The smallest proxy that is near enough, if one with at most `largest` triangles is."""
    mesh = solid.vertices, solid.faces
    best: Proxy | None = None
    while (count := math.floor((STEP if len(mesh[1]) <= largest else LARGE_STEP) * len(mesh[1]))) >= COARSEST:
        mesh = _reduced(mesh, count, threads)
        if len(mesh[1]) <= largest:
            near = _as_proxy(mesh, solid, looked_at, threshold)
            if near is None:
                break
            best = near
        if len(mesh[1]) > count:  # hardly any edge can be collapsed any more
            break
    return best


def _samples(solid: Component) -> IntArray:
    """Indices of one vertex of each body and of `SAMPLES` others, the same ones every time."""
    _, firsts = np.unique(_native.point_bodies(solid.vertices, solid.faces), return_index=True)
    count = len(solid.vertices)
    others = np.random.default_rng(0).choice(count, min(SAMPLES, count), replace=False)
    return np.concatenate([firsts, others]).astype(np.int32)


def _reduced(mesh: tuple[FloatArray, IntArray], count: int, threads: int) -> tuple[FloatArray, IntArray]:
    simplifier = _native.Simplifier(*mesh)
    simplifier.reduce(count, threads)
    return simplifier.mesh()


def _as_proxy(
    mesh: tuple[FloatArray, IntArray], solid: Component, looked_at: FloatArray, threshold: float
) -> Proxy | None:
    """The mesh as a proxy of a solid, if it is near enough."""
    if abs(_native.mesh_volume(*mesh) - solid.volume) > LOST * solid.volume:
        return None
    distances = _native.Surface(*mesh).distance(looked_at, 1)
    deviation = float(np.quantile(distances, OFTEN))
    if deviation > NEAR * threshold or distances.max() > ANYWHERE * threshold:
        return None
    try:
        return Proxy(Component(mesh), deviation)
    except ValueError:  # flat
        return None
