"""The Q network in training as a policy."""

from __future__ import annotations

import torch

from rlacd.learn.encoders import Encoder, describe
from rlacd.learn.paper.options import TrainOptions
from rlacd.learn.paper.qnetwork import QNetwork
from rlacd.policies.observe import Float32Array, Observation
from rlacd.policies.qpolicy import QPolicy


def torch_policy(network: QNetwork, encoder: Encoder, options: TrainOptions, **deployment: int) -> QPolicy:
    """Make a policy of the current network; `deployment` is `QPolicy`'s shortlist and concave_edges."""
    device = next(network.parameters()).device

    def values(seen: Observation) -> Float32Array:
        features = torch.from_numpy(describe(encoder, [seen], options.scale_input)).to(device)
        with torch.inference_mode():
            q: Float32Array = network(features)[0].cpu().numpy()
        return q

    return QPolicy(values, options.threshold, options.points, **deployment)
