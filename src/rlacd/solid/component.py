"""A piece of the solid on its way to becoming a part: its surface, its hull, and how it is cut and glued.

Everything is in the normalised frame (bounding box of the input centred, longest side 2).
"""

from __future__ import annotations

import copy
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from manifold3d import Manifold, Mesh64

from rlacd import _native
from rlacd.solid.arrays import FloatArray, IntArray
from rlacd.solid.boolean_time import require_time_for
from rlacd.solid.caps import FOLDED, NEGLIGIBLE_FOLD, Surface, capped, section_caps
from rlacd.solid.hull import Hull
from rlacd.solid.manifold import to_manifold
from rlacd.solid.solid import mesh_of, surface_of

NEGLIGIBLE_VOLUME = 1e-12
"""Solids below this volume (the frame's box has 8) are rounding left over by a cut."""

LOST = 1e-6
"""Share of a solid's volume that may be lost in a boolean, or as shavings (see `rlacd.cut`)."""


MARGIN = 1e-3
"""Margin around a box when the solid is cropped to it, so that no cap touches what lies inside the box."""

FEW_FACES = 400
"""A boolean of this few faces takes no longer than cropping them first."""

MANY_FACES = 2000
"""Solids with more faces are halved before they are cropped to a box."""


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

    Attributes
    ----------
    within : Part or None
        A part whose hull contains this one's: the one it was cut from.
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
    ) -> None:
        self._surface: tuple[FloatArray, IntArray] | None = (vertices, faces)
        self.volume = volume
        self.hull = hull
        self.piece_hulls = hull.volume if piece_hulls is None else piece_hulls
        self.within: Part | None = None
        self.tree: _native.TreeCache | None = None
        self._size = len(faces)

    def __repr__(self) -> str:
        return f"{type(self).__name__}(volume {self.volume:.4g}, hull {self.hull.volume:.4g})"

    @property
    def members(self) -> tuple[Component, ...]:
        """The components it consists of; empty if it was not made from components."""
        return ()

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

    @property
    def size(self) -> int:
        """Triangles of the surface, counting those where its pieces touch."""
        return self._size

    def with_hull(self, hull: Hull) -> Part:
        """Return the same solid with another hull around it."""
        other = copy.copy(self)
        other.hull = hull
        other.within = None  # the other hull may be larger
        return other

    @staticmethod
    def glued(first: Part, second: Part, hull: Hull | None = None) -> Part:
        """Unite two parts with disjoint interiors; the regions where they touch are not part of the union's surface.

        If either is a `ClippedPart`, which also holds what other parts contribute, the union is one too. Pass the joint
        hull if it is known.
        """
        hull = hull or Hull.around(first.hull, second.hull)
        for part in (first, second):
            if isinstance(part, ClippedPart):
                return ClippedPart(part.solid, first, second, hull)
        return _Union(first, second, hull)

    def _resolved(self) -> tuple[FloatArray, IntArray]:
        assert self._surface is not None
        return self._surface


class _Union(Part):
    """The union of two parts. They are glued when the surface is first needed: some criteria look at the hull only."""

    def __init__(self, first: Part, second: Part, hull: Hull) -> None:
        self._surface = None
        self._operands: tuple[Part, Part] | None = (first, second)
        self.volume = first.volume + second.volume
        self.hull = hull
        self.piece_hulls = first.piece_hulls + second.piece_hulls
        self.within = None
        self.tree = None
        self._size = first.size + second.size
        self._members = (*first.members, *second.members)

    @property
    def members(self) -> tuple[Component, ...]:
        """The members of both parts."""
        return self._members

    def _resolved(self) -> tuple[FloatArray, IntArray]:
        if self._surface is None:
            for union in reversed(self._unresolved()):  # a loop: a thousand nested unions are too deep to recurse
                operands = union._operands
                if operands is not None:  # another thread may have done it already
                    (a, b), (c, d) = (part._resolved() for part in operands)
                    union._surface = _native.glue(a, b, c, d)
                    union._operands = None
        assert self._surface is not None
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
    """All that the solid fills of the joint hull of two of its parts, whichever part it came from.

    Parts on both sides of a third become one this way, such as a beam that another crosses: hulls may overlap, and
    material that lies in any of them is covered. The members stay disjoint, so parts can be reunited and cut again.

    Parameters
    ----------
    solid : Component
        The whole solid.
    first, second : Part
        Consist of components of the solid.
    hull : Hull
        Their joint hull.

    Attributes
    ----------
    solid : Component
    """

    def __init__(self, solid: Component, first: Part, second: Part, hull: Hull) -> None:
        inside = solid.inside(hull)
        super().__init__(inside.vertices, inside.faces, inside.volume, hull, first.piece_hulls + second.piece_hulls)
        self.tree = inside.tree
        self.solid = solid
        self._members = (*first.members, *second.members)

    @property
    def members(self) -> tuple[Component, ...]:
        """The members of both parts."""
        return self._members

    @property
    def is_whole(self) -> bool:
        """Whether no member lost volume in the clipping: booleans are unreliable where a surface touches the hull."""
        return self.volume >= (1 - LOST) * sum(member.volume for member in self.members)


