"""The plane ranker's part in a pool process: the labels of one mesh."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from rlacd.learn.files import packed
from rlacd.learn.meshes import take_solid
from rlacd.learn.ranker.label import label
from rlacd.learn.ranker.rollout import Cost
from rlacd.policies.greedy import excess_norm
from rlacd.policies.learned import PlaneRanker, ranked_cost
from rlacd.pool import Blobs, Shared

OTHERS = 0.4
"""Fraction of meshes labelled at another threshold, from half to twice the usual one."""

TOO_MANY_FACES = 3000
"""Repaired meshes with more faces are skipped: several smaller ones can be labelled in the same time."""

SERVER = "rlacd.learn.ranker.label_server:LabelServer"


class LabelServer:
    """Labels the states of meshes.

    Parameters
    ----------
    staging : Path
        A folder for temporary files.
    """

    def __init__(self, staging: Path) -> None:
        self._staging = staging
        self._key = ""
        self._guide: PlaneRanker

    def __call__(
        self, values: dict[str, Any], blobs: Blobs, shared: Mapping[str, Shared]
    ) -> tuple[dict[str, Any], dict[str, bytes]]:
        """Label a mesh.

        Parameters
        ----------
        values : dict
            ``threshold`` for most meshes, ``budget`` (see `rlacd.learn.ranker.label.label`), and the ``seed`` of the
            random numbers.
        blobs : dict of bytes
            The repaired solid (`rlacd.learn.meshes.SOLID`), or the files of the mesh.
        shared : dict of Shared
            ``network``, ``{"onnx": bytes}``: the plane ranker to follow; without it, the greedy policy.

        Returns
        -------
        dict
            ``labels``: their number.
        dict of bytes
            ``labels``, as an .npz file, and `SOLID` if it had to be repaired.
        """
        manifold, kept = take_solid(blobs, self._staging)
        if manifold is None or manifold.num_tri() > TOO_MANY_FACES:
            return {"labels": 0}, {"labels": packed({}, compressed=True), **kept}
        rng = np.random.default_rng(values["seed"])
        threshold = values["threshold"] * float(2 ** rng.uniform(-1, 1) if rng.random() < OTHERS else 1)
        found = label(manifold, threshold, self._cost(threshold, shared), values["budget"], rng)
        return {"labels": len(found.parts)}, {"labels": packed(found.arrays(), compressed=True), **kept}

    def _cost(self, threshold: float, shared: Mapping[str, Shared]) -> Cost:
        """The policy to follow: greedy at first, then the last network."""
        if "network" not in shared:
            return lambda component, swept: excess_norm(swept)
        if shared["network"].key != self._key:
            network = self._staging / "ranker.onnx"
            network.write_bytes(shared["network"].blobs["onnx"])
            self._guide, self._key = PlaneRanker(network), shared["network"].key
        return lambda component, swept: ranked_cost(self._guide, component, swept, threshold)
