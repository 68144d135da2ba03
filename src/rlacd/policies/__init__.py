"""Policies: which plane cuts a component."""

import math
from importlib.resources import as_file, files

from rlacd.options.names import AS_PUBLISHED, CONTROLS, EDGES, POLICIES, WEIGHTS_ENDING, is_policy
from rlacd.planes.candidates import EDGES_PER_COMPONENT
from rlacd.planes.sweep import SweepCache, paper_planes
from rlacd.policies.greedy import SCORES, Greedy, RandomShortlist, navacd_planes, paper_planes_and_edges
from rlacd.policies.learned import Learned
from rlacd.policies.network import deployed
from rlacd.policies.policy import CheckedPolicy, Policy


def make_policy(name: str | Policy, sweeps: SweepCache | None = None, scale: float | None = None) -> Policy:
    """Build the policy called `name`; an object with a method `choose` is wrapped to check its answers.

    - ``greedy``: the plane with the least p-norm of excess volumes, among 150 planes and those of four reflex edges.
    - ``greedy-SCORE``: the plane with the least SCORE among the paper's 150 alone (``hull-sum`` is its baseline);
      ``greedy-SCORE+edges``: among those and the edges'.
    - ``navacd``: the plane with the least sum of hull volumes, among three planes and those of four reflex edges.
    - ``random-N+edges``: the plane with the least sum of hull volumes among N random ones of the 150 and those of four
      reflex edges; ``random-N``: among the random ones alone. Controls for learned policies.
    - ``learned``: of the most promising planes, the one after which networks predict the fewest parts.
    - ``rl-acd``, or the path of a network as written by ``rlacd train`` (.npz): the paper's rule, the plane with
      the least sum of hull volumes among the network's ten best planes and those of four reflex edges.

    Parameters
    ----------
    name : str or Policy
    sweeps : SweepCache, optional
        Sweeps over the 150 planes and those of four reflex edges, shared with others.
    scale : float, optional
        The criterion's length in the frame, such as the concavity threshold; an input of networks. Infinite if it has
        none.

    Raises
    ------
    KeyError
        No policy has this name.
    WeightsError
        The network cannot be loaded.
    """
    if not isinstance(name, str):
        return CheckedPolicy(name)
    scale = None if scale == math.inf else scale
    if name == "greedy":
        return Greedy(sweeps=sweeps)
    if name == "navacd":
        return Greedy("hull-sum", planes=navacd_planes)
    if name == "learned":
        return Learned(sweeps, scale)
    if name == "rl-acd":
        with as_file(files("rlacd.policies") / "rl_acd.npz") as path:
            return deployed(str(path), scale)
    if name.endswith(WEIGHTS_ENDING):
        return deployed(name, scale)
    family, _, score = name.partition("-")
    if family == "greedy" and score.removesuffix(EDGES) in SCORES:
        return Greedy(
            score.removesuffix(EDGES), planes=paper_planes_and_edges if score.endswith(EDGES) else paper_planes
        )
    if name in CONTROLS:
        return RandomShortlist(int(score.removesuffix(EDGES)), EDGES_PER_COMPONENT if score.endswith(EDGES) else 0)
    raise KeyError(name)


__all__ = ["AS_PUBLISHED", "POLICIES", "Greedy", "Policy", "is_policy", "make_policy"]
