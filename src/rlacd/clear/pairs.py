"""What pairs of links do over all joint positions, as MoveIt's setup assistant sorts them."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Literal

from rlacd.clear.mend import Cleared
from rlacd.clear.motion import Motion

TOO_MANY = ": to be clear of each other takes too many hulls"

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
    """What to say of links that touch; `length` says one in words."""
    names = {pair: f"{cleared.bodies[pair[0]].name} and {cleared.bodies[pair[1]].name}" for pair in cleared.touching}
    sentences, earlier, always = [], list[tuple[float, str]](), list[str]()
    for pair, touching in cleared.touching.items():
        deepest = touching.offences[0] if touching.offences else None
        if touching.is_wrong and deepest is not None:
            places = "" if len(touching.offences) == 1 else f", the deepest of {len(touching.offences)} places"
            sentences.append(
                f"Hulls of {names[pair]} touch though the links do not, up to {length(deepest.depth)} deep "
                f"{motion.words(deepest.sample)}{places}{'' if cleared.given_up.isdisjoint(pair) else TOO_MANY}."
            )
        elif deepest is not None:
            earlier.append((deepest.depth, names[pair]))
        if touching.meshes.all() and pair not in motion.adjacent:
            always.append(names[pair])
    if earlier:
        depth, worst = max(earlier)
        more = "" if len(earlier) == 1 else f" ({len(earlier)} such pairs)"
        sentences.append(
            f"Hulls of {worst} touch at some places where the links do not, up to {length(depth)} deep; since the "
            f"links collide at least as often themselves, their hulls were not cut finer{more}."
        )
    if always:
        more = "" if len(always) == 1 else f", and {len(always) - 1} more pairs,"
        moves = any(len(touching.meshes) > 1 for touching in cleared.touching.values())
        sentences.append(f"{always[0]}{more} touch in the input itself{' wherever the joints are' if moves else ''}.")
    return sentences
