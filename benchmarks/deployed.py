"""The paper's deployment with free parameters: which planes exist, how many are evaluated, and how they are ranked.

A ranking selects its best axis planes, planes of concave edges join them, and the one of least total hull volume is
cut. The paper's Tables 2 and 3 leave out kinds of planes and vary the two numbers.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from rlacd.criteria import Concavity
from rlacd.cut import CutTree
from rlacd.cut_and_merge import cut_and_merge
from rlacd.errors import OptionError
from rlacd.finish.finish import limit_part
from rlacd.io.read.load import load_mesh
from rlacd.options.names import WEIGHTS_ENDING
from rlacd.planes.candidates import OFFSETS_PER_AXIS, axis_and_principal
from rlacd.planes.sweep import SLIVERS, paper_planes, sweep, valid_planes
from rlacd.policies.greedy import excess_norm, generator_of, least_hulls
from rlacd.policies.network import KIND, load_network
from rlacd.policies.plane_features import FEATURES, sweep_features
from rlacd.repair.repair import repair
from rlacd.run import Run
from rlacd.solid.arrays import FloatArray, IntArray
from rlacd.solid.component import Component, Plane
from rlacd.solid.hull import NO_LIMITS, Hull

RANKINGS = ("excess", "random")


@dataclass(frozen=True)
class Deployment:
    """Parameters of the deployment.

    Attributes
    ----------
    ranking : str
        "excess": the greedy score ``rlacd.policies.greedy.excess_norm``; "random": a draw that the component alone
        determines, the control; or the path of a Q network .
    planes : int
        Number of best-ranked axis planes to evaluate (the paper's #AP).
    edges : int
        Number of concave edges whose planes join them (the paper's #CE, three planes each).
    spatial, principal : bool
        Whether the planes along x, y, z and along the principal axes exist.
    """

    ranking: str = "excess"
    planes: int = 10
    edges: int = 4
    spatial: bool = True
    principal: bool = True

    def __post_init__(self) -> None:
        if self.ranking not in RANKINGS and not self.ranking.endswith(WEIGHTS_ENDING):
            raise OptionError(f"ranking is {self.ranking!r}; it has to be {', '.join(RANKINGS)} or FILE.npz.")
        if self.planes < 0 or self.edges < 0:
            raise OptionError("planes and edges have to be at least 0.")
        if not (self.edges or (self.planes and (self.spatial or self.principal))):
            raise OptionError("no planes are left; ask for some along the axes or of concave edges.")

    @classmethod
    def parse(cls, words: Sequence[str]) -> Deployment:
        """Read ``ap=10``, ``ce=4``, ``no-spatial``, ``no-principal`` and a ranking, in any order.

        Raises
        ------
        OptionError
            A word is none of these.
        """
        given: dict[str, object] = {}
        for word in words:
            key, _, value = word.partition("=")
            if key in ("ap", "ce") and value.isdecimal():
                given["planes" if key == "ap" else "edges"] = int(value)
            elif word in ("no-spatial", "no-principal"):
                given[word.removeprefix("no-")] = False
            elif word in RANKINGS or word.endswith(WEIGHTS_ENDING):
                given["ranking"] = word
            else:
                raise OptionError(
                    f"planes:{word} is not known; there are ap=N, ce=N, no-spatial, no-principal, "
                    f"{', '.join(RANKINGS)} and FILE.npz."
                )
        return cls(**given)  # type: ignore[arg-type]


class Deployed:
    """A policy: the least total hull volume among the best-ranked axis planes and the planes of concave edges.

    Parameters
    ----------
    deployment : Deployment
    threshold : float, optional
        The criterion's length, an input of the network; its own by default.
    """

    def __init__(self, deployment: Deployment, threshold: float | None) -> None:
        self._of = deployment
        self._threshold = threshold
        self._network = None
        if deployment.ranking.endswith(WEIGHTS_ENDING):
            self._network = load_network(deployment.ranking, KIND, FEATURES, 1)

    def choose(self, component: Component, threads: int = 1) -> Plane | None:
        """Choose the plane to cut a component by; None when no candidate is valid."""
        candidates = axis_and_principal(component) if self._network is None else paper_planes(component)
        exists = np.repeat([self._of.spatial, self._of.principal], 3 * OFFSETS_PER_AXIS)
        if self._network is None:
            swept = sweep(component, candidates, threads)
            random = self._of.ranking == "random"
            cost = generator_of(component).random(len(candidates)) if random else excess_norm(swept)
            valid = next((v for s in SLIVERS if (v := exists & swept.valid(s)).any()), exists & False)
        else:
            seen = sweep_features(component, self._threshold or self._network.threshold)
            cost = -self._network(seen)[:, 0].astype(np.float64)
            valid = exists & valid_planes(component, candidates)
        ranked = np.argsort(np.where(valid, cost, np.inf), kind="stable")
        best = np.sort(ranked[: min(self._of.planes, int(valid.sum()))])  # sweep order: ties go to the first
        return least_hulls(component, candidates, best, self._of.edges, threads)


def decompose_as_deployed(
    deployment: Deployment, vertices: FloatArray, faces: IntArray, threshold: float, threads: int
) -> list[tuple[FloatArray, IntArray]]:
    """Decompose a mesh [V, 3], [F, 3] until each part has at most the concavity `threshold`, then merge.

    Returns
    -------
    list of (vertices, faces)
        In the input's frame and unit.
    """
    solid = repair(load_mesh((vertices, faces)), threads=threads)
    with Run(threads) as run:
        tree = CutTree(Component(solid.shape), Deployed(deployment, threshold), run)
        parts = cut_and_merge(tree, Concavity(threshold), run).parts
    there = [Hull.of(solid.frame.to_input(limit_part(part, NO_LIMITS).hull.vertices)) for part in parts]
    return [(hull.vertices, hull.faces) for hull in there if hull is not None]
