"""Bodies whose hulls touch where they themselves do not are decomposed again, each clear of the other.

The places at which hulls touch are the counterexamples of one round; new ones, found with the new hulls, those of the
next. Of two bodies, first the one whose hulls reach into the other stays out of the other's hulls; if both do, first
one stays out of the other's surface and leaves half the gap, then the other out of its hulls.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field

import numpy as np

from rlacd.clear.bodies import Body, Surface, inverse, moved
from rlacd.clear.motion import Motion
from rlacd.clear.touching import TOUCH, Offence, Shapes, Touching, check
from rlacd.solid.arrays import FloatArray
from rlacd.solid.component import concatenated
from rlacd.solid.obstacle import Obstacle

MOST_ROUNDS = 8
"""After which pairs that still touch are told."""

MOST_PLACES = 24
"""Of one pair, looked at in one round: the deepest, and those that differ most from it."""

OFF_HULLS = 10 * TOUCH
"""How far hulls stay off those of other bodies, a share of the size of all: single precision moves them less."""

Redo = Callable[[int, Sequence[Obstacle]], Sequence[Surface]]
"""Decomposes the body of this number again, clear of obstacles in its frame."""


@dataclass(frozen=True)
class Cleared:
    """What became of bodies.

    Attributes
    ----------
    bodies : list of Body
    touching : dict
        As `check` finds it for the new hulls.
    mended : tuple of (int, int)
        Pairs whose hulls touched though they did not, and no longer do.
    """

    bodies: list[Body]
    touching: dict[tuple[int, int], Touching]
    mended: tuple[tuple[int, int], ...] = ()


@dataclass
class _Asked:
    """What one body stays out of on account of another: where that was, seen from it, and the least gap."""

    poses: list[FloatArray] = field(default_factory=list)
    of_mesh: bool = False
    gap: float = np.inf


def kept_clear(bodies: Sequence[Body], motion: Motion, redo: Redo) -> Cleared:
    """Decompose bodies again until no hulls touch where the bodies themselves do not, or that does not help.

    Bodies that touch each other at rest are left as they are.

    Raises
    ------
    MissingExtraError
        The extra ``clear`` is not installed.
    """
    bodies = list(bodies)
    touching = check(bodies, motion)
    first = {pair for pair, found in touching.items() if _is_wrong(found)}
    asked: dict[tuple[int, int], _Asked] = {}
    for _ in range(MOST_ROUNDS):
        wrong = {pair: found for pair, found in touching.items() if _is_wrong(found)}
        again = _asked_of(bodies, wrong, asked)
        if not again:
            break
        for body in sorted(again):
            obstacles = [_obstacle(bodies, pair, what, motion) for pair, what in asked.items() if pair[0] == body]
            bodies[body] = bodies[body].with_hulls(redo(body, obstacles))
        near = {(i, j) for i in again for j in range(len(bodies)) if j != i}
        renewed = check(bodies, motion, {(min(pair), max(pair)) for pair in near})
        touching = {pair: found for pair, found in touching.items() if not again & {*pair}} | renewed
    mended = sorted(pair for pair in first if pair not in touching or not _is_wrong(touching[pair]))
    return Cleared(bodies, dict(sorted(touching.items())), tuple(mended))


def _is_wrong(found: Touching) -> bool:
    return len(found.offences) > 0 and not found.meshes[0]


def _asked_of(
    bodies: Sequence[Body], wrong: dict[tuple[int, int], Touching], asked: dict[tuple[int, int], _Asked]
) -> set[int]:
    """Add what bodies are asked to stay out of, and return those to decompose again: not both of a pair at once."""
    shapes = {i: Shapes(bodies[i]) for pair in wrong for i in pair}
    again, fixed = set[int](), set[int]()
    for (i, j), found in sorted(wrong.items(), key=lambda one: (-one[1].offences[0].depth, one[0])):
        places = _spread(found.offences)
        ours = any(shapes[i].enters(shapes[j], place.pose) for place in places)
        theirs = any(shapes[j].enters(shapes[i], inverse(place.pose)) for place in places)
        of_mesh = ours and theirs
        if of_mesh and (i, j) in asked:  # it is the other's turn
            i, j, of_mesh = j, i, False
        elif theirs and not ours:
            i, j = j, i
        if i in fixed or j in again:
            continue
        again.add(i)
        fixed.add(j)
        is_second = (i, j) not in wrong
        what = asked.setdefault((i, j), _Asked())
        what.poses += [inverse(place.pose) if is_second else place.pose for place in places]
        what.of_mesh |= of_mesh
        if what.of_mesh:
            what.gap = min([what.gap, *(shapes[i].gap(shapes[j], pose) for pose in what.poses)])
    return again


def _spread(offences: Sequence[Offence]) -> list[Offence]:
    """The deepest, and then always the one that differs most from those chosen."""
    poses = np.stack([one.pose[:3].ravel() for one in offences])
    poses[:, 3::4] /= max(float(np.abs(poses[:, 3::4]).max()), 1e-300)
    chosen, away = [0], np.full(len(offences), np.inf)
    while len(chosen) < min(MOST_PLACES, len(offences)):
        away = np.minimum(away, np.abs(poses - poses[chosen[-1]]).sum(axis=1))
        chosen.append(int(away.argmax()))
    return [offences[i] for i in chosen]


def _obstacle(bodies: Sequence[Body], pair: tuple[int, int], what: _Asked, motion: Motion) -> Obstacle:
    """The second body of a pair at all places, seen from the first, as far as it comes near that."""
    own, other = bodies[pair[0]], bodies[pair[1]]
    size = float(np.ptp(np.concatenate([motion.poses[0, :, :3, 3], own.box, other.box]), axis=0).max())
    vertices, faces = other.mesh if what.of_mesh else concatenated([(v, f.astype(np.int32)) for v, f in other.hulls])
    margin = what.gap / 2 if what.of_mesh else OFF_HULLS * size
    lower, upper = own.box[0] - margin, own.box[1] + margin
    near = []
    for pose in what.poses:
        triangles = moved(vertices, pose)[faces]
        meets = (triangles.min(axis=1) <= upper).all(axis=1) & (triangles.max(axis=1) >= lower).all(axis=1)
        near.append(triangles[meets])
    corners = np.ascontiguousarray(np.concatenate(near).reshape(-1, 3))
    return Obstacle(other.name, corners, np.arange(len(corners), dtype=np.int32).reshape(-1, 3), margin)
