"""A piece of the solid on its way to becoming a part: its surface, its hull, and how it is cut and glued.

Everything is in the normalised frame (bounding box of the input centred, longest side 2).

Components that touch can be reunited into one that can be cut again.
"""

from __future__ import annotations

import copy
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from rlacd import _native
from rlacd.solid.arrays import FloatArray, IntArray
from rlacd.solid.frame import HALF_THICKNESS
from rlacd.solid.hull import TOLERANCE, Hull
from rlacd.solid.solid import Shape, mesh_of

NEGLIGIBLE_VOLUME = 1e-12
"""Solids below this volume (the frame's box has 8) are rounding left over by a cut."""

LOST_VOLUME = TOLERANCE
"""Share of a solid's volume that may be lost in a boolean, or as slivers (see `rlacd.cut`)."""


DENSE = 10_000
"""Solids and bodies of so many triangles are dense: a simpler copy is decomposed, and their noise is that of a scan."""

Piece = tuple[FloatArray, IntArray, float, FloatArray, IntArray, float]
"""What kernels make of a solid: vertices [V, 3], faces [F, 3] and volume, and those of its hull."""


@dataclass(frozen=True)
class Plane:
    """The plane n.x = d, n a unit normal; *below* is n.x < d, *above* n.x > d."""

    normal: tuple[float, float, float]
    offset: float


class Part:
    """A solid's surface with its volume and hull, computed once.

    Parameters
    ----------
    vertices : float64 [V, 3]
    faces : int32 [F, 3]
        A surface that bounds the solid, for measuring distances; that of a part glued from several is not a closed
        mesh.
    volume : float
        Of the solid.
    hull : Hull
        A convex polytope that contains the solid.
    piece_hulls : float, optional
        Sum of the volumes of the hulls of the pieces it was glued from; its own hull's volume by default.
    members : tuple of Component
        The components that it consists of. Empty if it, or any part in it, was not made from components: then nothing
        less than its hull covers what it stands for.

    Attributes
    ----------
    size : int
        Triangles of the surface, counting those where its pieces touch.
    within : Part or None
        A part whose hull contains this one's: the one it was cut from.
    exact : Hull or None
        Its hull before limits on vertices and triangles made that larger; None if they did not.
    tree : TreeCache or None
        Keeps the tree over the surface for the tests to come, whatever the hull; None forgets it after each.
    """

    def __init__(
        self,
        vertices: FloatArray,
        faces: IntArray,
        volume: float,
        hull: Hull,
        piece_hulls: float | None = None,
        members: tuple[Component, ...] = (),
    ) -> None:
        self._surface = vertices, faces
        self._members = members
        self.size = len(faces)
        self.volume = volume
        self.hull = hull
        self.piece_hulls = hull.volume if piece_hulls is None else piece_hulls
        self.within: Part | None = None
        self.exact: Hull | None = None
        self.tree: _native.TreeCache | None = None

    def __repr__(self) -> str:
        return f"{type(self).__name__}(volume {self.volume:.4g}, hull {self.hull.volume:.4g})"

    @property
    def members(self) -> tuple[Component, ...]:
        """The components it consists of."""
        return self._members

    @property
    def vertices(self) -> FloatArray:
        """Points of the surface [V, 3]."""
        return self._resolved()[0]

    @property
    def faces(self) -> IntArray:
        """Triangles of the surface [F, 3]."""
        return self._resolved()[1]

    @property
    def box(self) -> FloatArray:
        """Lower and upper corner of the bounding box [2, 3]."""
        return self.hull.box

    def with_hull(self, hull: Hull) -> Part:
        """Return the same solid with another hull around it."""
        other = copy.copy(self)
        other.hull = hull
        other.within = None  # the other hull may be larger
        return other

    @staticmethod
    def unclipped(hull: Hull) -> Part:
        """What a solid fills of a hull, before there was time to clip it: without faces."""
        return Part(np.empty((0, 3)), np.empty((0, 3), dtype=np.int32), 0.0, hull)

    @staticmethod
    def glued(first: Part, second: Part, hull: Hull | None = None) -> Part:
        """Unite two parts with disjoint interiors; the regions where they touch are not part of the union's surface.

        If either is a `ClippedPart`, which also holds what other parts contribute, the union is one too, if clipping
        leaves any of it. Pass the joint hull if it is known.
        """
        hull = hull or Hull.around(first.hull, second.hull)
        for part in (first, second):
            if isinstance(part, ClippedPart):
                clipped = ClippedPart(part.solid, (first, second), hull)
                if clipped.size:  # clipping may leave nothing of what is as thin as rounding
                    return clipped
        return _Union(first, second, hull)

    def _resolved(self) -> tuple[FloatArray, IntArray]:
        return self._surface


