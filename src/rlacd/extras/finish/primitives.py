"""Parts that become a box, sphere, capsule or cylinder: fitted around the hull, kept if the criterion is still met."""

from __future__ import annotations

import itertools
from collections.abc import Collection, Iterable, Iterator
from dataclasses import replace

import numpy as np

from rlacd import _native
from rlacd.criteria import Criterion
from rlacd.extras.primitive import Primitive
from rlacd.options.names import PRIMITIVE_KINDS, PrimitiveKind
from rlacd.options.presets import HullLimits
from rlacd.solid.arrays import FloatArray, heights, length
from rlacd.solid.component import Part
from rlacd.solid.hull import Hull, keeps

SIMPLER = 1.25
"""A simpler primitive is preferred unless its volume exceeds that of the tightest by this factor."""

DIRECTIONS = 12
"""Normals of facets tried as axes, and half as many edges, largest first, beside principal axes and the frame's."""

SAME_DIRECTION = 0.9998
"""Two directions with at least this cosine between them (1 degree) are tried once."""

ROUND_AXES = DIRECTIONS // 3
"""Axes about which capsules and cylinders are fitted: those with the least volume by a lower bound."""

SINGULAR = 1e-12
"""Share of a squared length at which a point lies in the affine hull of others."""

RADII = np.linspace(1.0, 1.4, 21)
"""Radii of capsules tried, as multiples of the least: a wider capsule may be shorter."""


def primitive_part(
    part: Part,
    criterion: Criterion,
    kinds: Collection[PrimitiveKind],
    limits: HullLimits,
    slack: float,
) -> Part:
    """Get the part with a primitive for a hull, if one meets the criterion; otherwise the same part.

    Of all that meet it, the simplest is taken whose volume is within `SIMPLER` of the least. The hull of the result is
    a convex polyhedron around the primitive, within the limits. The criterion decides on it as strictly as on any hull,
    except that its volume is the primitive's own.

    Parameters
    ----------
    part : Part
    criterion : Criterion
    kinds : collection of str
        The kinds to choose from.
    limits : HullLimits, optional
        Limits on the polyhedron.
    slack : float
        How much larger a primitive is made than needed, for later rounding.
    """
    fitted = [
        primitive.grown(primitive.beyond(part.hull.vertices) + slack) for primitive in fit_primitives(part.hull, kinds)
    ]

    def judged(primitive: Primitive) -> Part | None:
        for corners in primitive.polyhedra():
            hull = Hull.of(np.ascontiguousarray(corners))
            if hull is None or not keeps(hull, limits):
                return None
            around = replace(hull, volume=primitive.volume, primitive=primitive)
            candidate = part.with_hull(around)
            if criterion.is_met(candidate):
                return candidate
        return None

    fitted.sort(key=lambda primitive: primitive.volume)
    for place, tightest in enumerate(fitted):
        found = judged(tightest)
        if found is None:
            continue
        simpler = [
            other
            for other in fitted[place + 1 :]
            if other.volume <= SIMPLER * tightest.volume and _rank(other) < _rank(tightest)
        ]
        return next((better for better in map(judged, sorted(simpler, key=_rank)) if better is not None), found)
    return part


def fit_primitives(hull: Hull, kinds: Collection[PrimitiveKind] = PRIMITIVE_KINDS) -> list[Primitive]:
    """Fit a primitive of each kind around a hull, with little volume.

    The sphere is the smallest. The box is the smallest of those with an edge along one of the candidate axes, which
    include the normals of the largest facets; capsules and cylinders are the smallest about candidate axes.
    """
    points = hull.vertices
    fitted: list[Primitive] = []
    if "sphere" in kinds:
        centre, radius = smallest_ball(points)
        fitted.append(Primitive("sphere", centre, np.eye(3), (radius,)))
    if not {"box", "capsule", "cylinder"} & set(kinds):
        return fitted
    seen = [_Shadow(points, axis) for axis in _candidate_axes(hull)]
    shadows = [shadow for shadow in seen if len(shadow.outline) > 2]  # not a line up to rounding
    if not shadows:
        return fitted
    if "box" in kinds:
        fitted.append(_least(shadow.box() for shadow in shadows))
    shadows = sorted(shadows, key=lambda shadow: shadow.area * shadow.length)[:ROUND_AXES]
    circles = [(shadow, *smallest_ball(shadow.outline)) for shadow in shadows]
    if "cylinder" in kinds:
        fitted.append(_least(shadow.cylinder(centre, radius) for shadow, centre, radius in circles))
    if "capsule" in kinds:
        fitted.append(_least(shadow.capsule(centre, radius) for shadow, centre, radius in circles))
    return fitted


