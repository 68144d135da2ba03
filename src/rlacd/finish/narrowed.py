"""Passages of the solid that its hulls narrow or close: where, how wide they were, and what is left."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from rlacd import _native
from rlacd.criteria.limited import LimitedCriterion, least_kept
from rlacd.find_parts import Reached
from rlacd.fit import Unit
from rlacd.report import Passage
from rlacd.run import Run
from rlacd.solid.arrays import BoolArray, FloatArray, dots
from rlacd.solid.balls import Balls
from rlacd.solid.distance import hull_union
from rlacd.solid.frame import HALF_THICKNESS, ROUNDING
from rlacd.solid.hull import Hull
from rlacd.solid.passages import FACES, passage_balls

NARROWEST = 8 * HALF_THICKNESS
"""Least radius of passages looked for (the longest side is 2): folds of scans and gaps of sheets are narrower."""

LEAST_LOSS = 0.1
"""Share of its radius that a passage has to lose to be listed."""

MOSTLY = 1 / 2
"""A passage wider than the tolerance is warned of if less than this share of its radius is left."""

STARTS, SPACING = 600, 0.5

MOST_BALLS = 600
"""Most balls looked at: the wide ones that lose most come first."""

MOST_NAMED = 3
"""Most passages whose places a warning names."""

BETWEEN = 0.02
"""Further share of its radius that a passage kept open may lose: walls are kept off balls with gaps between."""

WIDER = 1.05
"""A place so many times as wide is another passage, such as the space between two holes on one axis."""

_NEIGHBOURS = 8


class Narrowed(NamedTuple):
    """The passages that hulls narrow by more than a tenth, the most narrowed first."""

    passages: tuple[Passage, ...] = ()
    """Their places, and how wide they were and are."""
    is_every: bool = True
    """Whether all are listed: no triangle or ball was left out, and no passage widens, as several in a row do."""
    by_limits: bool = False
    """Whether a limit on hulls undid what cutting had kept open."""


def narrowed(reached: Reached, hulls: Sequence[Hull], over: float, run: Run) -> Narrowed:
    """Find the passages that hulls narrow; no hull reaches out, so no passage loses, more than `over` in the frame."""
    most = min(over / LEAST_LOSS, 2.0)
    if reached.root is None or most <= NARROWEST:
        return Narrowed()
    threads, frame, solid = run.threads, reached.solid.frame, reached.solid.mesh
    surface, union = reached.root.against.surface, hull_union(hulls, threads)

    def lose(balls: Balls) -> BoolArray:
        return union.distance(balls.centres, threads) < (1 - LEAST_LOSS) * balls.radii

    balls = passage_balls(solid, surface, (NARROWEST, most), STARTS, SPACING, threads, lose)
    is_every = len(solid[1]) <= FACES and len(balls) <= MOST_BALLS
    left = union.distance(balls.centres, threads)
    left = np.where(left > ROUNDING * balls.radii, left, 0.0)
    order = np.lexsort([left / balls.radii, -_told(reached, balls.radii, left)])[:MOST_BALLS]
    balls, left = balls.some(order), left[order]
    passage = _passages(balls, surface, threads)
    widest = np.zeros(len(balls))
    np.maximum.at(widest, passage, balls.radii)
    is_every &= bool((widest[passage] <= WIDER * balls.radii).all())
    worst = np.unique(passage, return_index=True)[1]
    worst = worst[left[worst] < (1 - LEAST_LOSS) * balls.radii[worst]]
    worst = worst[np.argsort(left[worst] / balls.radii[worst], kind="stable")]
    places, lengths = frame.to_input(balls.centres[worst]), np.stack([balls.radii[worst], left[worst]]) / frame.scale
    found = (Passage((x, y, z), *of) for (x, y, z), *of in zip(places.tolist(), *lengths.tolist(), strict=True))
    return Narrowed(tuple(found), is_every, _by_limits(reached, union, threads))


def _by_limits(reached: Reached, union: _native.HullUnion, threads: int) -> bool:
    options, goal = reached.options, reached.goal
    if not isinstance(goal, LimitedCriterion) or (options.max_hulls is None and not any(options.hull_limits)):
        return False
    return bool((union.distance(goal.kept.centres, threads) < goal.kept.radii - ROUNDING).any())


def _told(reached: Reached, radii: FloatArray, left: FloatArray) -> NDArray[np.int64]:
    """Return ``[N]`` 2 if less is left than asked for, 1 if another above the tolerance loses over half, else 0."""
    options, scale = reached.options, reached.solid.frame.scale
    asked = (options.keep_open or 0.0) * radii + (options.keep_open_abs or 0.0) * scale - BETWEEN * radii
    is_asked = radii >= least_kept(options, scale)
    is_wide = ~is_asked & (radii >= options.threshold)
    return 2 * (is_asked & (left < asked)) + (is_wide & (left < MOSTLY * radii))


def _passages(balls: Balls, surface: _native.Surface, threads: int) -> NDArray[np.int64]:
    """The number of each ball's passage: balls are in the same one if there is a way between them."""
    ways = balls.centres[:, None] - balls.centres
    squares = dots(ways, ways)
    near = np.argsort(squares, axis=1, kind="stable")[:, 1 : 1 + _NEIGHBOURS]
    joined, blocked = np.empty((2, 0), dtype=np.int64), np.zeros(squares.shape, dtype=bool)
    for some in (near[:, :2], near[:, 2:]):  # most of the farther ones are in one passage by then
        passage = _native.components(len(balls), *joined)[1]
        pairs = np.stack([np.repeat(np.arange(len(balls)), some.shape[1]), some.ravel()])
        pairs = pairs[:, passage[pairs[0]] != passage[pairs[1]]]
        joined = np.concatenate([joined, pairs[:, _have_a_way(balls, pairs, surface, threads)]], axis=1)
    while True:  # join passages whose nearest balls have a way between them, until none have
        passage = _native.components(len(balls), *joined)[1]
        pairs = np.array(np.nonzero(passage[:, None] < passage))
        pairs = pairs[:, np.argsort(squares[pairs[0], pairs[1]], kind="stable")]
        pairs = pairs[:, np.unique(passage[pairs[0]] * len(balls) + passage[pairs[1]], return_index=True)[1]]
        pairs = pairs[:, ~blocked[pairs[0], pairs[1]]]
        meet = _have_a_way(balls, pairs, surface, threads)
        if not meet.any():
            return passage
        blocked[pairs[0], pairs[1]] = ~meet
        joined = np.concatenate([joined, pairs[:, meet]], axis=1)


