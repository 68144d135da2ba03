"""The learned policy: a small network ranks the planes of a sweep by the number of parts it expects in the end.

The network (see `rlacd.learn.ranker`) is run by onnxruntime on one thread, because components are processed in parallel
already.
"""

from __future__ import annotations

import json
import os
from dataclasses import dataclass
from functools import lru_cache
from importlib.resources import files
from typing import Any

import numpy as np

from rlacd.errors import WeightsError
from rlacd.io.read.open_file import read_file
from rlacd.planes.sweep import Sweep
from rlacd.planes.sweep_cache import SweepCache
from rlacd.policies.features import CONCAVE_EDGES, DIRECTIONS, VERSION, features, measures, planes_per_axis, tables
from rlacd.policies.greedy import EXPONENT, cheapest, excess_norm
from rlacd.policies.network_file import open_network
from rlacd.solid.arrays import FloatArray
from rlacd.solid.component import Component, Plane

SHIPPED = "ranker.onnx"
"""File name of the weights in `rlacd.weights`."""

INPUTS = ["planes", "edges", "component"]
OUTPUTS = ["q", "q_edges", "value"]

DECIMALS = 4
"""Predictions are rounded to this many decimals, so that planes that mirror each other cost the same."""

NOTHING = 1e-9
"""Added to the greedy score, relative to the hull, so that it is positive."""

MOST_PLANES = 1000
"""Maximum number of planes per direction that a network may ask for; the shipped one uses 25."""

USUAL_SCALE = 0.05
"""Scale for criteria without one: the usual concavity threshold."""


@dataclass(frozen=True)
class About:
    """Metadata of a weights file.

    Attributes
    ----------
    per_axis : int
        Planes along each direction.
    scales : tuple of float
        Least and greatest scale seen in training; other scales are clipped to this range.
    blend : float
        Weight of the greedy score relative to the network's prediction.
    edge_bonus : float
        Subtracted from the predicted logarithm for planes of concave edges: few of them were labelled, so the network's
        predictions for them are too cautious.
    """

    per_axis: int
    scales: tuple[float, float]
    blend: float
    edge_bonus: float


class PlaneRanker:
    """The plane ranker: a network loaded for inference.

    Parameters
    ----------
    weights : path, optional
        An ONNX file exported by ``python -m rlacd.learn.ranker``; the shipped one by default.

    Raises
    ------
    WeightsError
        The file is missing, damaged, or not a plane ranker of this version.
    """

    def __init__(self, weights: str | os.PathLike[str] | None = None) -> None:
        name, content = _read(weights)
        try:
            self._session = open_network(content)
            about = self._session.get_modelmeta().custom_metadata_map.get("rlacd")
            signature = [[v.name for v in self._session.get_inputs()], [v.name for v in self._session.get_outputs()]]
        except Exception as error:  # onnxruntime's own exceptions have no public base
            raise WeightsError(f"{name} is damaged or no ONNX file; export the policy again.") from error
        self.about = _about(name, about)
        if signature != [INPUTS, OUTPUTS]:
            raise WeightsError(f"{name} is no guide network; export the policy again.")

    def log_parts(self, component: Component, swept: Sweep, scale: float) -> FloatArray:
        """Predict for every plane of a component's sweep the log of the number of parts after cutting and merging."""
        grid, edges = tables(swept)
        scales = np.clip(np.array([scale]), *self.about.scales)
        inputs = features(grid[None], edges[None], measures(component)[None], scales)
        outputs = self._session.run(["q", "q_edges"], dict(zip(INPUTS, inputs, strict=True)))
        q: FloatArray = np.concatenate(outputs, axis=1)[0, : len(swept.candidates)].astype(np.float64)
        return q


