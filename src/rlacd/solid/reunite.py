"""Reuniting components that touch into one solid that can be cut again.

Two sides of a slanted cut agree to some 1e-16 only, which a mesh boolean takes for a gap: it leaves hairline walls
where the components touch. So the faces that touch are moved out by `OVERLAP` first, and the components overlap.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from manifold3d import Manifold, Mesh64, OpType

from rlacd import _native
from rlacd.solid.arrays import FloatArray
from rlacd.solid.component import Component, Part, Share

TOUCHING = 1e-8
"""Distance at which faces count as touching (see native/glue.hpp)."""

OVERLAP = 2e-9
"""How far touching faces are moved: above rounding (1e-16), below `TOUCHING`."""

CRUMBS = 5 * OVERLAP
"""Edges shorter than this are what overlapping has left; they go again, so that triangles do not pile up."""

LOST = 4 * OVERLAP
"""The reunited solid's volume differs from that of its components by no more than a film of this thickness on them."""


def reunite(components: Sequence[Component]) -> Component | None:
    """Unite components with disjoint interiors into one; None when no clean solid comes of it.

    Parameters
    ----------
    components : sequence of Component
        Pieces of one solid; those that touch do so face to face.
    """
    if len(components) == 1:
        return components[0]
    united = Manifold.batch_boolean([_overlapping(i, components) for i in range(len(components))], OpType.Add)
    volume = sum(component.volume for component in components)
    area = sum(_native.mesh_area(component.vertices, component.faces) for component in components)
    if united.is_empty() or abs(united.volume() - volume) > LOST * area:
        return None
    clean = united.simplify(CRUMBS)
    if abs(clean.volume() - volume) <= LOST * area:
        united = clean
    try:
        return Component(united)
    except ValueError:
        return None


def touch(first: Part, second: Part) -> bool:
    """Tell whether two parts, or members of them, touch face to face."""
    return _boxes_meet(first, second) and any(
        _boxes_meet(a, b) and bool(_outward(a, b).any())
        for a in _disjoint_pieces(first)
        for b in _disjoint_pieces(second)
    )


def _disjoint_pieces(part: Part) -> Sequence[Part]:
    return part.members if isinstance(part, Share) else (part,)


def _overlapping(which: int, components: Sequence[Component]) -> Manifold:
    """Move one component's faces out by `OVERLAP` where they touch any other's."""
    component = components[which]
    outward = np.zeros_like(component.vertices)
    for other in (*components[:which], *components[which + 1 :]):
        if _boxes_meet(component, other):
            outward += _outward(component, other)
    if not outward.any():
        return component.manifold
    return Manifold(Mesh64(component.vertices + OVERLAP * outward, component.faces.astype(np.uint64)))


def _outward(part: Part, other: Part) -> FloatArray:
    return _native.outward_where_touching(part.vertices, part.faces, other.vertices, other.faces)


def _boxes_meet(a: Part, b: Part) -> bool:
    return bool((np.maximum(a.box[0], b.box[0]) <= np.minimum(a.box[1], b.box[1]) + TOUCHING).all())
