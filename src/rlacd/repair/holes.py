"""Which holes of a soup are closed: those left by damage, not those made on purpose.

A body is closed only if every one of its holes may be closed: a cap that leaves another hole open would be one more
sheet. Whether a hole may be closed is decided by the first of these questions that is answered with yes:

- Does its cap stay near the surface, or where the ball cannot reach it?
- Is it damage? Where faces are missing, few edges surround a cap that smoothly continues the faces around it. Around
  the mouth of a bottle, faces turn away from the cap. In a damaged mesh, other small holes are damage too; elsewhere, a
  round ring is not. A hole with another body all along its rim, such as a counter's with a basin in it, never is.
- Is it small beside its body, and its cap not far from the surface? Where a tube ends, it may be larger if it is the
  only hole: one end of a bar may be open where it was joined to something. A pipe has two.
- If asked, as of links of robots: does the cap cover little of the body, seen along its normal? A bucket's covers all.
"""

from __future__ import annotations

import numpy as np

from rlacd._native import components, face_areas, long_normals, poll_stop, signed_tetrahedra, spread_points
from rlacd.repair.cracks import MOST_FREE_EDGES
from rlacd.repair.distance import SurfaceQuery, affordable, is_tangle
from rlacd.repair.rims import Rims, caps_of, rims_of
from rlacd.repair.soup import FLAPS, Soup
from rlacd.repair.state import State
from rlacd.report import Hole
from rlacd.solid.arrays import BoolArray, FloatArray, Int64Array, dots, length
from rlacd.solid.frame import HALF_THICKNESS
from rlacd.solid.hull import Hull
from rlacd.solid.topology import compacted, first_of_doubled, marked

HOLE, HOLE_SHARE = 0.1, 0.02
"""A body is closed if its caps lead at most this far away from the surface and have at most this share of its area: a
scan with a few holes is meant as a solid, a cup is not. The caps are reported."""

# The same share for the one open end of a bar, which is then four times as long as wide.
_END = 3 * HOLE_SHARE
# A ring of more edges than this is a mouth, not damage, if its corners lie on a circle to this accuracy.
_RING, _ROUND = 6, 0.1
# A tube's volume per area is half the radius of the hole at its end, to this accuracy; a bottle, wider than its neck,
# has more, and folded sheets have less.
_TUBE = 2 * _ROUND
# Limits on the edges of damage and on its share of the area of its body.
_DAMAGE_EDGES, _DAMAGE = 2 * _RING, 5 * HOLE_SHARE
# A mesh is damaged if at least this many of its holes, and `_GOOD_PART` of them, are damage.
_DAMAGED = 4
# Share of the rim along which the cap of damage continues the faces.
_GOOD_PART = 0.3
COVERED = 0.6
"""An opening is small beside its body if the cap is at most this share of the shadow of the body's hull along the cap's
normal. Mouths of buckets, cups and tubes have 1."""