class Component(Part):
    """A closed solid, not necessarily connected, that can be cut.

    Parameters
    ----------
    solid : manifold3d.Manifold or (vertices, faces)
        The solid, in the normalised frame; not flat. A surface [V, 3], [F, 3] has to be closed and oriented.
    threads : int
        Number of threads that may prepare the tests of how well hulls are filled.

    Raises
    ------
    ValueError
        The solid is flat.
    """

    def __init__(self, solid: Manifold | tuple[FloatArray, IntArray], threads: int = 1) -> None:
        vertices, faces = mesh_of(solid)
        hull = Hull.of(vertices)
        if hull is None:
            raise ValueError("a component has to have a volume")
        super().__init__(vertices, faces, _native.mesh_volume(vertices, faces), hull)
        self._threads = threads
        if isinstance(solid, Manifold):
            self.manifold = solid

    @property
    def members(self) -> tuple[Component, ...]:
        """Itself."""
        return (self,)

    @cached_property
    def manifold(self) -> Manifold:
        """The solid, ready for booleans."""
        return to_manifold(self.vertices, self.faces)

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
        sides = _native.cut_by_plane(self.vertices, self.faces, *plane.normal, plane.offset)
        (below, _), (above, _) = (capped(*side) for side in sides)
        return _component(below, self, least), _component(above, self, least)

    def inside(self, hull: Hull) -> Part:
        """Return all that the solid fills of a hull, closed by caps on the hull's facets; without faces if nothing."""
        (vertices, faces), tree = self._clipped(hull)
        volume = max(0.0, _native.mesh_volume(vertices, faces)) if len(faces) else 0.0
        part = Part(vertices, faces, volume, hull)
        part.tree = tree
        return part

    def _clipped(self, hull: Hull) -> tuple[Surface, _native.TreeCache]:
        found = self.filling.clipped(hull.vertices, hull.faces)
        if found is not None:
            vertices, faces, sections, tree = found
            caps, folded = section_caps(*sections)
            if folded <= FOLDED:
                return (vertices, np.ascontiguousarray(np.concatenate([faces, caps]), dtype=np.int32)), tree
        require_time_for(len(self.faces))
        clipped = self.around(hull.box) ^ Manifold(Mesh64(hull.vertices, hull.faces.astype(np.uint64)))
        return surface_of(clipped), _native.TreeCache()

    def around(self, box: FloatArray) -> Manifold:
        """Return the solid cropped to a box [2, 3] and a margin around it, for booleans with what lies in the box.

        Returns the whole solid if it is small, or if it cannot be cut cleanly.
        """
        surface = self._cell(box)
        room = np.stack([box[0] - self.box[0], self.box[1] - box[1]])  # beyond each side of the box
        for side, axis in sorted(np.argwhere(room > MARGIN).tolist(), key=lambda at: -room[at[0], at[1]]):
            if len(surface[1]) <= FEW_FACES:
                break
            kept = _halves(surface, axis, float(box[side, axis] + (MARGIN if side else -MARGIN)))[1 - side]
            if kept is None:
                return self.manifold
            surface = kept
        if surface[1] is self.faces:
            return self.manifold
        clipped = Manifold(Mesh64(surface[0], surface[1].astype(np.uint64)))
        volume = _native.mesh_volume(*surface) if len(surface[1]) else 0.0
        return clipped if abs(clipped.volume() - volume) <= NEGLIGIBLE_VOLUME + LOST * volume else self.manifold

    def _cell(self, box: FloatArray) -> tuple[FloatArray, IntArray]:
        """Return the smallest cell of the solid that holds a box, by repeatedly halving it across its longest side.

        Cells are cached: otherwise every crop would go through all faces.
        """
        cell, place = self.box, ""
        surface = self.vertices, self.faces
        while len(surface[1]) > MANY_FACES:
            axis = int(np.argmax(cell[1] - cell[0]))
            middle = float(cell[:, axis].mean())
            if box[1, axis] + MARGIN <= middle:
                side = 0
            elif box[0, axis] - MARGIN >= middle:
                side = 1
            else:
                break
            if place not in self._cells:
                self._cells[place] = _halves(surface, axis, middle)
            half = self._cells[place][side]
            if half is None:
                break
            surface = half
            cell = cell.copy()
            cell[1 - side, axis] = middle
            place += str(side)
        return surface

    @cached_property
    def _cells(self) -> dict[str, tuple[Surface | None, ...]]:
        return {}

    def pieces(self) -> list[Component]:
        """Connected pieces, cavities kept inside the piece that encloses them; ``[self]`` if it is connected."""
        bodies = _native.bodies(self.vertices, self.faces)
        if len(bodies) == 1:
            return [self]
        volumes = [_native.mesh_volume(*body) for body in bodies]
        shells = [(volume, body) for volume, body in zip(volumes, bodies, strict=True) if volume > 0]
        cavities = [body for volume, body in zip(volumes, bodies, strict=True) if volume < 0]
        surfaces = _enclose(shells, cavities) if cavities else [body for _, body in shells]
        return [piece for surface in surfaces if (piece := _component(surface, self)) is not None]