def ranked_cost(
    ranker: PlaneRanker, component: Component, swept: Sweep, scale: float, blend: float | None = None
) -> FloatArray:
    """Cost of every plane of a sweep: expected parts * greedy score ** blend, slightly less for concave edges' planes.

    The greedy score corrects for prediction errors: only a few planes per component were labelled in training, and the
    best of 150 predictions tends to be an optimistic error.
    """
    blend = ranker.about.blend if blend is None else blend
    greedy = (excess_norm(swept) / component.hull.volume**EXPONENT + NOTHING) ** (1 / EXPONENT)
    log_parts = ranker.log_parts(component, swept, scale)
    log_parts[DIRECTIONS * planes_per_axis(swept) :] -= ranker.about.edge_bonus
    parts = np.exp(np.round(log_parts, DECIMALS))
    cost: FloatArray = parts * greedy**blend
    return cost


class Learned:
    """Chooses the plane of least cost by the network and the greedy score combined.

    Parameters
    ----------
    weights : path, optional
        The network; the shipped one by default.
    scale : float, optional
        The criterion's length, such as the concavity threshold, in the frame; `USUAL_SCALE` by default.
    blend : float, optional
        Weight of the greedy score; that of the weights file by default.
    sweeps : SweepCache, optional
        Provides the planes and their sweeps, to share them with other policies.

    Raises
    ------
    WeightsError
        The network cannot be loaded.
    """

    def __init__(
        self,
        weights: str | os.PathLike[str] | None = None,
        scale: float | None = None,
        blend: float | None = None,
        sweeps: SweepCache | None = None,
    ) -> None:
        self._ranker = load_ranker(weights)
        self._sweep_cache = sweeps or SweepCache(self._ranker.about.per_axis, CONCAVE_EDGES)
        self._scale = USUAL_SCALE if scale is None else scale
        self._blend = blend

    def choose(self, component: Component, threads: int = 1) -> Plane | None:
        """Choose the plane to cut a component by; None if every candidate misses it or shaves off a film."""
        swept = self._sweep_cache.of(component, threads)
        return cheapest(swept, self.rank(component, swept))

    def rank(self, component: Component, swept: Sweep) -> FloatArray:
        """Cost of every plane of a component's sweep over axes and concave edges; it may have any number per axis."""
        return ranked_cost(self._ranker, component, swept, self._scale, self._blend)


@lru_cache(maxsize=4)
def _cached(weights: str | None) -> PlaneRanker:
    return PlaneRanker(weights)


def load_ranker(weights: str | os.PathLike[str] | None = None) -> PlaneRanker:
    """Load the plane ranker of a file; the last four are cached.

    Raises
    ------
    WeightsError
        The network cannot be loaded.
    """
    return _cached(None if weights is None else os.fspath(weights))


def _read(weights: str | os.PathLike[str] | None) -> tuple[str, bytes]:
    try:
        if weights is None:
            return f"The shipped policy {SHIPPED}", files("rlacd.weights").joinpath(SHIPPED).read_bytes()
        return str(weights), read_file(weights)
    except (OSError, ModuleNotFoundError) as error:
        name = SHIPPED if weights is None else weights
        raise WeightsError(
            f"The policy {name} cannot be read ({error}); reinstall rlacd or give another path."
        ) from error


def _about(name: str, metadata: str | None) -> About:
    try:
        about: dict[str, Any] = json.loads(metadata or "{}")
        if about.get("kind") != "guide":
            raise WeightsError(f"{name} is not a policy of rlacd: it does not say that it is a guide; export it again.")
        if about["features"] != VERSION:
            raise WeightsError(
                f"{name} was made for version {about['features']} of the features, not for {VERSION}; train it again."
            )
        least, greatest = (float(s) for s in about["scales"])
        per_axis, blend, bonus = int(about["per_axis"]), float(about["blend"]), float(about["edge_bonus"])
        if not 1 <= per_axis <= MOST_PLANES or not np.isfinite([least, greatest, blend, bonus]).all():
            raise ValueError("out of range")
        return About(per_axis, (least, greatest), blend, bonus)
    except (KeyError, TypeError, ValueError, AttributeError, OverflowError, RecursionError) as error:
        if isinstance(error, WeightsError):
            raise
        raise WeightsError(f"The metadata of {name} are damaged; export the policy again.") from error
