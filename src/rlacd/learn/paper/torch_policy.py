"""The network in training, or of a finished run, as a policy."""

from __future__ import annotations

import json
from pathlib import Path

import torch
from safetensors.torch import load_file

from rlacd.learn.encoders import Encoder, describe, make_encoder
from rlacd.learn.paper.lookahead import Lookahead
from rlacd.learn.paper.options import TrainOptions
from rlacd.learn.paper.qnetwork import QNetwork
from rlacd.policies import Policy
from rlacd.policies.observe import SCALE_INPUTS, Float32Array, Observation
from rlacd.policies.qpolicy import QPolicy


def load_policy(run: Path) -> Policy:
    """Get the best network of a run as a policy: lookahead, or the plane of greatest value."""
    options = TrainOptions(**json.loads((run / "options.json").read_text(encoding="utf-8")))
    encoder = make_encoder(options.encoder, options.encoder_weights)
    network = QNetwork.of(encoder.dim + (SCALE_INPUTS if options.scale_input else 0), options)
    network.load_state_dict(load_file(run / "best.safetensors"))
    return torch_policy(network, encoder, options)


def torch_policy(network: QNetwork, encoder: Encoder, options: TrainOptions, **deployment: int) -> Policy:
    """Make a policy of the current network; `deployment` is `QPolicy`'s shortlist and concave_edges."""
    if options.lookahead:
        return Lookahead(network, encoder, options)
    device = next(network.parameters()).device

    def values(seen: Observation) -> Float32Array:
        features = torch.from_numpy(describe(encoder, [seen], options.scale_input)).to(device)
        with torch.inference_mode():
            q: Float32Array = network(features)[0].cpu().numpy()
        return q

    return QPolicy(values, options.threshold, options.points, **deployment)