def _halves(surface: Surface, axis: int, offset: float) -> tuple[Surface | None, ...]:
    """Cut a closed surface across a coordinate axis: the sides below and above, None if it cannot be cut cleanly."""
    x, y, z = np.eye(3)[axis].tolist()
    sides = (capped(*side) for side in _native.cut_by_plane(*surface, x, y, z, offset))
    return tuple(side if folded <= NEGLIGIBLE_FOLD else None for side, folded in sides)


def _component(
    solid: Manifold | tuple[FloatArray, IntArray], within: Component, least: float = NEGLIGIBLE_VOLUME
) -> Component | None:
    if isinstance(solid, Manifold):
        is_empty = solid.is_empty() or solid.volume() <= least
    else:
        is_empty = not len(solid[1]) or _native.mesh_volume(*solid) <= least
    if is_empty:
        return None
    try:
        component = Component(solid)
    except ValueError:
        return None
    component.within = within
    return component


def _enclose(
    shells: list[tuple[float, tuple[FloatArray, IntArray]]], cavities: list[tuple[FloatArray, IntArray]]
) -> list[tuple[FloatArray, IntArray]]:
    """Assign every cavity (a shell of negative volume) to the smallest of the shells (volume, surface) around it."""
    by_shell = [[surface] for _, surface in shells]
    by_volume = sorted(range(len(shells)), key=lambda i: (shells[i][0], i))
    for cavity in cavities:
        point = cavity[0][:1]
        for i in by_volume:
            if _native.Surface(*shells[i][1]).winding(point)[0] > 0.5:
                by_shell[i].append(cavity)
                break
    return [group[0] if len(group) == 1 else concatenated(group) for group in by_shell]


def concatenated(surfaces: list[tuple[FloatArray, IntArray]]) -> tuple[FloatArray, IntArray]:
    """Return all surfaces [V, 3], [F, 3] as one."""
    firsts = np.cumsum([0, *(len(vertices) for vertices, _ in surfaces[:-1])])
    faces = [own + first for (_, own), first in zip(surfaces, firsts, strict=True)]
    return np.concatenate([vertices for vertices, _ in surfaces]), np.concatenate(faces).astype(np.int32)
