"""The interface of policies.

Any object with a method `choose` is a policy::

    class Halves:
        def choose(self, component, threads=1):
            low, high = component.box
            axis = int(np.argmax(high - low))
            return rlacd.Plane(tuple(np.eye(3)[axis]), float((low + high)[axis] / 2))

    rlacd.decompose("chair.glb", policy=Halves(), quality="fast")
"""

from __future__ import annotations

import math
from typing import Protocol

from rlacd.errors import OptionError
from rlacd.solid.component import Component, Plane
from rlacd.solid.hull import TOLERANCE


class Policy(Protocol):
    """Chooses the plane that a component is cut by."""

    def choose(self, component: Component, threads: int = 1) -> Plane | None:
        """Choose a plane.

        Parameters
        ----------
        component : Component
            A connected piece of the solid that does not meet the criterion yet, in the frame where the input's longest
            side is 2: `vertices` [V, 3], `faces` [F, 3], `volume`, `hull`, `box` [2, 3], `principal_axes` [3, 3].
        threads : int
            Number of threads the choice may use. `choose` may be called from several threads at the same time.

        Returns
        -------
        Plane or None
            None if the component cannot sensibly be cut further.
        """


class CheckedPolicy:
    """A user's policy whose answers are checked before they are used.

    Parameters
    ----------
    policy : Policy
    """

    def __init__(self, policy: Policy) -> None:
        self._policy = policy

    def choose(self, component: Component, threads: int = 1) -> Plane | None:
        """Ask the policy.

        Raises
        ------
        OptionError
            The answer is not a plane.
        """
        plane = self._policy.choose(component, threads)
        if plane is None or _is_plane(plane):
            return plane
        raise OptionError(
            f"{type(self._policy).__qualname__}.choose returned {plane!r}; it has to return an `rlacd.Plane` with a "
            "normal of length 1, or None."
        )


def _is_plane(answer: object) -> bool:
    if not isinstance(answer, Plane) or len(answer.normal) != 3:
        return False
    return abs(math.hypot(*answer.normal) - 1) <= TOLERANCE and math.isfinite(answer.offset)
