"""Export of torch networks to ONNX."""

from __future__ import annotations

import json
import logging
import warnings
from collections.abc import Mapping, Sequence
from typing import Any

import onnx
import torch
from torch import Tensor, nn

from rlacd.learn import onnx_operators
from rlacd.learn.encoders import point_groups  # noqa: F401  # registers the operator that is translated
from rlacd.policies.q_network import METADATA

OPSET = 18


def to_onnx(
    module: nn.Module,
    example: tuple[Tensor, ...],
    inputs: Sequence[str],
    outputs: Sequence[str],
) -> onnx.ModelProto:
    """Export a module of tensors [B, ...] to tensors [B, ...], for any B, without traces of the exporting machine.

    Parameters
    ----------
    module : torch.nn.Module
    example : tuple of Tensor
        Inputs of the shapes to expect, except for B, which should be 2 here.
    inputs, outputs : sequence of str
        Names in the graph.
    """
    batch = torch.export.Dim("batch", min=1)
    for logger in ("torch.onnx", "onnxscript"):
        logging.getLogger(logger).setLevel(logging.ERROR)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # deprecations inside the exporter
        program = torch.onnx.export(
            module,
            example,
            dynamo=True,
            verbose=False,
            input_names=list(inputs),
            output_names=list(outputs),
            dynamic_shapes=tuple({0: batch} for _ in inputs),
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
    """Remove the exporter's record of its run: source lines, with paths on the exporting machine."""
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


def onnx_bytes(model: onnx.ModelProto, about: Mapping[str, Any]) -> bytes:
    """Serialise a model with metadata for the policy, as JSON."""
    onnx.helper.set_model_props(model, {METADATA: json.dumps(about, sort_keys=True)})
    content: bytes = model.SerializeToString(deterministic=True)
    return content
