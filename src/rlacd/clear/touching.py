"""Where hulls of two bodies touch, though the bodies do not: exact tests by coal.

The hulls of a body hold its surface, so bodies whose hulls are apart need no test of their own.
"""

from __future__ import annotations

from collections.abc import Collection, Iterator, Sequence
from dataclasses import dataclass
from itertools import product
from typing import Any

import numpy as np

from rlacd.clear.bodies import Body, Surface, get_coal, overlapping, placed_boxes
from rlacd.clear.motion import Motion
from rlacd.solid.arrays import BoolArray, FloatArray, Int64Array, dots
from rlacd.solid.poses import inverse, moved

TOUCH = 1e-6
"""Share of the size of all bodies at rest up to which an overlap of hulls, or a gap between bodies, means nothing."""

SAME = 1e-9
"""Poses of one body seen from another that differ by no more, in shares of that size, are one."""


@dataclass(frozen=True)
class Offence:
    """Hulls that touch though the bodies do not, at one place of one body seen from the other."""

    sample: int  # the first at which the bodies are so
    pose: FloatArray  # [4, 4], from the second body's frame to the first's
    depth: float  # how far the hulls would have to move apart


@dataclass(frozen=True)
class Touching:
    """What two bodies do at all samples."""

    hulls: BoolArray  # [S], whether their hulls touch
    meshes: BoolArray  # [S], whether they themselves do
    offences: tuple[Offence, ...]  # the deepest first

    @property
    def depth(self) -> float:
        """How deep hulls overlap where the bodies do not touch, at most."""
        return self.offences[0].depth if self.offences else 0.0


def check(
    bodies: Sequence[Body], motion: Motion, pairs: Collection[tuple[int, int]] | None = None
) -> dict[tuple[int, int], Touching]:
    """Find the bodies, in the order of the motion's links, whose hulls touch at some sample; of some pairs, or of all.

    Returns what they do by the numbers of the two, the lower first; raises MissingExtraError without the extra `clear`.
    """
    get_coal()
    filled = np.array([i for i, body in enumerate(bodies) if body.shapes])
    if len(filled) < 2:
        return {}
    placed, size = _boxes(bodies, motion.poses, filled), size_of(bodies, motion)
    near = overlapping(placed)
    near[:, 1:] = filled[near[:, 1:]]
    near = near[np.lexsort((near[:, 0], near[:, 2], near[:, 1]))]
    cuts = np.flatnonzero((np.diff(near[:, 1:], axis=0) != 0).any(axis=1)) + 1
    found = {}
    for rows in np.split(near, cuts) if len(near) else []:
        first, second = rows[0, 1:].tolist()
        if (pairs is None or (first, second) in pairs) and not motion.fixed.issuperset((first, second)):
            poses = _seen_from(motion.poses[rows[:, 0], first], motion.poses[rows[:, 0], second])
            touching = _touching(bodies[first], bodies[second], rows[:, 0], poses, len(motion.poses), size)
            if touching.hulls.any():
                found[first, second] = touching
    return found


def size_of(bodies: Sequence[Body], motion: Motion) -> float:
    """The longest side of the box around all bodies at rest."""
    filled = np.array([i for i, body in enumerate(bodies) if body.shapes])
    return float(np.ptp(_boxes(bodies, motion.poses[:1], filled).reshape(-1, 3), axis=0).max())


def _boxes(bodies: Sequence[Body], poses: FloatArray, chosen: Int64Array) -> FloatArray:
    return placed_boxes(np.stack([bodies[i].box for i in chosen]), poses[:, chosen])


def _seen_from(first: FloatArray, second: FloatArray) -> FloatArray:
    """Poses [K, 4, 4] of second frames in first ones."""
    columns = np.transpose(first[:, :3, :3], (0, 2, 1))[:, :, None, :]
    poses = np.tile(np.eye(4), (len(first), 1, 1))
    poses[:, :3, :3] = dots(columns, np.transpose(second[:, :3, :3], (0, 2, 1))[:, None])
    poses[:, :3, 3] = dots(columns[:, :, 0], (second[:, :3, 3] - first[:, :3, 3])[:, None])
    return poses


def _touching(first: Body, second: Body, samples: Int64Array, poses: FloatArray, count: int, size: float) -> Touching:
    """What two bodies do, looked at once for each way in which they are to each other."""
    rounded = np.round(poses / (SAME * np.array([1, 1, 1, size])))
    _, chosen, same = np.unique(rounded.reshape(len(poses), 16), axis=0, return_index=True, return_inverse=True)
    ours, theirs, deep = first.shapes, second.shapes, dict[int, tuple[float, Iterator[float]]]()
    near = _near(ours, theirs, poses[chosen])
    for rows in np.split(near, np.flatnonzero(np.diff(near[:, 0])) + 1) if len(near) else []:
        pose = poses[chosen[rows[0, 0]]]
        depths = map(_depth, *zip(*((ours[a], theirs[b], pose) for _, a, b in rows.tolist()), strict=True))
        if (least := next((depth for depth in depths if depth > TOUCH * size), None)) is not None:
            deep[int(rows[0, 0])] = least, depths
    touch, meet = np.zeros(len(chosen), dtype=bool), np.zeros(len(chosen), dtype=bool)
    touch[[*deep]] = True
    meet[touch] = _bodies_meet(first, second, poses[chosen[touch]], TOUCH * size)
    offences = [
        Offence(int(samples[chosen[place]]), poses[chosen[place]], max([least, *depths]))
        for place, (least, depths) in deep.items()
        if not meet[place]
    ]
    hulls, meshes = np.zeros(count, dtype=bool), np.zeros(count, dtype=bool)
    hulls[samples], meshes[samples] = touch[same.ravel()], meet[same.ravel()]
    return Touching(hulls, meshes, tuple(sorted(offences, key=lambda one: (-one.depth, one.sample))))


