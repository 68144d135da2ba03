"""What pairs of links do over all joint positions, as MoveIt's setup assistant sorts them."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Literal

from rlacd.clear.mend import Cleared
from rlacd.clear.motion import Motion

TOO_MANY = ": to be clear of each other takes too many hulls"

MOST_SAID = 5
"""Pairs that touch though the links do not, each with a sentence of its own; the others share one."""

Contact = Literal["adjacent", "always", "sometimes", "never"]


@dataclass(frozen=True)
class LinkPair:
    """Two links."""

    first: str
    second: str
    """Their names."""
    adjacent: bool
    """Whether one joint connects them, or several without a link with collision geometry between."""
    contact: Literal["always", "sometimes", "never"]
    """When their hulls or primitives touch."""
    share: float
    """Share of the joint positions at which they do."""
    meshes: float
    """Share at which their meshes do."""
    new_depth: float
    """How deep hulls overlap where the meshes do not touch, at most; 0 if they nowhere do."""
    kept_clear: bool
    """Whether their hulls were made finer so that they do not."""
    loose: bool
    """Whether they may do otherwise: a joint that was looked at only at rest lies between them, or one has a shape that
    was not compared, such as a height field."""

    @property
    def kind(self) -> Contact:
        """As in the matrix: adjacent comes first; loose links sometimes touch."""
        return "adjacent" if self.adjacent else "sometimes" if self.loose else self.contact


def link_pairs(cleared: Cleared, motion: Motion) -> list[LinkPair]:
    """All pairs of links with collision geometry, in their order."""
    found, bodies = cleared.touching, cleared.bodies
    pairs = []
    for i, first in enumerate(bodies):
        for j in range(i + 1, len(bodies)):
            second = bodies[j]
            touching = found.get((i, j))
            share = float(touching.hulls.mean()) if touching else 0.0
            contact: Literal["always", "sometimes", "never"] = (
                "always" if share == 1 else "sometimes" if share else "never"
            )
            meshes = float(touching.meshes.mean()) if touching else 0.0
            depth = touching.depth if touching else 0.0
            names, is_kept = (first.name, second.name), (i, j) in cleared.mended
            is_known = first.is_compared and second.is_compared and motion.carrier[i] == motion.carrier[j]
            joined, loose = (i, j) in motion.adjacent, not is_known
            pairs.append(LinkPair(*names, joined, contact, share, meshes, depth, is_kept, loose))
    return pairs


def warnings_of(cleared: Cleared, motion: Motion, length: Callable[[float], str]) -> list[str]:
    """What to say of links that touch: all are named; `length` says one in words."""
    names, sentences = [body.name for body in cleared.bodies], list[str]()
    new = {pair: found for pair, found in cleared.touching.items() if found.offences}
    deepest_first = sorted(new, key=lambda pair: (-new[pair].depth, pair))
    for pair in deepest_first[:MOST_SAID]:
        deepest, places = new[pair].offences[0], len(new[pair].offences)
        more = "" if places == 1 else f", the deepest of {places} places"
        sentences.append(
            f"Hulls of {names[pair[0]]} and {names[pair[1]]} touch though the links do not, up to "
            f"{length(deepest.depth)} deep {motion.words(deepest.sample, pair)}{more}"
            f"{'' if cleared.given_up.isdisjoint(pair) else TOO_MANY}."
        )
    if others := deepest_first[MOST_SAID:]:
        depth = length(new[others[0]].depth)
        sentences.append(f"Hulls of other links touch too, up to {depth} deep: {_listed(others, names)}.")
    always = [pair for pair, found in cleared.touching.items() if found.meshes.all() and pair not in motion.adjacent]
    if always:
        more = "" if len(always) == 1 else f", and {len(always) - 1} more pair{'s' * (len(always) > 2)},"
        moves = any(len(touching.meshes) > 1 for touching in cleared.touching.values())
        both = f"{names[always[0][0]]} and {names[always[0][1]]}"
        sentences.append(f"{both}{more} touch in the input itself{' wherever the joints are' if moves else ''}.")
    return sentences


def _listed(pairs: Sequence[tuple[int, int]], names: Sequence[str]) -> str:
    """All pairs by their names, each first link once."""
    others: dict[int, list[str]] = {}
    for first, second in sorted(pairs):
        others.setdefault(first, []).append(names[second])
    return "; ".join(f"{names[first]} with {', '.join(own)}" for first, own in others.items())
