"""The trained policy as files: ONNX for inference, safetensors for further training, JSON for its description."""

from __future__ import annotations

import dataclasses
import json
from pathlib import Path
from typing import Any

import numpy as np
import torch
from safetensors.torch import save_file
from torch import Tensor, nn

from rlacd.errors import TrainingError
from rlacd.learn.encoders import AnyEncoder
from rlacd.learn.onnx_file import onnx_bytes, to_onnx
from rlacd.learn.paper.options import TrainOptions
from rlacd.learn.paper.qnetwork import QNetwork
from rlacd.policies.observe import SCALE_INPUTS
from rlacd.policies.q_network import INPUTS, KIND, OUTPUTS, OnnxQ


class PointsToValues(nn.Module):
    """Encoder and Q network in one: from an `Observation` to the values of its planes."""

    def __init__(self, encoder: nn.Module, network: QNetwork, scale_input: bool) -> None:
        super().__init__()
        self.encoder = encoder
        self.network = network
        self.scale_input = scale_input

    def forward(self, points: Tensor, directions: Tensor, scale: Tensor) -> Tensor:
        """Values [B, 150] of points [B, 2, N, 3], directions [B, 6, 3] and scale [B, S]."""
        features = self.encoder(points, directions)
        if self.scale_input:
            features = torch.cat([features, scale], dim=1)
        else:  # the input stays in the graph, so that all exported policies have the same inputs
            features = features + 0 * scale.sum(dim=1, keepdim=True)
        values: Tensor = self.network(features)
        return values


def export_policy(path: Path, encoder: AnyEncoder, network: QNetwork, options: TrainOptions) -> Path:
    """Write ``path`` (ONNX: points, directions, scale -> values), and beside it ``.safetensors`` and ``.json``.

    The exported file is run once and compared with torch.

    Raises
    ------
    TrainingError
        onnxruntime and torch give different results.
    """
    module = PointsToValues(encoder.cpu(), network.cpu(), options.scale_input).eval()
    generator = torch.Generator().manual_seed(0)
    example = (
        torch.rand(2, 2, options.points, 3, generator=generator) * 2 - 1,
        torch.eye(3).repeat(2, 2, 1),
        torch.rand(2, SCALE_INPUTS, generator=generator),
    )
    about: dict[str, Any] = {"kind": KIND, "points": options.points, "threshold": options.threshold}
    path.write_bytes(onnx_bytes(to_onnx(module, example, INPUTS, OUTPUTS), about))
    with torch.inference_mode():
        expected = module(*example).numpy()
    found = OnnxQ(path).run(*(x.numpy() for x in example))
    if not np.allclose(found, expected, rtol=1e-3, atol=1e-3 * network.unit):
        raise TrainingError(
            f"{path} does not compute what the network does; report it with the versions of torch and onnxruntime."
        )
    save_file({k: v.contiguous() for k, v in network.state_dict().items()}, path.with_suffix(".safetensors"))
    described = {"inputs": list(INPUTS), "unit": network.unit, "options": dataclasses.asdict(options)}
    path.with_suffix(".json").write_text(json.dumps(described, indent=1), encoding="utf-8")
    return path
