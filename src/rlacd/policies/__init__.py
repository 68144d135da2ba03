"""Which plane to cut next."""

from rlacd.policies.greedy import SCORES, Greedy
from rlacd.policies.navacd import NavACD
from rlacd.policies.policy import Policy

POLICIES = ("greedy", *(f"greedy-{score}" for score in SCORES), "navacd")
"""Names that `make_policy` knows."""


def make_policy(name: str) -> Policy:
    """Build the policy called `name`: ``greedy``, ``greedy-SCORE`` with another score than the default, or ``navacd``.

    Raises
    ------
    KeyError
        No policy has this name.
    """
    if name == "greedy":
        return Greedy()
    if name == "navacd":
        return NavACD()
    family, _, score = name.partition("-")
    if family == "greedy" and score in SCORES:
        return Greedy(score)
    raise KeyError(name)


__all__ = ["POLICIES", "Greedy", "NavACD", "Policy", "make_policy"]