def _have_a_way(balls: Balls, pairs: NDArray[np.intp], surface: _native.Surface, threads: int) -> BoolArray:
    """Whether, between each pair, a ball of half the larger radius goes straight and stays in the passage.

    Places on the way are looked at from the middle on: most ways are blocked, and not near their ends.
    """
    smaller, larger = np.sort(balls.radii[pairs], axis=0)
    starts = balls.centres[pairs[0]]
    ways = balls.centres[pairs[1]] - starts
    lengths = np.sqrt(dots(ways, ways))
    places = np.ceil(4 * lengths / larger).astype(np.int64)
    goes: BoolArray = (places > 0) & (smaller > larger / 2)
    depth = np.frexp(places)[1]  # of a tree of places, whose root is in the middle
    for bits in np.unique(depth[goes]).tolist():
        for level in _from_the_middle(bits):
            way, place = np.meshgrid(np.flatnonzero(goes & (depth == bits)), level, indexing="ij")
            way, place = way[place < places[way]], place[place < places[way]]
            at = starts[way] + (place * larger[way] / (4 * lengths[way]))[:, None] * ways[way]
            stays = surface.between(at, larger[way] / 2, WIDER * larger[way], threads) > 0
            goes[way[~stays]] = False
    return goes


def _from_the_middle(bits: int) -> list[NDArray[np.int64]]:
    """The numbers of so many bits: the middle one, then those in the middle of each half, and so on; 0 last."""
    strides = (1 << bit for bit in reversed(range(bits)))
    return [*(np.arange(stride, 1 << bits, 2 * stride) for stride in strides), np.zeros(1, dtype=np.int64)]


def too_narrow(found: Narrowed, reached: Reached, is_stopped: bool) -> list[str]:
    """Warn of passages that keep less than asked for, and of others wider than the tolerance that lose over half."""
    options, scale = reached.options, reached.solid.frame.scale
    radii = scale * np.array([[one.radius_abs, one.left_abs] for one in found.passages]).reshape(-1, 2)
    told = _told(reached, *radii.T)
    asked, others = ([one for one, why in zip(found.passages, told, strict=True) if why == kind] for kind in (2, 1))
    by_limits = "limits on the hulls leave no other way" if found.by_limits else ""
    reason = "the work was stopped before" if is_stopped else by_limits
    cure = (
        f"--keep-open, or a smaller {'threshold' if 'threshold' in options.numbers else 'tolerance'}, keeps more open"
    )
    return [
        _narrows(lost, "" if found.is_every else "At least ", by, then, reached.solid.frame.told_in)
        for lost, by, then in ((asked, "more than --keep-open allows", reason), (others, "over half", cure))
        if lost
    ]


def _narrows(lost: list[Passage], at_least: str, share: str, then: str, unit: Unit) -> str:
    closed = sum(one.left_abs == 0 for one in lost)
    lost = sorted(lost, key=lambda one: (one.left_abs / one.radius_abs, -one.radius_abs))
    each = ((", ".join(f"{x:.4g}" for x in one.at_abs), one) for one in lost[:MOST_NAMED])
    named = [
        f"near ({at}) from a radius of {unit.words(one.radius_abs)} to {unit.words(one.left_abs)}" for at, one in each
    ]
    more = "" if len(lost) <= MOST_NAMED else " and others (see `passages`)"
    return (
        f"{at_least}{len(lost)} passage{'s narrow' if len(lost) > 1 else ' narrows'} by {share}"
        f"{f', {closed} to nothing' if closed else ''}: {', '.join(named)}{more}{then and f'; {then}'}."
    )
