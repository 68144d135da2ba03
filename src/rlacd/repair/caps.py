"""Which holes of a soup are closed: those left by damage, not those made on purpose.

Input: a soup, its input surface, and where a ball can go around it. Output: the soup with caps, and what was capped.

A body is closed only if every one of its holes may be closed: a cap that leaves another hole open would be one more
sheet. A hole may be closed if its cap stays near the surface, if the ball cannot reach it, if it is small relative to
the body, if it is an end of a long bar through which nothing straight passes, or if it is a wound: few edges, and a cap
that smoothly continues the faces around it, as at missing faces. Around the mouth of a bottle, faces turn away from the
cap. A body with many wounds gets its other small holes closed.
A hole with another body all along its rim, such as a counter's with a basin in it, is no wound.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from rlacd._native import poll_stop
from rlacd.repair.distance import SurfaceQuery, affordable, spread_points
from rlacd.repair.holes import LONGEST_EXACT_LOOP, cap
from rlacd.repair.rims import Rims, rims_of
from rlacd.repair.soup import FLAPS, Soup, crossed_parts, face_normals, trust_windings
from rlacd.solid.frame import FloatArray
from rlacd.solid.products import dots
from rlacd.solid.solid import Hole
from rlacd.solid.topology import (
    BoolArray,
    IntArray,
    components,
    face_areas,
    first_of_doubled,
    nondegenerate,
    signed_tetrahedra,
)

HOLE, HOLE_SHARE = 0.1, 0.02
"""A nearly closed body, with holes of at most this share of its area, is closed with caps up to this far away: a scan
with a few holes is meant as a solid, a cup is not. The caps are reported."""

# Limits on a wound's edges and on its share of the area of its body; larger where it is a single missing face.
_WOUND_EDGES, _WOUND, _MISSING_FACE = 12, 0.1, 0.2
# A ring of more edges than this is a mouth, not a wound, if its corners lie on a circle to this accuracy.
_RING, _ROUND = 6, 0.1
# A body with at most this many radii of a ring as volume per area is a tube that ends there, no bottle with a neck.
_TUBE = 0.7
# The caps of a bar have at most this share of its area: it is four times as long as wide, eight times with two open
# ends. These lie nearer to each other than this share of its length: the bar is bent, or has one open end.
_END, _STRAIGHT = 0.06, 0.9
# Along at least this share of its rim, the cap turns by less than this from the adjacent faces (cosine of 45 degrees).
_SMOOTH_SHARE, _SMOOTH = 0.3, 0.7
# If there are this many wounds, and at least this share of all holes, then all holes within these limits are wounds.
_DAMAGED, _DAMAGED_SHARE, _DAMAGED_EDGES, _DAMAGED_WOUND = 4, 0.3, 60, 0.25
# Wounds take at most this share of the remaining area: a cage is not a damaged ball.
_WOUNDS = 0.7
# An open body whose caps would give it this much volume per area is hollow; with less it is a sheet, leaf or cloth.
_ROOMY = 0.02
# A body closed over large wounds may cross itself in this share of its area.
_CROSSED = 0.08


@dataclass(frozen=True)
class Closed:
    """The result of closing holes.

    Attributes
    ----------
    soup
        The faces with the caps. Bodies that share a hole have become one, numbered like the first.
    bodies
        The bodies that were capped.
    by_room
        ``[bodies]``, bodies that were capped only because nothing can reach a cap.
    hidden
        Points ``[N, 3]`` of such caps, away from the surface.
    across
        The unit normals of the caps there, ``[N, 3]``.
    holes
        The holes that were closed, and those of bodies that stay open although caps would give them an inside.
    """

    soup: Soup
    bodies: IntArray
    by_room: BoolArray
    hidden: FloatArray
    across: FloatArray
    holes: list[Hole]


def close_holes(
    soup: Soup,
    bodies: int,
    surface: SurfaceQuery,
    covers: Callable[[FloatArray], BoolArray],
    gap: float,
    thickness: float,
    fill: bool = False,
    bend: float = 1.0,
    fins: bool = False,
) -> Closed | None:
    """Cap the bodies all of whose holes may be closed.

    Parameters
    ----------
    soup
        The faces.
    bodies
        Number of bodies.
    surface
        The surface that caps must stay near.
    covers
        Whether the ball can reach given points.
    gap
        Distance from the surface up to which caps are always allowed.
    thickness
        A body with less volume per area has no inside.
    fill
        Close every body that has an inside once closed, even if something can get in.
    bend
        Weight of bending in caps; see `cap`.
    fins
        Do nothing unless fins hang on rims, and take them for flaps.

    Returns
    -------
    Closed or None
        None if there is no hole.
    """
    rims = rims_of(soup, fins)
    if not rims.loops or (fins and not rims.fins):
        return None
    caps, owner = _caps(soup, rims, bend)
    first_body = np.array([soup.body[beside[0]] for beside in rims.beside])
    lengths = [len(loop) for loop in rims.loops]
    _, group = components(bodies, np.repeat(first_body, lengths), soup.body[np.concatenate(rims.beside)])
    _, first = np.unique(group, return_index=True)
    joined = first[group]  # the first of the bodies that share holes
    loop_body = joined[first_body]
    body = joined[soup.body]

    cap_area = face_areas(soup.vertices, caps)
    body_area = np.bincount(body, soup.area, bodies)
    points, on = spread_points(soup.vertices, caps, affordable(gap / 2, cap_area.sum()))
    # Corners lie on the surface, and how far points are matters only beyond a certain distance.
    beyond = (np.linalg.norm(points[:, None] - soup.vertices[caps[on]], axis=2) > min(gap, HOLE)).all(axis=1)
    distance = np.zeros(len(points))
    distance[beyond] = surface.distance(points[beyond])
    far = distance > gap
    unreachable = far.copy()
    if far.any() and not fill:
        far[far] = covers(points[far])
        unreachable &= ~far
    place = owner[on]  # the loop of a point
    by_loop = np.bincount(owner, cap_area, len(rims.loops))
    depth = np.zeros(len(rims.loops))
    np.maximum.at(depth, place, distance)
    smooth = _smooth_share(soup, rims, caps, owner) >= _SMOOTH_SHARE
    ring = np.array([len(loop) > _RING and _is_round(soup.vertices[loop]) for loop in rims.loops])
    wound = _wounds(rims, smooth, ring, by_loop / body_area[loop_body], depth)
    wound &= ~_plugged(soup, rims, body, loop_body, wound & (depth > gap), gap)
    wound &= (cap_area * wound[owner]).sum() <= _WOUNDS * soup.area.sum()
    # The volume that all caps together would enclose, by the windings found.
    sign = np.where(rims.inverted, -1, 1) * ~rims.flap
    enclosed = np.bincount(body, sign * signed_tetrahedra(soup.vertices, soup.faces), bodies)
    enclosed += np.bincount(loop_body[owner], signed_tetrahedra(soup.vertices, caps), bodies)
    # A tube has half its radius of volume per area; a bottle, which is wider than its neck, has more.
    radius = np.sqrt(by_loop / np.pi)
    tube = np.abs(enclosed / np.maximum(body_area, np.finfo(float).tiny))[loop_body] <= _TUBE * radius
    share = (np.bincount(loop_body[owner], cap_area, bodies) / np.maximum(body_area, np.finfo(float).tiny))[loop_body]
    hole = ((share <= HOLE_SHARE) & (smooth | ~ring | tube)) | _ends(
        soup, rims, loop_body, body_area.astype(float), radius, tube & (share <= _END)
    )
    excused = wound[place] | (hole[place] & (distance <= HOLE))
    chosen = np.zeros(bodies, dtype=bool)
    chosen[loop_body] = True
    if not fill:
        chosen[loop_body[place[far & ~excused]]] = False

    def capped() -> tuple[Soup, BoolArray]:
        some, whole = chosen[loop_body[owner]], chosen[body]
        turned = np.where((whole & rims.inverted)[:, None], soup.faces[:, ::-1], soup.faces)
        faces = np.concatenate([turned, caps[some]])
        owners = np.concatenate([np.where(whole, body, soup.body), loop_body[owner][some]])
        no_cap = np.zeros(int(some.sum()), dtype=bool)
        kept = first_of_doubled(faces, len(soup.vertices))
        # Where more than two faces met before, which of them continue each other is a guess: caps did not cause that.
        sure = whole & ~rims.flap & ~soup.at_valence(soup.edges.valence > 2)
        before = ~whole & (False if soup.trusted is None else soup.trusted)
        trusted = np.concatenate([sure | before, ~no_cap])
        flap = np.concatenate([rims.flap, no_cap])[kept]
        return trust_windings(Soup(soup.vertices, faces, owners, trusted).only(kept), bodies, flap, _CROSSED), flap

    # A cap is useful only if it gives the body an inside: a strip whose cap lies on itself stays a sheet.
    trial, flap = capped()
    tried = chosen.copy()
    volume = np.bincount(trial.body_of_side, np.maximum(trial.sides.volume, 0), bodies)
    chosen &= volume > thickness * np.bincount(trial.body, trial.area, bodies)
    chosen &= trial.sheet_share(bodies, flap) <= FLAPS
    # Nor where caps of large wounds cross the body: what is inside out there would be cut into ever more pieces.
    for one in np.unique(loop_body[place[far & wound[place]]]).tolist():
        some = (trial.body == one) & ~flap
        chosen[one] &= not chosen[one] or crossed_parts(trial.only(some)) <= _CROSSED
    refused = np.setdiff1d(loop_body, np.flatnonzero(chosen))
    by_room = np.zeros(bodies, dtype=bool)
    by_room[loop_body[place[unreachable & ~excused]]] = True
    hollow = refused[np.abs(enclosed[refused]) > _ROOMY * body_area[refused]]
    reached = np.zeros(len(rims.loops))
    np.maximum.at(reached, place[far], distance[far])
    holes = _holes(soup, rims, loop_body, chosen[loop_body], smooth, reached)
    result = (trial if (chosen == tried).all() else capped()[0]) if chosen.any() else soup
    hidden = np.flatnonzero(unreachable & ~excused & chosen[loop_body[place]])
    # Slender faces have many points; one of each cell is enough.
    hidden = hidden[np.unique(np.floor(points[hidden] * (2 / gap)), axis=0, return_index=True)[1]]
    across = face_normals(soup.vertices, caps[on[hidden]])
    return Closed(
        result,
        np.flatnonzero(chosen[joined]),
        by_room & chosen,
        points[hidden],
        across,
        [hole for hole in holes if hole.is_closed or hole.body in hollow],
    )


def _ends(
    soup: Soup,
    rims: Rims,
    loop_body: IntArray,
    area: FloatArray,
    radius: FloatArray,
    small: BoolArray,
) -> BoolArray:
    """Return ``[L]`` which loops are the ends of bars; all of a body's have to be `small` openings of a tube."""
    centre = np.array([soup.vertices[loop].mean(axis=0) for loop in rims.loops])
    _, first = np.unique(loop_body, return_index=True)
    of_body = np.zeros(len(area), dtype=np.int64)
    of_body[loop_body[first]] = first
    apart = np.linalg.norm(centre - centre[of_body[loop_body]], axis=1)
    odd = ~small | (2 * np.pi * radius * apart > _STRAIGHT * area[loop_body])
    ends: BoolArray = np.bincount(loop_body, odd, len(area))[loop_body] == 0
    return ends


