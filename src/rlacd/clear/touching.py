"""Where hulls of two bodies touch, though the bodies do not: exact tests by coal.

The hulls of a body hold its surface, so bodies whose hulls are apart need no test of their own.
"""

from __future__ import annotations

import sys
from collections.abc import Callable, Collection, Iterator, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np

from rlacd import _native
from rlacd.clear.bodies import Body, Surface, overlapping, placed_boxes
from rlacd.clear.motion import Motion
from rlacd.errors import import_extra
from rlacd.solid.arrays import BoolArray, FloatArray, Int64Array, dots
from rlacd.solid.poses import inverse, moved
from rlacd.solid.topology import used_points

TOUCH = 1e-6
"""Share of the size of all bodies at rest up to which an overlap of hulls, or a gap between bodies, means nothing."""

SAME = 1e-9
"""Poses of one body seen from another that differ by no more, in shares of that size, are one."""


@dataclass(frozen=True)
class Offence:
    """Hulls that touch though the bodies do not, at one place of one body seen from the other.

    Attributes
    ----------
    sample : int
        The first at which the bodies are so.
    pose : float64 [4, 4]
        From the second body's frame to the first's.
    depth : float
        How far the hulls would have to move apart.
    """

    sample: int
    pose: FloatArray
    depth: float


@dataclass(frozen=True)
class Touching:
    """What two bodies do at all samples.

    Attributes
    ----------
    hulls, meshes : bool [S]
        Whether their hulls touch, and whether they themselves do.
    offences : tuple of Offence
        The deepest first.
    """

    hulls: BoolArray
    meshes: BoolArray
    offences: tuple[Offence, ...]

    @property
    def is_wrong(self) -> bool:
        """Whether hulls touch mostly where the bodies do not; elsewhere they only touch a little earlier than these."""
        new = int(np.count_nonzero(self.hulls & ~self.meshes))
        return new > int(np.count_nonzero(self.meshes))


def _coal() -> Any:
    return sys.modules.get("coal") or import_extra("coal", "checking that bodies stay clear of each other", "clear")


def check(
    bodies: Sequence[Body],
    motion: Motion,
    pairs: Collection[tuple[int, int]] | None = None,
    known: Known | None = None,
) -> dict[tuple[int, int], Touching]:
    """Find the pairs of bodies whose hulls touch at some sample, by the numbers of the two, the lower first.

    Parameters
    ----------
    bodies : sequence of Body
        In the order of the motion's links.
    motion : Motion
    pairs : collection of (int, int), optional
        Look at no others.
    known : Known, optional
        Keeps what another check of these bodies, with the same hulls or others, needs again.

    Raises
    ------
    MissingExtraError
        The extra ``clear`` is not installed.
    """
    _coal()
    filled = [i for i, body in enumerate(bodies) if body.hulls and len(body.mesh[1])]
    if len(filled) < 2:
        return {}
    boxes = np.stack([bodies[i].box for i in filled])
    placed = placed_boxes(boxes, motion.poses[:, filled])
    size = size_of(bodies, motion)
    known = known or Known()
    shapes = {i: Shapes(bodies[i], known) for i in filled}
    near, numbers = overlapping(placed), np.array(filled)
    near[:, 1:] = numbers[near[:, 1:]]
    order = np.lexsort((near[:, 0], near[:, 2], near[:, 1]))
    near = near[order]
    cuts = np.flatnonzero((np.diff(near[:, 1:], axis=0) != 0).any(axis=1)) + 1
    found = {}
    for rows in np.split(near, cuts) if len(near) else []:
        first, second = rows[0, 1:].tolist()
        if (pairs is None or (first, second) in pairs) and not motion.fixed.issuperset((first, second)):
            poses = _seen_from(motion.poses[rows[:, 0], first], motion.poses[rows[:, 0], second])
            touching = _touching(shapes[first], shapes[second], rows[:, 0], poses, len(motion.poses), size)
            if touching.hulls.any():
                found[first, second] = touching
    return found


