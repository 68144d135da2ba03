"""Balls that hulls have to leave free: which each part touches, and how deep."""

from __future__ import annotations

import threading
from collections.abc import Sequence
from weakref import WeakKeyDictionary

import numpy as np

from rlacd import _native
from rlacd.solid.arrays import FloatArray, IntArray
from rlacd.solid.component import Part
from rlacd.solid.primitive import Balls

TOUCH = 1e-9
"""A hull that reaches no deeper than this into a ball does not touch it."""


class Intrusions:
    """Which balls each part touches and how deep, cached as long as the part lives.

    A part's hull lies within that of the part it was cut from, so it can only touch balls that the latter touches.
    """

    def __init__(self, balls: Balls) -> None:
        self._radii = balls.radii
        self._balls = _native.BallSet(balls.centres, balls.radii)
        self._known: WeakKeyDictionary[Part, tuple[IntArray, FloatArray]] = WeakKeyDictionary()
        self._lock = threading.Lock()

    def of(self, part: Part) -> tuple[IntArray, FloatArray]:
        """Indices of the balls that the part's hull touches [K], ascending, and its depths in them [K]."""
        known = self._recall(part)
        if known is None:
            within = part.within
            candidates = None if within is None else self.of(within)[0]
            known = self._balls.intrusions(part.hull.vertices, part.hull.faces, candidates, TOUCH)
            with self._lock:  # another thread may have done the same, with the same result
                self._known[part] = known
        return known

    def any_beyond(self, part: Part, depth: float) -> bool:
        """Whether the part's hull reaches deeper than `depth` into any ball."""
        if part.within is None and self._recall(part) is None:  # a union: most fail, so stop at the first ball
            first, _ = self._balls.intrusions(part.hull.vertices, part.hull.faces, None, depth, first=True)
            return len(first) > 0
        _, depths = self.of(part)
        return bool((depths > depth).any())

    def radii_left(self, parts: Sequence[Part]) -> FloatArray:
        """How large each ball can be without touching any of the parts' hulls [B], 0 or less where it cannot be."""
        radii = self._radii.copy()
        for part in parts:
            touched, depth = self.of(part)
            radii[touched] = np.minimum(radii[touched], self._radii[touched] - depth)
        return radii

    def _recall(self, part: Part) -> tuple[IntArray, FloatArray] | None:
        with self._lock:
            return self._known.get(part)
