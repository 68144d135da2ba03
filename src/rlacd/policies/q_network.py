"""A Q network and its encoder in one ONNX file, run by onnxruntime (written by `rlacd.learn.paper.export`)."""

from __future__ import annotations

import json
import math
import os
from functools import lru_cache
from typing import TYPE_CHECKING, Any

from rlacd.errors import WeightsError
from rlacd.io.read.open_file import read_file
from rlacd.policies.network_file import open_network
from rlacd.policies.observe import Float32Array, Observation

if TYPE_CHECKING:
    import onnxruntime

KIND = "q"
"""The `kind` in the metadata of such a file."""

INPUTS = ("points", "directions", "scale")

OUTPUTS = ("values",)

MOST_POINTS = 2**17
"""Maximum number of points per surface that a network may ask for; the paper's uses 2,048."""

METADATA = "rlacd"
"""Metadata key of rlacd's JSON."""


class OnnxQ:
    """An exported Q network, run on one thread because components are processed in parallel already.

    Parameters
    ----------
    path : path

    Attributes
    ----------
    points : int
        Number of points on each of the two surfaces in training.
    threshold : float
        Concavity threshold of the training.

    Raises
    ------
    WeightsError
        The file is missing, damaged, or not a Q network of this version.
    """

    points: int
    threshold: float

    def __init__(self, path: str | os.PathLike[str]) -> None:
        try:
            self._session = open_network(read_file(path))
            signature = [
                tuple(v.name for v in given) for given in (self._session.get_inputs(), self._session.get_outputs())
            ]
        except OSError as error:
            raise WeightsError(f"The policy {path} cannot be read ({error}); give another path.") from error
        except Exception as error:  # onnxruntime's own exceptions have no public base
            raise WeightsError(f"{path} is damaged or not an ONNX file; export the policy again.") from error
        about = _about(self._session)
        if about.get("kind") != KIND or signature != [INPUTS, OUTPUTS]:
            raise WeightsError(f"{path} is not a Q network of rlacd; export the policy again.")
        try:
            self.points, self.threshold = int(about["points"]), float(about["threshold"])
            if not 1 <= self.points <= MOST_POINTS or not 0 < self.threshold < math.inf:
                raise ValueError
        except (KeyError, TypeError, ValueError, OverflowError) as error:
            raise WeightsError(f"The metadata of {path} are damaged; export the policy again.") from error

    def run(self, points: Float32Array, directions: Float32Array, scale: Float32Array) -> Float32Array:
        """Values [B, 150] of points [B, 2, N, 3], directions [B, 6, 3] and scale [B, S]."""
        given = dict(zip(INPUTS, (points, directions, scale), strict=True))
        values: Float32Array = self._session.run(list(OUTPUTS), given)[0]
        return values

    def __call__(self, seen: Observation) -> Float32Array:
        """Values [150] of one observed component."""
        known = self._session.get_inputs()[-1].shape[1]  # older files know the first three entries of `scale`
        scale = seen.scale[None, :known] if isinstance(known, int) else seen.scale[None]
        values: Float32Array = self.run(seen.points[None], seen.directions[None], scale)[0]
        return values


@lru_cache(maxsize=2)
def load_q_network(path: str) -> OnnxQ:
    """Load the Q network of a file (see `OnnxQ`); the last two are cached."""
    return OnnxQ(path)


def _about(session: onnxruntime.InferenceSession) -> dict[str, Any]:
    try:
        about = json.loads(session.get_modelmeta().custom_metadata_map.get(METADATA, "{}"))
    except (ValueError, RecursionError):
        return {}
    return about if isinstance(about, dict) else {}
