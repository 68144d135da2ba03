"""Reuniting components that touch into one solid that can be cut again.

Two sides of a slanted cut agree only to about 1e-16, which a mesh boolean takes for a gap: it leaves hairline walls
where the components touch. So touching faces are first moved out by `OVERLAP`, which makes the components overlap.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from manifold3d import Manifold, Mesh64, OpType

from rlacd import _native
from rlacd.solid.arrays import BoolArray, FloatArray
from rlacd.solid.boolean_time import require_time_for
from rlacd.solid.component import LOST, ClippedPart, Component, Part, concatenated
from rlacd.solid.manifold import to_manifold

TOUCHING = 1e-8
"""Distance at which faces count as touching (see native/distance/glue.hpp)."""

OVERLAP = 2e-9
"""How far touching faces are moved: above rounding (1e-16), below `TOUCHING`."""

CRUMBS = 5 * OVERLAP
"""Edges shorter than this are remnants of the overlap; they are collapsed, so that triangles do not pile up."""

FILM = 4 * OVERLAP
"""The reunited solid's volume may differ from that of its components by a film of this thickness over them."""

GROWN, SOME = 1.3, 100
"""More faces than this multiple of the components', plus a few, mean undetected crumbs, which would pile up."""

MOST_TOUCHING = 100
"""Pairs of touching triangles per triangle, above which components cross instead of lying side by side."""

FOLDED, OFF = 1e-3, 1e-6
"""Or by this share of it, where the components overlap themselves or each other, as those of a solid with folds do; no
corner of theirs may lie farther outside than this."""


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
    faces = sum(len(component.faces) for component in components)
    require_time_for(faces)
    body = np.repeat(np.arange(len(components)), [len(component.faces) for component in components])
    surfaces = concatenated([(component.vertices, component.faces) for component in components])
    if _native.crossings(*surfaces, body, MOST_TOUCHING * faces)[0] > MOST_TOUCHING * faces:
        return None  # they cross each other: a boolean could take long, and cannot be interrupted
    united = Manifold.batch_boolean(_overlapping(components), OpType.Add)
    volume = sum(component.volume for component in components)
    area = sum(_native.mesh_area(component.vertices, component.faces) for component in components)
    if united.is_empty() or abs(united.volume() - volume) > FOLDED * volume:
        return None
    clean = united.as_original().simplify(CRUMBS)
    if abs(clean.volume() - united.volume()) <= FILM * area:
        united = clean
    try:
        whole = Component(united)
    except ValueError:
        return None
    if len(whole.faces) > GROWN * sum(len(component.faces) for component in components) + SOME:
        return None
    # Volume may be missing because a fold is gone, or because a boolean lost a piece.
    return whole if abs(whole.volume - volume) <= FILM * area or _holds(whole, components) else None


def _joined_again(components: Sequence[Component]) -> list[Component]:
    """Put back the component that pieces were cut from if all of them are present: no boolean is as fast or clean."""
    found = list(components)
    while True:
        siblings: dict[Component, list[Component]] = {}
        for component in found:
            if isinstance(component.within, Component):
                siblings.setdefault(component.within, []).append(component)
        whole = [
            origin
            for origin, pieces in siblings.items()
            if sum(piece.volume for piece in pieces) >= (1 - LOST) * origin.volume
        ]
        if not whole:
            return found
        found = [component for component in found if component.within not in whole] + whole


def touch(first: Part, second: Part) -> bool:
    """Tell whether two parts, or members of them, touch face to face."""
    return _boxes_meet(first, second) and any(
        _boxes_meet(a, b) and bool(_outward(a, b).any())
        for a in _disjoint_pieces(first)
        for b in _disjoint_pieces(second)
    )


def _disjoint_pieces(part: Part) -> Sequence[Part]:
    return part.members if isinstance(part, ClippedPart) else (part,)


def _holds(whole: Component, components: Sequence[Component]) -> bool:
    """Tell whether every corner of the components lies in the whole, or on it."""
    surface = _native.Surface(whole.vertices, whole.faces)
    corners = np.concatenate([component.vertices for component in components])
    off = corners[surface.distance(corners, 1) > OFF]
    return bool((surface.winding(off, 2.0, 1) > 0.5).all()) if len(off) else True


def _overlapping(components: Sequence[Component]) -> list[Manifold]:
    """Move the components' faces out by `OVERLAP` where they touch each other's."""
    boxes = np.array([component.box for component in components])
    # Stay within the common box: parts that are reunited repeatedly would creep out of the input.
    lower, upper = boxes[:, 0].min(axis=0), boxes[:, 1].max(axis=0)
    overlapping = []
    for which, component in enumerate(components):
        outward = np.zeros_like(component.vertices)
        for other in np.flatnonzero(_meet(boxes, boxes[which])).tolist():
            if other != which:
                outward += _outward(component, components[other])
        if outward.any():
            moved = np.clip(component.vertices + OVERLAP * outward, lower, upper)
            overlapping.append(Manifold(Mesh64(moved, component.faces.astype(np.uint64))))
        else:
            overlapping.append(to_manifold(component.vertices, component.faces))
    return overlapping


def _outward(part: Part, other: Part) -> FloatArray:
    return _native.outward_where_touching(part.vertices, part.faces, other.vertices, other.faces)


def _boxes_meet(a: Part, b: Part) -> bool:
    return bool(_meet(a.box, b.box))


def _meet(boxes: FloatArray, box: FloatArray) -> BoolArray:
    """Whether each of the boxes [..., 2, 3] meets one [2, 3]."""
    low, high = boxes[..., 0, :], boxes[..., 1, :]
    meet: BoolArray = (np.maximum(low, box[0]) <= np.minimum(high, box[1]) + TOUCHING).all(axis=-1)
    return meet
