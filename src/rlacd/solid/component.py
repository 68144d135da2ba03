"""Parts of a decomposition, and the pieces of the solid that they stand for, which can be cut.

Everything is in the normalised frame (bounding box of the input centred, longest side 2).

Components that touch can be reunited into one that can be cut again.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from rlacd import _native
from rlacd.solid.arrays import FloatArray, IntArray, dots
from rlacd.solid.frame import HALF_THICKNESS
from rlacd.solid.hull import TOLERANCE, Hull
from rlacd.solid.solid import Shape, mesh_of

NEGLIGIBLE_VOLUME = 1e-12
"""Solids below this volume (the frame's box has 8) are rounding left over by a cut."""

LOST_VOLUME = TOLERANCE
"""Share of a solid's volume that may be lost in a boolean, or as slivers."""


FLAT = 1e-5
"""Faces whose planes differ by less lie in one."""

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
    """A convex hull, and the disjoint pieces of the solid that it stands for.

    Every question about a part is one about its hull and the whole solid (`Component.against`).

    Parameters
    ----------
    hull : Hull
    members : tuple of Component
        The pieces, which the hull contains. Empty if they are not known, as those of a hull that was carried over from
        a simpler copy: then nothing less than the hull covers what it stands for.
    whole : Component
        The solid that the hull is held against; a component without one is its own.
    exact : Hull or None
        Its hull before limits on vertices and triangles made that larger; None if they did not.

    Attributes
    ----------
    within : Part or None
        A part whose hull contains this one's: the one it was cut from.
    """

    within: Part | None = None

    def __init__(
        self, hull: Hull, members: tuple[Component, ...], whole: Component | None, exact: Hull | None = None
    ) -> None:
        self.hull = hull
        self.exact = exact
        self._members = members
        self._whole = whole

    def __repr__(self) -> str:
        return f"{type(self).__name__}(hull {self.hull.volume:.4g})"

    @property
    def members(self) -> tuple[Component, ...]:
        """The pieces it stands for."""
        return self._members

    @property
    def whole(self) -> Component:
        """The solid that its hull is held against."""
        assert self._whole is not None, "only a component is its own whole"
        return self._whole

    @cached_property
    def volume(self) -> float:
        """Of its pieces; all that the solid fills of its hull if they are not known."""
        return sum(member.volume for member in self.members) if self.members else self.filled

    @cached_property
    def filled(self) -> float:
        """Volume of all that the solid fills of its hull, whichever part that belongs to, without limits."""
        return self.whole.against.filled((self.exact or self.hull).body)

    @property
    def box(self) -> FloatArray:
        """Lower and upper corner of the bounding box [2, 3]."""
        return self.hull.box

    def with_hull(self, hull: Hull) -> Part:
        """Return the same pieces with another hull around them."""
        return Part(hull, self.members, self.whole, self.exact)

    @staticmethod
    def joint(*parts: Part) -> Part:
        """Unite parts with disjoint pieces; the pieces of the union are not known if those of one part are not."""
        known = all(part.members for part in parts)
        members = tuple(member for part in parts for member in part.members) if known else ()
        return Part(Hull.around(*(part.hull for part in parts)), members, parts[0].whole)


class Component(Part):
    """A closed solid, not necessarily connected, that can be cut.

    Parameters
    ----------
    solid : Shape
        The solid, in the normalised frame; not flat. A surface [V, 3], [F, 3] has to be closed and oriented.
    threads : int
        Threads that prepare `against`.
    whole : Component, optional
        The solid that it is a piece of; itself by default.

    Attributes
    ----------
    vertices : float64 [V, 3]
    faces : int32 [F, 3]
        Closed and oriented.
    volume : float

    Raises
    ------
    ValueError
        The solid is flat.
    """

    volume: float

    def __init__(self, solid: Shape, threads: int = 1, whole: Component | None = None) -> None:
        vertices, faces = mesh_of(solid)
        hull = Hull.of(vertices)
        if hull is None:
            raise ValueError("a component has to have a volume")
        self._take((vertices, faces, _native.mesh_volume(vertices, faces)), hull, whole)
        self._threads = threads

    @classmethod
    def of(cls, piece: Piece, within: Component | None = None, whole: Component | None = None) -> Component:
        """Take over what a kernel made: a piece `within` another, or of the `whole`; else a solid of its own."""
        *solid, corners, facets, hull_volume = piece
        component = cls.__new__(cls)
        component._take(solid, Hull(corners, facets, hull_volume), within.whole if within is not None else whole)
        component.within = within
        return component

    def _take(self, solid: Sequence[Any], hull: Hull, whole: Component | None) -> None:
        super().__init__(hull, (), whole)
        self.vertices, self.faces, self.volume = solid
        self._threads = 1

    @property
    def members(self) -> tuple[Component, ...]:
        """Itself."""
        return (self,)

    @property
    def whole(self) -> Component:
        """The solid that it is a piece of; itself if it is none."""
        return self._whole or self

    @property
    def size(self) -> int:
        """Triangles."""
        return len(self.faces)

    @property
    def sides(self) -> int:
        """Number of planes that its faces lie in, without the smallest, which hold 1% of the area."""
        corners = self.vertices[self.faces]
        normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
        areas = np.sqrt(dots(normals, normals))
        normals = normals[areas > 0] / areas[areas > 0, None]
        planes = np.concatenate([normals, dots(normals, corners[areas > 0, 0])[:, None]], axis=1)
        _, side = np.unique(np.round(planes / FLAT), axis=0, return_inverse=True)
        shares = np.sort(np.bincount(side.ravel(), areas[areas > 0] / areas.sum()))
        return int(np.count_nonzero(np.cumsum(shares) > 0.01))

    @cached_property
    def against(self) -> _native.Against:
        """Holds hulls against the solid: asked of the whole only."""
        return _native.Against(self.vertices, self.faces, self._threads)

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

    def halved(self, share: float, principal: bool, least: float = NEGLIGIBLE_VOLUME) -> list[Component]:
        """Cut at a share of its length along its longest coordinate axis or principal axis.

        The smaller side comes first; an empty list if one would have no more than the least volume.
        """
        sides = _native.halve_along(self.vertices, self.faces, self.hull.body, principal, share, least)
        return [Component.of(side, self) for side in sides]

    def halved_between(self, share: float, hulls: Sequence[Hull]) -> list[Component]:
        """The same from one to the other of the two hulls that would grow the least by it; empty if there are none."""
        around, own = [hull.body for hull in hulls], self.hull.body
        sides = _native.halve_between(self.vertices, self.faces, own, around, share, NEGLIGIBLE_VOLUME)
        return [Component.of(side, self) for side in sides]

    def inside(self, hull: Hull) -> Component | None:
        """Return all that the solid fills of a hull, closed by caps on the hull's facets; None if that is flat."""
        try:
            return Component(self.against.inside(hull.body), whole=self.whole)
        except ValueError:
            return None

    def pieces(self) -> list[Component]:
        """Connected pieces, cavities kept inside the piece that encloses them; ``[self]`` if it is connected."""
        pieces = _native.connected_pieces(self.vertices, self.faces, NEGLIGIBLE_VOLUME)
        return [self] if pieces is None else [Component.of(piece, self) for piece in pieces]


THIN = HALF_THICKNESS / 5
"""Mean thickness up to which a part is a sliver that a cut or rounding has left: sheets are ten times thicker."""


def is_thin(component: Component) -> bool:
    """Whether the mean thickness, twice the volume over the area, is at most `THIN`."""
    return 2 * component.volume <= THIN * _native.mesh_area(component.vertices, component.faces)


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
    return whole and Component.of(whole, whole=components[0].whole)


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