def _near(first: Sequence[Surface], second: Sequence[Surface], poses: FloatArray) -> Int64Array:
    """Shapes whose boxes overlap: rows of the pose's number and theirs [P, 3]."""
    ours, boxes = (np.stack([shape.box for shape in shapes]) for shapes in (first, second))
    theirs, ours = placed_boxes(boxes, poses[:, None])[:, None], ours[None, :, None]
    meets = (ours[..., 0, :] <= theirs[..., 1, :]).all(axis=-1) & (theirs[..., 0, :] <= ours[..., 1, :]).all(axis=-1)
    return np.argwhere(meets)


def _seen(second: Surface, pose: FloatArray) -> Any:
    """Where coal's shapes of a surface are, seen at a pose."""
    return get_coal().Transform3s(pose[:3, :3], pose[:3, 3]) * second.where


def _depth(first: Surface, second: Surface, pose: FloatArray) -> float:
    """How deep two convex shapes overlap, the second seen at a pose; 0 if they do not."""
    coal = get_coal()
    result, places = coal.CollisionResult(), (first.where, _seen(second, pose))
    found = coal.collide(first.as_convex, places[0], second.as_convex, places[1], coal.CollisionRequest(), result)
    return max(0.0, -float(result.getContact(0).penetration_depth)) if found else 0.0


def _bodies_meet(first: Body, second: Body, poses: FloatArray, reach: float) -> BoolArray:
    """Seen at which poses [K, 4, 4] the second body meets the first."""
    meet = np.zeros(len(poses), dtype=bool)
    for one, other in product(first.solids, second.solids):
        meet[~meet] = _surfaces_meet(one, other, poses[~meet], reach)
    return meet


def _surfaces_meet(first: Surface, second: Surface, poses: FloatArray, reach: float) -> BoolArray:
    """Whether surfaces are within reach of each other, the second seen at each pose, or one holds the other.

    If they are farther apart, they do not meet either where no point of one is moved by what is left. Surfaces that
    meet answer sooner whether they do, others how far they are apart: what is asked first is what the last ones were.
    """
    keys = [(second, pose.tobytes()) for pose in poses]
    places, met = _corners(first, second, poses), True
    for key, pose, place in zip(keys, poses, places, strict=True):
        if key not in first.met:
            crosses = met and _reaches(first, first.as_mesh, second, pose, reach)
            apart = 0.0 if crosses else distance(first, second, pose)
            met = apart <= reach
            first.met[key] = (
                met or first.holds(moved(pose, second.corner)) or second.holds(moved(inverse(pose), first.corner))
            )
            if not first.met[key]:
                moves = np.linalg.norm(places - place, axis=-1).max(axis=-1).min(axis=-1)
                first.met |= dict.fromkeys((keys[i] for i in np.flatnonzero(moves < apart - reach)), False)
    return np.array([first.met[key] for key in keys], dtype=bool)


def _corners(first: Surface, second: Surface, poses: FloatArray) -> FloatArray:
    """Corners of a box around each surface, seen from the other [K, 2, 8, 3]."""
    ways = (second, poses), (first, _seen_from(poses, np.broadcast_to(np.eye(4), poses.shape)))
    turned = [np.array([*product(*own.box.T)]) @ np.swapaxes(seen[:, :3, :3], 1, 2) for own, seen in ways]
    return np.stack([turned[i] + seen[:, None, :3, 3] for i, (_, seen) in enumerate(ways)], axis=1)


def distance(first: Surface, second: Surface, pose: FloatArray) -> float:
    """How far surfaces are apart, the second seen at a pose; at most 0 if they cross."""
    coal = get_coal()
    request, result = coal.DistanceRequest(), coal.DistanceResult()
    return float(coal.distance(first.as_mesh, first.where, second.as_mesh, _seen(second, pose), request, result))


def enters(body: Body, other: Body, pose: FloatArray) -> bool:
    """Whether a hull of a body touches the solids of another, seen at a pose."""
    return any(_reaches(hull, hull.as_convex, solid, pose, 0.0) for hull in body.hulls for solid in other.solids)


def _reaches(first: Surface, as_first: Any, second: Surface, pose: FloatArray, reach: float) -> bool:
    """Whether the first, as one of coal's shapes, is within reach of the second's surface, seen at a pose."""
    coal = get_coal()
    request, there = coal.CollisionRequest(), _seen(second, pose)
    request.enable_contact, request.security_margin = False, reach
    return bool(coal.collide(as_first, first.where, second.as_mesh, there, request, coal.CollisionResult()))


def gap(first: Body, second: Body, pose: FloatArray) -> float:
    """How far the solids of bodies are apart, the second seen at a pose."""
    return min(distance(one, other, pose) for one in first.solids for other in second.solids)
