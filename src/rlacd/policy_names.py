"""Names of the policies that choose cuts; `rlacd.policies.make_policy` builds them."""

from __future__ import annotations

import os
from typing import Any

EDGES = "+edges"

SCORES = ("hull-sum", "max-excess", "excess-norm")
"""What a greedy policy may order planes by."""

AS_PUBLISHED = (*(f"greedy-{score}" for score in SCORES), *(f"greedy-{score}{EDGES}" for score in SCORES), "navacd")
"""Policies of published methods, for comparison: one pass is cuts and merging, and nothing else."""

CONTROLS = (f"random-10{EDGES}", f"random-1{EDGES}", "random-10")
"""The paper's deployment with random planes in place of the network's best: what a learned policy has to beat."""

LEARNED = ("learned",)
"""Networks in the package."""

POLICIES = ("greedy", *LEARNED, *AS_PUBLISHED, *CONTROLS)

WEIGHTS_ENDING = ".npz"
"""A policy's name that ends so is the path of a network."""


def read_policy(given: Any) -> Any:
    """Take the name of a policy, or any object with a method `choose`.

    Raises
    ------
    TypeError, ValueError
        It is neither.
    """
    if isinstance(given, str):
        if not is_policy(given):
            raise ValueError
        return str.__str__(given)
    if isinstance(given, type) or not callable(given.choose):
        raise TypeError
    return given


def policy_name(policy: object) -> str:
    """Get a policy's name: that of its class where it is an object."""
    return policy if isinstance(policy, str) else type(policy).__qualname__


def is_policy(name: object) -> bool:
    """Tell whether this is the name of a policy, or may be the path of one."""
    return isinstance(name, str) and (name in POLICIES or (name.endswith(WEIGHTS_ENDING) and _can_be_a_path(name)))


def _can_be_a_path(name: str) -> bool:
    try:
        return b"\0" not in os.fsencode(name)
    except UnicodeError:
        return False