def _holes(
    soup: Soup, rims: Rims, body: IntArray, closed: BoolArray, smooth: BoolArray, depth: FloatArray
) -> list[Hole]:
    """Describe the loops, given the body of each, whether it was closed, and how far its cap leads away."""
    lengths = np.array([len(loop) for loop in rims.loops])
    loop = np.repeat(np.arange(len(lengths)), lengths)
    corners = soup.vertices[np.concatenate(rims.loops)]
    centre = np.stack([np.bincount(loop, corners[:, axis]) for axis in range(3)], axis=1) / lengths[:, None]
    width = np.zeros(len(lengths))
    np.maximum.at(width, loop, 2 * np.linalg.norm(corners - centre[loop], axis=1))
    columns = (body.tolist(), map(tuple, centre.tolist()), width.tolist(), closed.tolist(), smooth.tolist())
    return [Hole(*row) for row in zip(*columns, np.where(closed, depth, 0.0).tolist(), strict=True)]


def _caps(soup: Soup, rims: Rims, bend: float) -> tuple[IntArray, IntArray]:
    """Triangulate the loops; if bending counts, no two across the same edge if possible.

    Returns the faces ``[C, 3]``, without those with a repeated vertex, and the loop ``[C]`` of each.
    """
    count = len(soup.vertices)
    edges = soup.edges.vertices @ np.array([count, 1])  # in ascending order
    across: dict[int, list[int]] = {}
    caps = []
    for loop, beside in zip(rims.loops, rims.beside, strict=True):
        poll_stop()
        taken = None
        if bend and 3 < len(loop) <= LONGEST_EXACT_LOOP:
            low, high = np.minimum(loop[:, None], loop), np.maximum(loop[:, None], loop)
            at = np.minimum(np.searchsorted(edges, low * count + high), len(edges) - 1)
            taken = (edges[at] == low * count + high) | (low == high)
            places: dict[int, list[int]] = {}
            for i, vertex in enumerate(loop.tolist()):
                places.setdefault(vertex, []).append(i)
            for i, vertex in enumerate(loop.tolist()):
                taken[i, [place for other in across.get(vertex, ()) for place in places.get(other, ())]] = True
        caps.append(loop[cap(soup.vertices[loop], rims.normals[beside], taken, bend)])
        if len(loop) > 3:
            for a, b, c in caps[-1].tolist():
                across.setdefault(a, []).extend((b, c))
                across.setdefault(b, []).extend((c, a))
                across.setdefault(c, []).extend((a, b))
    owner = np.repeat(np.arange(len(caps)), [len(some) for some in caps])
    faces = np.concatenate(caps)
    real = nondegenerate(faces)
    return faces[real], owner[real]


