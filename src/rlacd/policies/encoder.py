"""What the Q network sees of a component: s(m) in the paper's 3.3. `rlacd.learn.train.train` takes one of your own.

`SweepEncoder` is the default; `rlacd.policies.points.PointEncoder` is the paper's.
"""

from __future__ import annotations

from typing import Protocol

from rlacd.policies.plane_features import FEATURES, sweep_features
from rlacd.solid.arrays import Float32Array
from rlacd.solid.component import Component


class Encoder(Protocol):
    """Describes components; nothing of it is learned, and it can be pickled."""

    dim: int
    """Number of features, of a component or of each of its planes."""
    outputs: int
    """Values that the network finds from them: one of each plane's own features, or those of all 150 at once."""
    digest: str
    """Identifies the encoder's weights; empty if it has none."""

    def describe(self, component: Component) -> Float32Array:
        """Features of a component, [dim] or [150, dim]; the same component always has the same."""


class SweepEncoder:
    """What the sweep gives of each plane (`sweep_features`); the criterion's length is its unit.

    One small network values any plane, also those never tried.
    """

    def __init__(self, threshold: float) -> None:
        self.dim, self.outputs, self.digest = FEATURES, 1, ""
        self._threshold = threshold

    def describe(self, component: Component) -> Float32Array:
        """See `Encoder`."""
        return sweep_features(component, self._threshold)