def smallest_ball(points: FloatArray) -> tuple[FloatArray, float]:
    """The smallest ball around points [N, D]: centre [D] and radius.

    Farthest points join the support set one at a time, and the smallest ball of the set is found among the
    circumscribed balls of its subsets (Gärtner, "Fast and Robust Smallest Enclosing Balls", ESA 1999).
    """
    support = points[:1]
    centre, radius = points[0], 0.0
    for _ in range(1000):
        distances = np.linalg.norm(points - centre, axis=1)
        farthest = int(distances.argmax())
        if distances[farthest] <= radius * (1 + 1e-12):
            break
        support, larger = _least_support(np.vstack([points[farthest], support]))
        if larger[1] <= radius:  # rounding leaves nothing to gain
            return centre, float(distances.max())
        centre, radius = larger
    return centre, radius


def _least_support(points: FloatArray) -> tuple[FloatArray, tuple[FloatArray, float]]:
    """The subset of a few points, the first among it, whose circumscribed ball is the smallest around all of them."""
    balls = []
    for size in range(1, min(len(points), points.shape[1] + 1) + 1):
        for rest in itertools.combinations(range(1, len(points)), size - 1):
            subset = points[[0, *rest]]
            offsets = subset[1:] - subset[0]
            products = (offsets[:, None] * offsets).sum(axis=2)
            shares = _solved(products, products.diagonal() / 2)
            if shares is None:
                continue  # a smaller subset has the same affine hull
            centre = subset[0] + (np.array(shares)[:, None] * offsets).sum(axis=0)
            distances = np.linalg.norm(points - centre, axis=1)
            radius = float(distances[[0, *rest]].max())
            if distances.max() <= radius * (1 + 1e-10):
                balls.append((subset, (centre, float(distances.max()))))
    return min(balls, key=lambda ball: ball[1][1])


def _solved(matrix: FloatArray, right: FloatArray) -> list[float] | None:
    """Solve positive definite equations [N, N], [N] by Gauss's elimination; None if singular up to rounding."""
    rows = [[*row, value] for row, value in zip(matrix.tolist(), right.tolist(), strict=True)]
    for k, pivot in enumerate(rows):
        if not pivot[k] > SINGULAR * float(matrix[k, k]):
            return None
        pivot[:] = [value / pivot[k] for value in pivot]
        for row in rows[:k] + rows[k + 1 :]:
            row[:] = [value - row[k] * other for value, other in zip(row, pivot, strict=True)]
    return [row[-1] for row in rows]


class _Shadow:
    """A hull seen along an axis: the outline of its projection, and its extent along the axis.

    Attributes
    ----------
    outline : float64 [N, 2]
        Corners of the projection's convex hull, counter-clockwise.
    area, length : float
    """

    def __init__(self, points: FloatArray, axis: FloatArray) -> None:
        self._axes = axes = _axes_along(axis)
        self._points = heights(points, np.ascontiguousarray(axes.T))
        seen = np.ascontiguousarray(self._points[:, :2])
        self.outline = outline(seen)
        x, y = (self.outline - seen[0]).T
        self.area = float((np.roll(y, -1) * x - np.roll(x, -1) * y).sum()) / 2
        along = self._points[:, 2]
        self._middle = float(along.min() + along.max()) / 2
        self.length = float(np.ptp(along))

    def box(self) -> Primitive:
        """The smallest box with edges along the axis: a side of its base lies along one of the outline."""
        sides = np.roll(self.outline, -1, axis=0) - self.outline
        sides /= np.linalg.norm(sides, axis=1)[:, None]
        across = np.stack([-sides[:, 1], sides[:, 0]], axis=1)
        u, v = self.outline.T[:, :, None]
        extents = [u * directions[:, 0] + v * directions[:, 1] for directions in (sides, across)]
        widths = [np.ptp(extent, axis=0) for extent in extents]
        best = int((widths[0] * widths[1]).argmin())
        base = np.eye(3)
        base[:2, 0], base[:2, 1] = sides[best], across[best]
        middle = [float(extent[:, best].min() + extent[:, best].max()) / 2 for extent in extents]
        axes = heights(self._axes, np.ascontiguousarray(base.T))
        size = float(widths[0][best]), float(widths[1][best]), self.length
        return Primitive("box", heights(axes, np.array([*middle, self._middle])), axes, size)

    def cylinder(self, centre: FloatArray, radius: float) -> Primitive:
        """The smallest cylinder along the axis, given the smallest circle around the outline."""
        place = heights(self._axes, np.array([*centre, self._middle]))
        return Primitive("cylinder", place, self._axes, (radius, self.length))

    def capsule(self, centre: FloatArray, radius: float) -> Primitive:
        """The smallest capsule about the circle's axis."""
        away = ((self._points[:, :2] - centre) ** 2).sum(axis=1)

        def of_radius(wider: float) -> Primitive:
            reach = np.sqrt(np.maximum(wider**2 - away, 0.0))  # of the ends' spheres beyond their centres
            first, last = float((self._points[:, 2] + reach).min()), float((self._points[:, 2] - reach).max())
            place = heights(self._axes, np.array([*centre, (first + last) / 2]))
            return Primitive("capsule", place, self._axes, (wider, max(last - first, 0.0)))

        return _least(map(of_radius, (radius * RADII).tolist()))