class _Caps:
    """The holes of a soup, and the caps that would close them.

    Attributes
    ----------
    body : int64 [H]
        The first of the bodies that share a hole.
    depth, reached, hidden : float64 [H]
        How far the cap leads away from the surface: anywhere; where the ball can, and cannot, reach it (0 if near).
    is_smooth : bool [H]
        Whether the cap continues the faces around it.
    """

    def __init__(self, state: State, rims: Rims) -> None:
        soup, bodies = state.soup, state.bodies
        self._state, self._soup, self._rims, self._bodies = state, soup, rims, bodies
        self._gap = state.wanted.gap
        self._faces, self._hole_of, smooth = caps_of(soup, rims)
        first_body = np.array([soup.body[beside[0]] for beside in rims.beside])
        lengths = np.array([len(loop) for loop in rims.loops])
        _, group = components(bodies, np.repeat(first_body, lengths), soup.body[np.concatenate(rims.beside)])
        _, first = np.unique(group, return_index=True)
        self.joined = first[group]  # the first of the bodies that share holes
        self._body, self.body = self.joined[soup.body], self.joined[first_body]
        self._area = np.bincount(self._body, soup.area, bodies)
        self.depth, self.reached, self.hidden = self._depths()
        self.is_smooth = smooth >= _GOOD_PART
        self._classify(lengths)

    def _depths(self) -> FloatArray:
        """Return ``[3, H]``, see the attributes."""
        gap, vertices, wanted = self._gap, self._soup.vertices, self._state.wanted
        spacing = affordable(gap / 2, vertices, self._faces)
        points, on = spread_points(vertices, self._faces, spacing)
        distance = self._state.surface.distance(points)
        is_reached = is_far = distance > gap
        # Where cavities are kept, balls start in them too, and every point counts as reached.
        if is_far.any() and wanted.open_bodies != "solid" and not wanted.keep_cavities:
            is_reached = is_far.copy()
            is_reached[is_far] = self._state.reach.covers(points[is_far])
        depths = np.zeros((3, len(self.body)))
        for depth, some in zip(depths, (is_far | True, is_reached, is_far & ~is_reached), strict=True):
            np.maximum.at(depth, self._hole_of[on[some]], distance[some])
        return depths

    def _classify(self, lengths: Int64Array) -> None:
        """Tell holes that missing faces left from mouths, and from ends of tubes, given the lengths of their loops."""
        soup, rims, own, smooth = self._soup, self._rims, self.body, self.is_smooth
        tiny = np.finfo(float).tiny
        signed = np.where(rims.inverted, -1, 1) * signed_tetrahedra(soup.vertices, soup.faces)
        of_caps = np.bincount(own[self._hole_of], signed_tetrahedra(soup.vertices, self._faces), self._bodies)
        self._volume = np.abs(np.bincount(self._body, signed, self._bodies) + of_caps)  # that all caps would close in
        body_area = np.maximum(self._area[own], tiny)
        cap_area = np.bincount(self._hole_of, face_areas(soup.vertices, self._faces), len(own))
        share, of_all = cap_area / body_area, np.bincount(own, cap_area, self._bodies)[own] / body_area
        is_ring = np.array([len(loop) > _RING and _is_round(soup.vertices[loop]) for loop in rims.loops])
        radius = np.sqrt(np.maximum(cap_area, tiny) / np.pi)
        is_tube = np.abs(self._volume[own] / body_area / radius - 0.5) <= _TUBE
        is_end = is_tube & (np.bincount(own)[own] == 1)
        self._is_small = (smooth | ~is_ring | is_tube) & (of_all <= np.where(is_end, _END, HOLE_SHARE))
        # It looks as if faces were missing: small, with few edges, and smooth or a single triangle.
        damage = (lengths <= _DAMAGE_EDGES) & (share <= _DAMAGE) & (smooth | (lengths == 3))
        if damage.sum() >= max(_DAMAGED, _GOOD_PART * len(own)):
            damage |= ((share <= HOLE_SHARE) | (self.depth <= HOLE) | smooth) & (share <= _DAMAGE)
        else:
            damage &= ~is_ring
        for hole in np.flatnonzero(damage & (self.depth > self._gap)).tolist():
            damage[hole] = not self._is_plugged(hole)
        self._is_damage = damage

    def _is_plugged(self, hole: int) -> bool:
        """Whether another body, such as a basin, lies all along a hole."""
        others = self._soup.faces[self._body != self.body[hole]]
        corners = self._soup.vertices[self._rims.loops[hole]]
        middles = (corners + np.roll(corners, -1, axis=0)) / 2
        poll_stop()
        if len(others) == 0:
            return False
        distance = SurfaceQuery(self._soup.vertices, others).distance(np.concatenate([corners, middles]))
        return bool((distance <= self._gap).all())

    def leading_away(self, depth: FloatArray) -> BoolArray:
        """Return ``[bodies]`` the bodies with a cap that leads farther away from the surface, ``[H]``, than it may."""
        may_lead = self._is_damage | (self._is_small & (depth <= HOLE))
        if self._state.wanted.open_bodies == "small":
            open_ = np.flatnonzero((depth > 0) & ~may_lead)
            may_lead[open_] = self._covered(open_) <= COVERED
        return marked(self.body[(depth > 0) & ~may_lead], self._bodies)

    def _covered(self, holes: Int64Array) -> FloatArray:
        """Areas of the caps of holes, as shares of the shadows of their bodies' hulls along the caps' normals."""
        soup, tiny = self._soup, float(np.finfo(float).tiny)
        hulls = {one: Hull.of(compacted(soup.vertices, soup.faces[self._body == one])[0]) for one in self.body[holes]}
        shares = []
        for hole in holes.tolist():
            cap = long_normals(soup.vertices, self._faces[self._hole_of == hole])  # twice as long as areas
            normal, hull = cap.sum(axis=0), hulls[self.body[hole]]
            around = cap[:0] if hull is None else long_normals(hull.vertices, hull.faces.astype(np.int64))
            shadow = np.abs(dots(around, normal)).sum() / 2 / max(length(normal), tiny)
            shares.append(np.sqrt(dots(cap, cap)).sum() / max(shadow, tiny))
        return np.array(shares)

    def added(self, chosen: BoolArray) -> Soup:
        """The soup with the caps of chosen bodies ``[bodies]``."""
        soup, rims, own = self._soup, self._rims, self.body[self._hole_of]
        some, whole = chosen[own], chosen[self._body]
        turned = np.where((whole & rims.inverted)[:, None], soup.faces[:, ::-1], soup.faces)
        faces = np.concatenate([turned, self._faces[some]])
        owners = np.concatenate([np.where(whole, self._body, soup.body), own[some]])
        return Soup(soup.vertices, faces, owners).only(first_of_doubled(faces, len(soup.vertices)))

    def useful(self, chosen: BoolArray, closed: Soup) -> BoolArray:
        """Return ``[bodies]`` the chosen bodies to which caps give an inside: a strip whose cap lies on it has none."""
        volume = np.bincount(closed.body_of_side, np.maximum(closed.sides.volume, 0), self._bodies)
        has_volume = volume > HALF_THICKNESS / 2 * np.bincount(closed.body, closed.area, self._bodies)
        has_inside = np.asarray(chosen & has_volume & (closed.share(closed.sides.sheet, self._bodies) <= FLAPS))
        # Caps that lead away from the surface may cross the body, and turn it inside out in places.
        for one in np.flatnonzero(marked(self.body[self.depth > self._gap], self._bodies) & has_inside):
            faces = closed.faces[closed.body == one]
            outward = faces if signed_tetrahedra(closed.vertices, faces).sum() > 0 else faces[:, ::-1]
            has_inside[one] = not is_tangle(SurfaceQuery(closed.vertices, outward))
        return has_inside

    def described(self, chosen: BoolArray) -> list[Hole]:
        """The holes of chosen bodies ``[bodies]``, and those of bodies to which caps would give an inside.

        First those where more of the body may be missing: a smooth cap is likely right.
        """
        said = chosen | (self._volume > self._gap * self._area)  # less is a leaf or cloth
        frame, found = self._state.frame, []
        for hole in np.flatnonzero(said[self.body]).tolist():
            corners = self._soup.vertices[self._rims.loops[hole]]
            width = 2 * float(np.linalg.norm(corners - corners.mean(axis=0), axis=1).max())
            x, y, z = frame.to_input(corners.mean(axis=0)).tolist()
            body = int(self.body[hole])
            listed = Hole(body, (x, y, z), width / frame.scale, bool(chosen[body]))
            found.append(((0.0 if self.is_smooth[hole] else width, width), listed))
        return [listed for _, listed in sorted(found, key=lambda one: one[0], reverse=True)]


def close_holes(state: State) -> None:
    """Cap the bodies all of whose holes may be closed."""
    free = int((state.soup.edges.face_count == 1).sum())
    if not 0 < free <= MOST_FREE_EDGES or state.wanted.open_bodies == "thin":
        return
    rims = rims_of(state.soup)
    if not rims.loops:
        return
    caps = _Caps(state, rims)
    chosen = marked(caps.body, state.bodies)
    if state.wanted.open_bodies != "solid":
        chosen &= ~caps.leading_away(caps.reached)
    closed = caps.added(chosen)
    useful = caps.useful(chosen, closed)
    state.note(np.flatnonzero(useful[caps.joined]), "capped")
    state.by_hidden_caps |= useful & caps.leading_away(caps.hidden)
    state.holes = caps.described(useful)
    state.deepest_cap = float(caps.reached.max(where=useful[caps.body], initial=0.0))
    state.soup = closed if (useful == chosen).all() else caps.added(useful)


def _is_round(points: FloatArray) -> bool:
    radii = np.linalg.norm(points - points.mean(axis=0), axis=1)
    return bool(radii.std() <= _ROUND * radii.mean())
