"""Candidate planes and sweeps shared by several policies, each computed once."""

from __future__ import annotations

import threading
from weakref import WeakKeyDictionary

from rlacd import _native
from rlacd.planes.candidates import OFFSETS_PER_AXIS, Candidates, axis_and_principal
from rlacd.planes.sweep import Sweep, sweep
from rlacd.solid.component import Component


class SweepCache:
    """Candidate planes of components and their sweeps, kept as long as the component lives.

    Parameters
    ----------
    per_axis : int
        Planes along each of the six axes.
    concave_edges : int
        Number of concave edges whose planes are added.
    """

    def __init__(self, per_axis: int = OFFSETS_PER_AXIS, concave_edges: int = 4) -> None:
        self._per_axis = per_axis
        self._concave_edges = concave_edges
        self._candidates: WeakKeyDictionary[Component, Candidates] = WeakKeyDictionary()
        self._sweeps: WeakKeyDictionary[Component, Sweep] = WeakKeyDictionary()
        self._lock = threading.Lock()

    def candidates(self, component: Component) -> Candidates:
        """Get the planes of a component."""
        with self._lock:
            known = self._candidates.get(component)
        if known is None:
            known = self._found(component)
            with self._lock:  # another thread may have done the same, with the same result
                self._candidates[component] = known
        return known

    def _found(self, component: Component) -> Candidates:
        if self._concave_edges == 0:
            return axis_and_principal(component, self._per_axis)
        hull = component.hull
        normals, offsets = _native.candidate_planes(
            component.vertices, component.faces, hull.vertices, hull.faces, self._per_axis, self._concave_edges
        )
        return Candidates(normals, offsets[:, None])

    def of(self, component: Component, threads: int = 1) -> Sweep:
        """Get the sweep of a component."""
        with self._lock:
            known = self._sweeps.get(component)
        if known is None:
            known = sweep(component, self.candidates(component), threads)
            with self._lock:
                self._sweeps[component] = known
        return known
