"""A piece of the solid on its way to becoming a part: its surface, its hull, and how it is cut and glued.

Everything is in the normalised frame (bounding box of the input centred, longest side 2).
"""

from __future__ import annotations

import copy
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from manifold3d import Manifold, Mesh64, triangulate

from rlacd import _native
from rlacd.solid.arrays import FloatArray, IntArray
from rlacd.solid.boolean_time import require_time_for
from rlacd.solid.hull import Hull

NEGLIGIBLE_VOLUME = 1e-12
"""Solids below this volume (the frame's box has 8) are rounding left over by a cut."""

LOST = 1e-6
"""Share of a solid's volume that may be lost by a boolean, or as shavings (see `rlacd.cut`)."""


FOLDED = 1e-2
"""Share of a cap's area that may lie upside down: more than that where solids overlap themselves by a hair. Rims cross
each other then, and triangles between them may lead far out of the solid; a boolean knows better what is inside."""


NEGLIGIBLE_FOLD = 1e-9
"""A smaller share than this is rounding."""


MARGIN = 1e-3
"""How far outside a box a solid is cut that is wanted in it, so that no cap touches what lies inside."""

FEW_FACES = 400
"""A boolean with so few faces takes no longer than cutting them off first."""

MANY_FACES = 2000
"""Solids with more faces are halved before a box is cut out of them."""


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
        A surface that bounds the solid, to measure distances to; parts glued from several are not closed meshes.
    volume : float
        Of the solid.
    hull : Hull
        A convex hull that contains the solid.
    piece_hulls : float, optional
        Volumes of the hulls of the pieces it was glued from, added up; its own hull's volume by default.

    Attributes
    ----------
    within : Part or None
        A part whose hull contains this one's: what it was cut from.
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
        self._size = len(faces)

    def __repr__(self) -> str:
        return f"{type(self).__name__}(volume {self.volume:.4g}, hull {self.hull.volume:.4g})"

    @property
    def members(self) -> tuple[Component, ...]:
        """The components it was glued from; none where it was not made of components."""
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
        """Triangles of the surface, before what its pieces touch by is taken away."""
        return self._size

    def with_hull(self, hull: Hull) -> Part:
        """Get the same solid with another hull around it."""
        other = copy.copy(self)
        other.hull = hull
        other.within = None  # the other hull may be larger
        return other

    @staticmethod
    def glued(first: Part, second: Part, hull: Hull | None = None) -> Part:
        """Unite two parts with disjoint interiors; the regions where they touch are no surface of the union.

        Where one of them is a `ClippedPart`, which has what others have too, so is the union. Their joint hull may be
        given where it is known.
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
    """Two parts as one. They are glued when the surface is first asked for: some criteria look at the hull only."""

    def __init__(self, first: Part, second: Part, hull: Hull) -> None:
        self._surface = None
        self._operands: tuple[Part, Part] | None = (first, second)
        self.volume = first.volume + second.volume
        self.hull = hull
        self.piece_hulls = first.piece_hulls + second.piece_hulls
        self.within = None
        self._size = first.size + second.size
        self._members = (*first.members, *second.members)

    @property
    def members(self) -> tuple[Component, ...]:
        """Those of both parts."""
        return self._members

    def _resolved(self) -> tuple[FloatArray, IntArray]:
        if self._surface is None:
            for union in reversed(self._unresolved()):  # a loop: a thousand unions in a row are too deep to recurse
                operands = union._operands
                if operands is not None:  # another thread may have been here
                    (a, b), (c, d) = (part._resolved() for part in operands)
                    union._surface = _native.glue(a, b, c, d)
                    union._operands = None
        assert self._surface is not None
        return self._surface

    def _unresolved(self) -> list[_Union]:
        """This union and all below it that are not glued yet, the outer before the inner."""
        found: list[_Union] = []
        waiting: list[Part] = [self]
        while waiting:
            part = waiting.pop()
            if isinstance(part, _Union) and (operands := part._operands) is not None:
                found.append(part)
                waiting += operands
        return found


class ClippedPart(Part):
    """What a solid fills of the joint hull of two of its parts, whomever it belongs to.

    Parts on both sides of a third are one this way, as a beam that crosses another is: hulls may overlap, and what
    lies in one of them is where it should be. The members stay disjoint, so that parts can be reunited and cut anew.

    Parameters
    ----------
    solid : Component
        All of it.
    first, second : Part
        Made of its components.
    hull : Hull
        Their joint hull.

    Attributes
    ----------
    solid : Component
    """

    def __init__(self, solid: Component, first: Part, second: Part, hull: Hull) -> None:
        require_time_for(len(solid.faces))
        body = Manifold(Mesh64(hull.vertices, hull.faces.astype(np.uint64)))
        vertices, faces = _surface_of(solid.around(hull.box) ^ body)
        volume = _native.mesh_volume(vertices, faces) if len(faces) else 0.0
        super().__init__(vertices, faces, volume, hull, first.piece_hulls + second.piece_hulls)
        self.solid = solid
        self._members = (*first.members, *second.members)

    @property
    def members(self) -> tuple[Component, ...]:
        """Those of both parts."""
        return self._members

    @property
    def is_whole(self) -> bool:
        """Whether all of the members is there: what touches the hull from inside is hard on booleans."""
        return self.volume >= (1 - LOST) * sum(member.volume for member in self.members)


class Component(Part):
    """A closed solid, not necessarily connected, that can be cut.

    Parameters
    ----------
    solid : manifold3d.Manifold or (vertices, faces)
        The solid, in the normalised frame; not flat. A surface [V, 3], [F, 3] has to be closed and oriented.

    Raises
    ------
    ValueError
        It is flat.
    """

    def __init__(self, solid: Manifold | tuple[FloatArray, IntArray]) -> None:
        vertices, faces = solid if isinstance(solid, tuple) else _surface_of(solid)
        hull = Hull.of(vertices)
        if hull is None:
            raise ValueError("a component has to have a volume")
        super().__init__(vertices, faces, _native.mesh_volume(vertices, faces), hull)
        if isinstance(solid, Manifold):
            self.manifold = solid

    @property
    def members(self) -> tuple[Component, ...]:
        """Itself."""
        return (self,)

    @cached_property
    def manifold(self) -> Manifold:
        """The solid for booleans."""
        return Manifold(Mesh64(self.vertices, self.faces.astype(np.uint64)))

    @cached_property
    def filling(self) -> _native.Filling:
        """What hulls of its parts are held against."""
        return _native.Filling(self.vertices, self.faces)

    @cached_property
    def principal_axes(self) -> FloatArray:
        """Principal axes of the surface [3, 3], one a row, the longest first, right-handed.

        Eigenvectors of the second moments of the surface (exact over its triangles). Their signs are fixed by making
        the largest entry positive.
        """
        _, axes = np.linalg.eigh(_native.mesh_moments(self.vertices, self.faces))
        axes = axes.T[::-1].copy()
        for axis in axes:
            largest = int(np.argmax(np.abs(axis)))
            axis *= np.sign(axis[largest])
        return axes

    def cut(self, plane: Plane) -> tuple[Component | None, Component | None]:
        """Cut by a plane: what lies below and what lies above, None where nothing (of any volume) does."""
        open_sides = _native.cut_by_plane(self.vertices, self.faces, *plane.normal, plane.offset)
        (below, below_folded), (above, above_folded) = (_capped(*side) for side in open_sides)
        if max(below_folded, above_folded) > FOLDED and abs(self.manifold.volume() - self.volume) <= LOST * self.volume:
            require_time_for(len(self.faces))
            upper, lower = self.manifold.split_by_plane(plane.normal, plane.offset)
            return _component(lower, self), _component(upper, self)
        return _component(below, self), _component(above, self)

    def around(self, box: FloatArray) -> Manifold:
        """Get what the solid has in a box [2, 3] and a margin around it, for booleans with what lies in the box.

        All of the solid where it is small, or where it is not cut cleanly.
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
        """Get the smallest cell of the solid that a box lies in: it is halved across its longest side, time and again.

        Cells are kept: otherwise every look into a box would go through all faces.
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
    def _cells(self) -> dict[str, tuple[tuple[FloatArray, IntArray] | None, ...]]:
        return {}

    def pieces(self) -> list[Component]:
        """Connected pieces, cavities kept inside the piece that encloses them; ``[self]`` when there is but one."""
        bodies = _native.bodies(self.vertices, self.faces)
        if len(bodies) == 1:
            return [self]
        volumes = [_native.mesh_volume(*body) for body in bodies]
        shells = [(volume, body) for volume, body in zip(volumes, bodies, strict=True) if volume > 0]
        cavities = [body for volume, body in zip(volumes, bodies, strict=True) if volume < 0]
        surfaces = _enclose(shells, cavities) if cavities else [body for _, body in shells]
        return [piece for surface in surfaces if (piece := _component(surface, self)) is not None]


def _surface_of(manifold: Manifold) -> tuple[FloatArray, IntArray]:
    mesh = manifold.to_mesh64()
    vertices = np.ascontiguousarray(mesh.vert_properties[:, :3], dtype=np.float64)
    return vertices, np.ascontiguousarray(mesh.tri_verts, dtype=np.int32)


def _halves(
    surface: tuple[FloatArray, IntArray], axis: int, offset: float
) -> tuple[tuple[FloatArray, IntArray] | None, ...]:
    """Cut a closed surface across an axis of space: what lies below and above, None where it is not cut cleanly."""
    x, y, z = np.eye(3)[axis].tolist()
    sides = (_capped(*side) for side in _native.cut_by_plane(*surface, x, y, z, offset))
    return tuple(side if folded <= NEGLIGIBLE_FOLD else None for side, folded in sides)


def _capped(
    vertices: FloatArray, faces: IntArray, rims: list[IntArray], outlines: list[FloatArray]
) -> tuple[tuple[FloatArray, IntArray], float]:
    """Close a side of a cut in the plane; and the share of the cap that lies upside down."""
    if not rims:
        return (vertices, faces), 0.0
    triangles, folded = _triangulated(outlines)
    surface = np.concatenate([faces, np.concatenate(rims)[triangles]])
    return (vertices, np.ascontiguousarray(surface, dtype=np.int32)), folded


def _triangulated(outlines: list[FloatArray]) -> tuple[IntArray, float]:
    """Triangles [T, 3] of loops in a plane, [R, 2] each, and the share of their area that lies upside down.

    Where loops cross each other, it depends on chance, and on the way round, how far triangles fold.
    """
    points = np.concatenate(outlines)
    triangles = triangulate(outlines)
    folded = _share_upside_down(points, triangles)
    if folded > NEGLIGIBLE_FOLD:
        mirrored = triangulate([outline[::-1, ::-1] for outline in outlines])
        ends = np.cumsum([len(outline) for outline in outlines])
        back = np.concatenate([np.arange(end - 1, end - 1 - len(o), -1) for end, o in zip(ends, outlines, strict=True)])
        other = back[mirrored][:, ::-1]
        if (share := _share_upside_down(points, other)) < folded:
            return other, share
    return triangles, folded


def _share_upside_down(points: FloatArray, triangles: IntArray) -> float:
    a, b, c = (points[corner] for corner in triangles.T)
    area = (b - a)[:, 0] * (c - a)[:, 1] - (b - a)[:, 1] * (c - a)[:, 0]
    total = np.abs(area).sum()
    return float(-area[area < 0].sum() / total) if total > 0 else 0.0


def _component(solid: Manifold | tuple[FloatArray, IntArray], within: Component) -> Component | None:
    if isinstance(solid, Manifold):
        is_empty = solid.is_empty() or solid.volume() <= NEGLIGIBLE_VOLUME
    else:
        is_empty = not len(solid[1]) or _native.mesh_volume(*solid) <= NEGLIGIBLE_VOLUME
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
    """Give every cavity (a shell of negative volume) back to the smallest shell, given with its volume, around it."""
    by_shell = [[surface] for _, surface in shells]
    by_volume = sorted(range(len(shells)), key=lambda i: (shells[i][0], i))
    for cavity in cavities:
        point = cavity[0][:1]
        for i in by_volume:
            if _native.Surface(*shells[i][1]).winding(point)[0] > 0.5:
                by_shell[i].append(cavity)
                break
    return [group[0] if len(group) == 1 else _concatenated(group) for group in by_shell]


def _concatenated(surfaces: list[tuple[FloatArray, IntArray]]) -> tuple[FloatArray, IntArray]:
    firsts = np.cumsum([0, *(len(vertices) for vertices, _ in surfaces[:-1])])
    faces = [own + first for (_, own), first in zip(surfaces, firsts, strict=True)]
    return np.concatenate([vertices for vertices, _ in surfaces]), np.concatenate(faces).astype(np.int32)
