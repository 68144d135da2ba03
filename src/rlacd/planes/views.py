"""Sweeps that several policies look at, each made once."""

from __future__ import annotations

import threading
from weakref import WeakKeyDictionary

from rlacd.planes.candidates import OFFSETS_PER_AXIS, Candidates, axis_and_principal
from rlacd.planes.concave_edges import concave_edge_planes
from rlacd.planes.sweep import Sweep, sweep
from rlacd.solid.component import Component


class Views:
    """Sweeps of components over the same kinds of planes, each kept as long as its component is.

    Parameters
    ----------
    per_axis : int
        Planes along each of the six axes.
    concave_edges : int
        How many concave edges add their planes.
    """

    def __init__(self, per_axis: int = OFFSETS_PER_AXIS, concave_edges: int = 4) -> None:
        self._per_axis = per_axis
        self._concave_edges = concave_edges
        self._sweeps: WeakKeyDictionary[Component, Sweep] = WeakKeyDictionary()
        self._lock = threading.Lock()

    def of(self, component: Component, threads: int = 1) -> Sweep:
        """Get the sweep of a component."""
        with self._lock:
            known = self._sweeps.get(component)
        if known is None:
            candidates = axis_and_principal(component, self._per_axis)
            if self._concave_edges > 0:
                candidates = Candidates.joined(candidates, concave_edge_planes(component, self._concave_edges))
            known = sweep(component, candidates, threads)
            with self._lock:  # another thread may have been here: with the same result
                self._sweeps[component] = known
        return known