def outline(points: FloatArray) -> FloatArray:
    """Corners [K, 2] of the convex hull of points [N, 2], counter-clockwise; none if they lie on a line."""
    prism = Hull.of(np.column_stack([np.tile(points, (2, 1)), np.repeat([0.0, 1.0], len(points))]))
    if prism is None:
        return points[:0]
    corners = prism.vertices[prism.vertices[:, 2] == 0, :2]
    x, y = (corners - corners.mean(axis=0)).T
    return corners[np.argsort(_native.angles(np.ascontiguousarray(y), np.ascontiguousarray(x)))]


def _candidate_axes(hull: Hull) -> FloatArray:
    """Directions [N, 3] along which a primitive may lie: of large facets and long edges, principal, and the frame's."""
    corners = hull.vertices[hull.faces]
    edges = (np.roll(corners, -1, axis=1) - corners).reshape(-1, 3)
    crosses = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    principal = _native.principal_axes_of_points(hull.vertices)[::-1]  # the shortest first
    groups = (
        _distinct(crosses, DIRECTIONS, together=True),
        _distinct(edges, DIRECTIONS // 2),
        [*principal, *np.eye(3)],
    )
    return np.array(list(_new_directions(itertools.chain(*groups))))


def _distinct(vectors: FloatArray, most: int, together: bool = False) -> list[FloatArray]:
    """The directions of the longest vectors [N, 3]; `together`, of the largest sums of parallel ones."""
    lengths = np.linalg.norm(vectors, axis=1)
    vectors, lengths = vectors[lengths > 0], lengths[lengths > 0]
    if together:
        units = vectors / lengths[:, None]
        # Coplanar triangles have equal normals up to rounding, and opposite facets are one direction.
        units *= np.where(np.abs(units).max(axis=1) == units.max(axis=1), 1.0, -1.0)[:, None]
        _, first, group = np.unique(np.round(units, 4), axis=0, return_index=True, return_inverse=True)
        lengths = np.bincount(group.ravel(), weights=lengths)
        vectors = units[first]
    order = np.argsort(-lengths, kind="stable")
    return list(itertools.islice(_new_directions(iter(vectors[order])), most))


def _new_directions(vectors: Iterator[FloatArray]) -> Iterator[FloatArray]:
    """Unit vectors, without those nearly parallel to an earlier one."""
    seen = np.zeros((0, 3))
    for vector in vectors:
        unit = vector / length(vector)
        if not (np.abs(heights(seen, unit)) > SAME_DIRECTION).any():
            seen = np.vstack([seen, unit])
            yield unit


def _axes_along(axis: FloatArray) -> FloatArray:
    """A rotation whose third column is the axis."""
    across = np.zeros(3)
    across[int(np.abs(axis).argmin())] = 1.0
    x = np.cross(across, axis)
    x /= length(x)
    return np.stack([x, np.cross(axis, x), axis], axis=1)


def _rank(primitive: Primitive) -> int:
    return PRIMITIVE_KINDS.index(primitive.kind)


def _least(primitives: Iterable[Primitive]) -> Primitive:
    return min(primitives, key=lambda primitive: primitive.volume)