def size_of(bodies: Sequence[Body], motion: Motion) -> float:
    """The longest side of the box around all bodies at rest."""
    filled = [i for i, body in enumerate(bodies) if body.hulls and len(body.mesh[1])]
    boxes = np.stack([bodies[i].box for i in filled])
    return float(np.ptp(placed_boxes(boxes, motion.poses[:1, filled]).reshape(-1, 3), axis=0).max())


def _seen_from(first: FloatArray, second: FloatArray) -> FloatArray:
    """Poses [K, 4, 4] of second frames in first ones."""
    columns = np.transpose(first[:, :3, :3], (0, 2, 1))[:, :, None, :]
    poses = np.tile(np.eye(4), (len(first), 1, 1))
    poses[:, :3, :3] = dots(columns, np.transpose(second[:, :3, :3], (0, 2, 1))[:, None])
    poses[:, :3, 3] = dots(columns[:, :, 0], (second[:, :3, 3] - first[:, :3, 3])[:, None])
    return poses


def _touching(
    first: Shapes, second: Shapes, samples: Int64Array, poses: FloatArray, count: int, size: float
) -> Touching:
    """What two bodies do, looked at once for each way in which they are to each other."""
    rounded = np.round(poses / (SAME * np.array([1, 1, 1, size])))
    _, chosen, same = np.unique(rounded.reshape(len(poses), 16), axis=0, return_index=True, return_inverse=True)
    depths, meets, offences = np.zeros(len(chosen)), np.zeros(len(chosen), dtype=bool), []
    for place, (a, b) in _near_hulls(first, second, poses[chosen]):
        depths[place] = max(depths[place], _depth(first.hulls[a], second.hulls[b], poses[chosen[place]]))
    for place in np.flatnonzero(depths > TOUCH * size).tolist():
        pose = poses[chosen[place]]
        meets[place] = first.meets(second, pose, TOUCH * size)
        if not meets[place]:
            offences.append(Offence(int(samples[chosen[place]]), pose, float(depths[place])))
    hulls, meshes = np.zeros(count, dtype=bool), np.zeros(count, dtype=bool)
    hulls[samples], meshes[samples] = (depths > TOUCH * size)[same.ravel()], meets[same.ravel()]
    return Touching(hulls, meshes, tuple(sorted(offences, key=lambda one: (-one.depth, one.sample))))


def _near_hulls(first: Shapes, second: Shapes, poses: FloatArray) -> Iterator[tuple[int, tuple[int, int]]]:
    """Hulls whose boxes overlap, by the number of the pose."""
    theirs = placed_boxes(second.boxes, poses[:, None])[:, None]
    ours = first.boxes[None, :, None]
    meets = (ours[..., 0, :] <= theirs[..., 1, :]).all(axis=-1) & (theirs[..., 0, :] <= ours[..., 1, :]).all(axis=-1)
    for place, a, b in np.argwhere(meets).tolist():
        yield place, (a, b)


class _Place(NamedTuple):
    fixed: Any
    moved: Any


def _place(pose: FloatArray) -> _Place:
    coal = _coal()
    return _Place(coal.Transform3s.Identity(), coal.Transform3s(pose[:3, :3], pose[:3, 3]))


def _depth(first: Any, second: Any, pose: FloatArray) -> float:
    """How deep two convex polytopes overlap; 0 if they do not."""
    coal = _coal()
    at, result = _place(pose), coal.CollisionResult()
    if not coal.collide(first, at.fixed, second, at.moved, coal.CollisionRequest(), result):
        return 0.0
    return max(0.0, -float(result.getContact(0).penetration_depth))


@dataclass(frozen=True)
class Known:
    """What checks of the same bodies share.

    Attributes
    ----------
    meets : dict
        Whether two bodies touch, by their surfaces' numbers and the pose of the second.
    shapes : dict
        coal's shapes, by their surfaces' numbers; with the surfaces, so that these numbers stay theirs.
    """

    meets: dict[tuple[int, int, bytes], bool] = field(default_factory=dict)
    shapes: dict[int, tuple[Surface, Any]] = field(default_factory=dict)

    def shape(self, surface: Surface, make: Callable[[Surface], Any]) -> Any:
        """A surface as a shape."""
        key = id(surface[0])
        if key not in self.shapes:
            self.shapes[key] = surface, make(surface)
        return self.shapes[key][1]