def _smooth_share(soup: Soup, rims: Rims, caps: IntArray, owner: IntArray) -> FloatArray:
    """Return ``[L]`` the share of each loop along which its cap continues the adjacent faces."""
    normal = face_normals(soup.vertices, caps)
    # The cap's face at each edge of the rim, found by loop and edge.
    count = len(soup.vertices)
    key = ((caps * count + np.roll(caps, -1, axis=1)) + owner[:, None] * count**2).ravel()
    tail = np.concatenate(rims.loops)
    head = np.concatenate([np.roll(loop, -1) for loop in rims.loops])
    loop_of = np.repeat(np.arange(len(rims.loops)), [len(loop) for loop in rims.loops])
    order = np.argsort(key, kind="stable")
    wanted = head * count + tail + loop_of * count**2
    at = np.minimum(np.searchsorted(key[order], wanted), len(key) - 1)
    cosine = dots(rims.normals[np.concatenate(rims.beside)], normal[order[at] // 3])
    smooth = (cosine > _SMOOTH) & (key[order][at] == wanted)
    length = np.linalg.norm(soup.vertices[head] - soup.vertices[tail], axis=1)
    share: FloatArray = np.bincount(loop_of, length * smooth) / np.bincount(loop_of, length)
    return share


def _wounds(rims: Rims, smooth: BoolArray, ring: BoolArray, part: FloatArray, depth: FloatArray) -> BoolArray:
    """Return ``[L]`` whether each loop bounds missing faces; see the module.

    `part` is the area of its cap as a share of its body's, `depth` how far the cap leads away from the surface.
    """
    number = np.array([len(loop) for loop in rims.loops])
    wound: BoolArray = ((number == 3) & (part <= _MISSING_FACE)) | (
        (number <= _WOUND_EDGES) & smooth & (part <= _WOUND)
    )
    if wound.sum() >= max(_DAMAGED, _DAMAGED_SHARE * len(wound)):
        small = (part <= HOLE_SHARE) | (depth <= HOLE) | (smooth & (part <= _DAMAGED_WOUND))
        return wound | ((number <= _DAMAGED_EDGES) & small)
    return wound & ~ring


def _plugged(soup: Soup, rims: Rims, body: IntArray, loop_body: IntArray, asked: BoolArray, gap: float) -> BoolArray:
    """Return ``[L]`` which of the loops asked for have another body, such as a basin in a counter, all along them."""
    plugged = np.zeros(len(loop_body), dtype=bool)
    for one in np.unique(loop_body[asked]).tolist():
        others = soup.faces[body != one]
        if len(others) == 0:
            continue
        query = SurfaceQuery(soup.vertices, others)
        for loop in np.flatnonzero(asked & (loop_body == one)).tolist():
            poll_stop()
            corners = soup.vertices[rims.loops[loop]]
            middles = (corners + np.roll(corners, -1, axis=0)) / 2
            plugged[loop] = (query.distance(np.concatenate([corners, middles])) <= gap).all()
    return plugged


def _is_round(points: FloatArray) -> bool:
    radii = np.linalg.norm(points - points.mean(axis=0), axis=1)
    return bool(radii.std() <= _ROUND * radii.mean())
