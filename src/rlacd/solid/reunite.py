"""Reuniting components that touch into one solid that can be cut again."""

from __future__ import annotations

from collections.abc import Sequence

from rlacd import _native
from rlacd.solid.component import LOST_VOLUME, NEGLIGIBLE_VOLUME, ClippedPart, Component, Part

TOUCHING_FACES = 1e-8
"""Distance at which faces count as touching (see native/distance/glue.hpp)."""


def reunite(components: Sequence[Component]) -> Component | None:
    """Unite components with disjoint interiors into one; None if the result is not a clean solid.

    Parameters
    ----------
    components : sequence of Component
        Pieces of one solid; those that touch do so face to face.
    """
    components = _joined_again(components)
    if len(components) == 1:
        return components[0]
    whole = _native.reunite([one.vertices for one in components], [one.faces for one in components], NEGLIGIBLE_VOLUME)
    return whole and Component.of(whole)


def _joined_again(components: Sequence[Component]) -> list[Component]:
    """Put back the component that pieces were cut from if all of them are present: nothing is as fast or clean."""
    found = list(components)
    while True:
        siblings: dict[Component, list[Component]] = {}
        for component in found:
            if isinstance(component.within, Component):
                siblings.setdefault(component.within, []).append(component)
        whole = [
            origin
            for origin, pieces in siblings.items()
            if sum(piece.volume for piece in pieces) >= (1 - LOST_VOLUME) * origin.volume
        ]
        if not whole:
            return found
        found = [component for component in found if component.within not in whole] + whole


def touch(first: Part, second: Part) -> bool:
    """Tell whether two parts, or members of them, touch face to face."""
    return any(
        _native.do_touch(a.vertices, a.faces, b.vertices, b.faces)
        for a in _disjoint_pieces(first)
        for b in _disjoint_pieces(second)
    )


def _disjoint_pieces(part: Part) -> Sequence[Part]:
    return part.members if isinstance(part, ClippedPart) else (part,)
