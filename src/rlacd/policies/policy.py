"""What the loop asks of a policy."""

from __future__ import annotations

from typing import Protocol

from rlacd.solid.component import Component, Plane


class Policy(Protocol):
    """Chooses the plane that a component is cut by."""

    def choose(self, component: Component, threads: int = 1) -> Plane | None:
        """Choose a plane; None when the component cannot sensibly be cut further."""
