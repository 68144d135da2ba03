"""Which plane to cut next."""

from rlacd.planes.views import Views
from rlacd.policies.greedy import SCORES, Greedy
from rlacd.policies.navacd import CONCAVE_EDGES, NavACD
from rlacd.policies.policy import Policy

EDGES = "+edges"

POLICIES = (
    "greedy",
    *(f"greedy-{score}" for score in SCORES),
    *(f"greedy-{score}{EDGES}" for score in SCORES),
    "navacd",
)
"""Names that `make_policy` knows."""


def make_policy(name: str, views: Views | None = None) -> Policy:
    """Build the policy called `name`.

    ``greedy`` looks at 150 planes and those of four concave edges, and takes the one with the least p-norm of excess
    volumes; ``greedy-SCORE`` takes the one with the least SCORE of the 150 alone, ``greedy-SCORE+edges`` of the 150 and
    those of the edges (SCORE ``hull-sum`` is the paper's baseline); ``navacd`` takes the least sum of hull volumes of
    three planes and those of four concave edges.

    Parameters
    ----------
    name : str
    views : Views, optional
        Sweeps over the 150 planes and those of four concave edges, shared with others.

    Raises
    ------
    KeyError
        No policy has this name.
    """
    if name == "greedy":
        return Greedy(views=views)
    if name == "navacd":
        return NavACD()
    family, _, score = name.partition("-")
    if family == "greedy" and score.removesuffix(EDGES) in SCORES:
        return Greedy(score.removesuffix(EDGES), concave_edges=CONCAVE_EDGES if score.endswith(EDGES) else 0)
    raise KeyError(name)


__all__ = ["POLICIES", "Greedy", "NavACD", "Policy", "make_policy"]