class Shapes:
    """A body as coal's shapes, made when first needed."""

    def __init__(self, body: Body, known: Known) -> None:
        self.body, self._known = body, known
        self.boxes = np.stack([np.stack([v.min(axis=0), v.max(axis=0)]) for v, _ in body.hulls])

    @cached_property
    def mesh(self) -> Any:
        """The surface as it was read."""
        return self._known.shape(self.body.mesh, _mesh)

    @cached_property
    def hulls(self) -> list[Any]:
        """The hulls as convex polytopes."""
        return [self._known.shape(hull, _convex) for hull in self.body.hulls]

    def meets(self, other: Shapes, pose: FloatArray, reach: float) -> bool:
        """Whether the bodies are within reach of each other, the other seen at a pose, or one holds the other."""
        key = id(self.body.mesh[0]), id(other.body.mesh[0]), pose.tobytes()
        if key not in self._known.meets:
            self._known.meets[key] = self._meets(other, pose, reach)
        return self._known.meets[key]

    def _meets(self, other: Shapes, pose: FloatArray, reach: float) -> bool:
        coal = _coal()
        at, request = _place(pose), coal.CollisionRequest()
        request.enable_contact, request.security_margin = False, reach
        if coal.collide(self.mesh, at.fixed, other.mesh, at.moved, request, coal.CollisionResult()):
            return True
        return self._holds(moved(pose, other.corner)) or other._holds(moved(inverse(pose), self.corner))

    def gap(self, other: Shapes, pose: FloatArray) -> float:
        """How far the surfaces of the bodies are apart, the other seen at a pose."""
        coal = _coal()
        at, request = _place(pose), coal.DistanceRequest()
        return float(coal.distance(self.mesh, at.fixed, other.mesh, at.moved, request, coal.DistanceResult()))

    def enters(self, other: Shapes, pose: FloatArray) -> bool:
        """Whether a hull touches the other body's surface, seen at a pose."""
        coal = _coal()
        at, request = _place(pose), coal.CollisionRequest()
        request.enable_contact = False
        return any(
            coal.collide(hull, at.fixed, other.mesh, at.moved, request, coal.CollisionResult()) for hull in self.hulls
        )

    @cached_property
    def used(self) -> FloatArray:
        """The corners [N, 3] of the surface."""
        return used_points(*self.body.mesh)

    @cached_property
    def box(self) -> FloatArray:
        """Lower and upper corner of the box around the body [2, 3]."""
        return np.stack([self.used.min(axis=0), self.used.max(axis=0)])

    @cached_property
    def corner(self) -> FloatArray:
        """The point [1, 3] of the surface farthest from its middle: hardly ever in the box of another body."""
        away = self.used - self.box.mean(axis=0)
        return self.used[[dots(away, away).argmax()]]

    @cached_property
    def _surface(self) -> _native.Surface:
        vertices, faces = self.body.mesh
        return _native.Surface(np.ascontiguousarray(vertices), np.ascontiguousarray(faces, dtype=np.int32))

    def _holds(self, point: FloatArray) -> bool:
        """Whether the body holds a point [1, 3] of another whose surface does not cross its own, and so all of it."""
        if (point < self.box[0]).any() or (point > self.box[1]).any():
            return False
        return bool(self._surface.winding(point, accuracy=4.0, threads=1)[0] > 0.5)


def _mesh(surface: Surface) -> Any:
    coal = _coal()
    vertices, faces = surface
    model = coal.BVHModelOBBRSS()
    model.beginModel(len(faces), len(vertices))
    model.addVertices(np.asarray(vertices, dtype=np.float64))
    model.addTriangles(np.asarray(faces, dtype=np.int64))
    model.endModel()
    return model


def _convex(surface: Surface) -> Any:
    coal = _coal()
    points, triangles = coal.StdVec_Vec3s(), coal.StdVec_Triangle()
    points.extend([np.asarray(vertex, dtype=np.float64) for vertex in surface[0]])
    triangles.extend([coal.Triangle(*face) for face in surface[1].tolist()])
    return coal.Convex(points, triangles)