def _members_of(parts: Sequence[Part]) -> tuple[Component, ...]:
    """The members of all parts; none if a part has none."""
    known = all(part.members for part in parts)
    return tuple(member for part in parts for member in part.members) if known else ()


class _Union(Part):
    """The union of two parts. They are glued when the surface is first needed: some criteria look at the hull only."""

    def __init__(self, first: Part, second: Part, hull: Hull) -> None:
        volume, piece_hulls = first.volume + second.volume, first.piece_hulls + second.piece_hulls
        super().__init__(*first._surface, volume, hull, piece_hulls, _members_of((first, second)))
        self.size = first.size + second.size
        self._operands: tuple[Part, Part] | None = (first, second)

    def _resolved(self) -> tuple[FloatArray, IntArray]:
        for union in reversed(self._unresolved()):  # a loop: a thousand nested unions are too deep to recurse
            operands = union._operands
            if operands is not None:  # another thread may have done it already
                (a, b), (c, d) = (part._resolved() for part in operands)
                union._surface = _native.glue(a, b, c, d)
                union._operands = None
        return self._surface

    def _unresolved(self) -> list[_Union]:
        """This union and all unglued unions below it, outer before inner."""
        found: list[_Union] = []
        waiting: list[Part] = [self]
        while waiting:
            part = waiting.pop()
            if isinstance(part, _Union) and (operands := part._operands) is not None:
                found.append(part)
                waiting += operands
        return found


class ClippedPart(Part):
    """All that the solid fills of a hull of several of its parts, whichever part it came from.

    Parts on both sides of a third become one this way, such as a beam that another crosses: hulls may overlap, and
    material that lies in any of them is covered. The members stay disjoint, so parts can be reunited and cut again.

    Parameters
    ----------
    solid : Component
        The whole solid.
    parts : sequence of Part
        Consist of components of the solid.
    hull : Hull
        Contains them.

    Attributes
    ----------
    solid : Component
    """

    def __init__(self, solid: Component, parts: Sequence[Part], hull: Hull) -> None:
        inside = solid.inside(hull)
        piece_hulls = sum(part.piece_hulls for part in parts)
        super().__init__(inside.vertices, inside.faces, inside.volume, hull, piece_hulls, _members_of(parts))
        self.tree = inside.tree
        self.solid = solid

    @property
    def is_whole(self) -> bool:
        """Whether the clipping left faces, and no member lost volume in it."""
        return self.size > 0 and self.volume >= (1 - LOST_VOLUME) * sum(member.volume for member in self.members)


