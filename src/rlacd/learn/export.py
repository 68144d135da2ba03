"""The trained policy as files: ONNX to run, safetensors to train on, JSON to tell what it is."""

from __future__ import annotations

import dataclasses
import json
import logging
import warnings
from pathlib import Path

import numpy as np
import onnx
import torch
from safetensors.torch import save_file
from torch import Tensor, nn

from rlacd.errors import TrainingError
from rlacd.learn import onnx_operators
from rlacd.learn.encoders import AnyEncoder
from rlacd.learn.options import TrainOptions
from rlacd.learn.qnetwork import QNetwork
from rlacd.policies.observe import SCALE_INPUTS
from rlacd.policies.q_network import INPUTS, KIND, METADATA, OnnxQ

OPSET = 18


class PointsToValues(nn.Module):
    """Encoder and Q network in one: from an `Observation` to the values of its planes."""

    def __init__(self, encoder: nn.Module, network: QNetwork, scale_input: bool) -> None:
        super().__init__()
        self.encoder = encoder
        self.network = network
        self.scale_input = scale_input

    def forward(self, points: Tensor, directions: Tensor, scale: Tensor) -> Tensor:
        """Values [B, 150] of points [B, 2, N, 3], directions [B, 6, 3] and scale [B, 3]."""
        features = self.encoder(points, directions)
        if self.scale_input:
            features = torch.cat([features, scale], dim=1)
        else:  # the input stays in the graph, so that all exported policies are asked alike
            features = features + 0 * scale.sum(dim=1, keepdim=True)
        values: Tensor = self.network(features)
        return values


def export_policy(path: Path, encoder: AnyEncoder, network: QNetwork, options: TrainOptions) -> Path:
    """Write ``path`` (ONNX: points, directions, scale -> values), and beside it ``.safetensors`` and ``.json``.

    The exported file is run once and compared with torch.

    Raises
    ------
    TrainingError
        onnxruntime does not compute what torch does.
    """
    module = PointsToValues(encoder.cpu(), network.cpu(), options.scale_input).eval()
    generator = torch.Generator().manual_seed(0)
    example = (
        torch.rand(2, 2, options.points, 3, generator=generator) * 2 - 1,
        torch.eye(3).repeat(2, 2, 1),
        torch.rand(2, SCALE_INPUTS, generator=generator),
    )
    model = to_onnx(module, example, INPUTS, "values")
    _describe(model, options)
    path.write_bytes(model.SerializeToString(deterministic=True))
    with torch.inference_mode():
        expected = module(*example).numpy()
    found = OnnxQ(path).run(*(x.numpy() for x in example))
    if not np.allclose(found, expected, rtol=1e-3, atol=1e-3 * network.unit):
        raise TrainingError(
            f"{path} does not compute what the network does; report it with the versions of torch and onnxruntime."
        )
    save_file({k: v.contiguous() for k, v in network.state_dict().items()}, path.with_suffix(".safetensors"))
    about = {"inputs": list(INPUTS), "unit": network.unit, "options": dataclasses.asdict(options)}
    path.with_suffix(".json").write_text(json.dumps(about, indent=1))
    return path


def to_onnx(module: nn.Module, example: tuple[Tensor, ...], inputs: tuple[str, ...], output: str) -> onnx.ModelProto:
    """Translate a module of tensors [B, ...] to one tensor [B, ...], for any B; nothing of this machine goes along.

    Parameters
    ----------
    module : torch.nn.Module
    example : tuple of Tensor
        Inputs of the shapes to come, but for B, which should be 2 here.
    inputs : tuple of str
    output : str
        Their names in the graph.
    """
    for name in ("torch.onnx", "onnxscript"):
        logging.getLogger(name).setLevel(logging.ERROR)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # the exporter's own deprecations
        program = torch.onnx.export(
            module,
            example,
            dynamo=True,
            verbose=False,
            input_names=list(inputs),
            output_names=[output],
            dynamic_shapes=tuple({0: torch.export.Dim("batch")} for _ in inputs),
            opset_version=OPSET,
            custom_translation_table={torch.ops.rlacd.farthest_points.default: onnx_operators.farthest_points},
        )
    assert program is not None
    model = program.model_proto
    _without_traces(model)
    for graph in (model.graph, *model.functions):
        _without_traces(graph)
    onnx.checker.check_model(model)
    return model


def _without_traces(part: onnx.ModelProto | onnx.GraphProto | onnx.FunctionProto) -> None:
    """Take out what the exporter says of its own run: source lines, with the paths of the machine it ran on."""
    del part.metadata_props[:]
    if isinstance(part, onnx.ModelProto):
        return
    for value in part.value_info:
        del value.metadata_props[:]
    for node in part.node:
        del node.metadata_props[:]
        node.doc_string = ""
        for attribute in node.attribute:
            if attribute.type == onnx.AttributeProto.GRAPH:  # the body of a loop
                _without_traces(attribute.g)


def _describe(model: onnx.ModelProto, options: TrainOptions) -> None:
    """Say in the metadata what the policy has to know; see `rlacd.policies.q_network`."""
    about = {"kind": KIND, "points": options.points, "threshold": options.threshold}
    onnx.helper.set_model_props(model, {METADATA: json.dumps(about, sort_keys=True)})
