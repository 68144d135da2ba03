"""The training's part in a pool process: one episode, from a mesh to its record."""

from __future__ import annotations

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from manifold3d import Manifold
from safetensors.torch import load

from rlacd.criteria import Concavity
from rlacd.learn.device import pick_device
from rlacd.learn.encoders import AnyEncoder, make_encoder
from rlacd.learn.meshes import take_solid, turned
from rlacd.learn.paper.episodes import begin
from rlacd.learn.paper.options import TrainOptions
from rlacd.learn.paper.player import Player, one_thread
from rlacd.learn.paper.qnetwork import QNetwork
from rlacd.learn.paper.record import Record
from rlacd.policies.observe import SCALE_INPUTS
from rlacd.pool import Blobs, Shared

SERVER = "rlacd.learn.paper.rollout_server:RolloutServer"


class RolloutServer:
    """Plays episodes.

    Parameters
    ----------
    staging : Path
        A folder for temporary files.
    """

    def __init__(self, staging: Path) -> None:
        self._staging = staging
        self._setting = ""
        self._options: TrainOptions
        self._encoder: AnyEncoder
        self._weights = ""
        self._network: QNetwork

    def __call__(
        self, values: dict[str, Any], blobs: Blobs, shared: Mapping[str, Shared]
    ) -> tuple[dict[str, Any], dict[str, bytes]]:
        """Play an episode.

        Parameters
        ----------
        values : dict
            ``axis`` and ``degrees`` of the turn, ``epsilon``, and the ``seed`` of the random numbers.
        blobs : dict of bytes
            The repaired solid (`rlacd.learn.meshes.SOLID`), or the files of the mesh.
        shared : dict of Shared
            ``setting``: ``options`` as JSON, and the ``encoder``'s file of weights if it has one. ``network``:
            ``weights``; without it, cuts are random.

        Returns
        -------
        dict
            Empty.
        dict of bytes
            ``record``, and `SOLID` if it had to be repaired.
        """
        with one_thread():
            self._take_over(shared)
            solid, kept = take_solid(blobs, self._staging)
            record = Record.empty("nothing") if solid is None else self._play(solid, values, "network" in shared)
        return {}, {"record": record.as_bytes(), **kept}

    def _play(self, solid: Manifold, values: dict[str, Any], by_network: bool) -> Record:
        options = self._options
        component = turned(solid, values["axis"], values["degrees"])
        cutting = begin(component, Concavity(options.threshold), options.max_parts)
        if cutting is None:
            return Record.empty("nothing")
        network = self._network if by_network else None
        rng = np.random.default_rng(values["seed"])
        return Player(cutting, options, self._encoder, network, values["epsilon"], rng).play()

    def _take_over(self, shared: Mapping[str, Shared]) -> None:
        """Rebuild whatever changed in the shared data since the last request."""
        setting = shared["setting"]
        if setting.key != self._setting:
            self._options = TrainOptions(**json.loads(setting.blobs["options"]))
            self._encoder = self._make_encoder(setting.blobs.get("encoder"))
            self._setting, self._weights = setting.key, ""
        if "network" in shared and shared["network"].key != self._weights:
            state = load(shared["network"].blobs["weights"])
            if not self._weights:
                inputs = self._encoder.dim + (SCALE_INPUTS if self._options.scale_input else 0)
                self._network = QNetwork.of(inputs, self._options)
            self._network.load_state_dict(state)
            self._weights = shared["network"].key

    def _make_encoder(self, weights: bytes | None) -> AnyEncoder:
        file = self._staging / Path(self._options.encoder_weights).name
        if weights is not None:
            file.write_bytes(weights)
        given = "" if weights is None else file
        return make_encoder(self._options.encoder, given, pick_device(self._options.device))