class Component(Part):
    """A closed solid, not necessarily connected, that can be cut.

    Parameters
    ----------
    solid : Shape
        The solid, in the normalised frame; not flat. A surface [V, 3], [F, 3] has to be closed and oriented.
    threads : int
        Threads that prepare `filling`.

    Raises
    ------
    ValueError
        The solid is flat.
    """

    def __init__(self, solid: Shape, threads: int = 1) -> None:
        vertices, faces = mesh_of(solid)
        hull = Hull.of(vertices)
        if hull is None:
            raise ValueError("a component has to have a volume")
        super().__init__(vertices, faces, _native.mesh_volume(vertices, faces), hull)
        self._threads = threads

    @classmethod
    def of(cls, piece: Piece, within: Component | None = None) -> Component:
        """Take over what a kernel made."""
        vertices, faces, volume, corners, facets, hull_volume = piece
        component = cls.__new__(cls)
        Part.__init__(component, vertices, faces, volume, Hull(corners, facets, hull_volume))
        component._threads = 1
        component.within = within
        return component

    @property
    def members(self) -> tuple[Component, ...]:
        """Itself."""
        return (self,)

    @cached_property
    def filling(self) -> _native.Filling:
        """Tests how well the hulls of the solid's parts are filled."""
        return _native.Filling(self.vertices, self.faces, self._threads)

    @cached_property
    def principal_axes(self) -> FloatArray:
        """Principal axes of the surface [3, 3], one per row, longest first.

        Eigenvectors of the second moments of the surface (exact over its triangles). Their signs are fixed by making
        the largest entry positive.
        """
        return _native.principal_axes(self.vertices, self.faces)

    def cut(self, plane: Plane, least: float = NEGLIGIBLE_VOLUME) -> tuple[Component | None, Component | None]:
        """Cut by a plane: returns the sides below and above, None for a side of no more than the least volume."""
        below, above = _native.cut(self.vertices, self.faces, *plane.normal, plane.offset, least)
        return below and Component.of(below, self), above and Component.of(above, self)

    def halved(self, share: float, principal: bool) -> list[Component]:
        """Cut at a share of its length along its longest coordinate axis or principal axis.

        The smaller side comes first; an empty list if one would be empty.
        """
        sides = _native.halve_along(self.vertices, self.faces, self.hull.body, principal, share, NEGLIGIBLE_VOLUME)
        return [Component.of(side, self) for side in sides]

    def halved_between(self, share: float, hulls: Sequence[Hull]) -> list[Component]:
        """The same from one to the other of the two hulls that would grow the least by it; empty if there are none."""
        around, own = [hull.body for hull in hulls], self.hull.body
        sides = _native.halve_between(self.vertices, self.faces, own, around, share, NEGLIGIBLE_VOLUME)
        return [Component.of(side, self) for side in sides]

    def inside(self, hull: Hull) -> Part:
        """Return all that the solid fills of a hull, closed by caps on the hull's facets; without faces if nothing."""
        vertices, faces, volume = self.filling.clipped(hull.body)
        part = Part(vertices, faces, volume, hull)
        part.tree = _native.TreeCache()
        return part

    def filled(self, hull: Hull) -> Part:
        """The same, but the hull itself if nothing is left."""
        part = self.inside(hull)
        return part if part.size else Part(hull.vertices, hull.faces, hull.volume, hull)

    def pieces(self) -> list[Component]:
        """Connected pieces, cavities kept inside the piece that encloses them; ``[self]`` if it is connected."""
        pieces = _native.connected_pieces(self.vertices, self.faces, NEGLIGIBLE_VOLUME)
        return [self] if pieces is None else [Component.of(piece, self) for piece in pieces]


THIN = HALF_THICKNESS / 5
"""Mean thickness up to which a part is a sliver that a cut or rounding has left: sheets are ten times thicker."""


def is_thin(part: Part) -> bool:
    """Whether the part's mean thickness, twice its volume over its area, is at most `THIN`."""
    return 2 * part.volume <= THIN * _native.mesh_area(part.vertices, part.faces)


def concatenated(surfaces: list[tuple[FloatArray, IntArray]]) -> tuple[FloatArray, IntArray]:
    """Return all surfaces [V, 3], [F, 3] as one."""
    firsts = np.cumsum([0, *(len(vertices) for vertices, _ in surfaces[:-1])])
    faces = [own + first for (_, own), first in zip(surfaces, firsts, strict=True)]
    return np.concatenate([vertices for vertices, _ in surfaces]), np.concatenate(faces).astype(np.int32)


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
