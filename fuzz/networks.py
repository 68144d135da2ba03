"""Small Q networks as ONNX files, written without training."""

from __future__ import annotations

import json
from collections.abc import Mapping
from typing import Any

import numpy as np
import onnx

from rlacd.policies.q_network import INPUTS, KIND, METADATA, OUTPUTS

ABOUT: Mapping[str, Any] = {"kind": KIND, "points": 64, "threshold": 0.05}
"""Metadata of a sound network."""

PLANES = 150


def q_network(about: Mapping[str, Any] = ABOUT, location: str | None = None) -> bytes:
    """A network whose values are a fixed linear function of the component's scale.

    Parameters
    ----------
    about : mapping
        Metadata.
    location : str, optional
        A file that the weights are said to be in, in place of this one.
    """
    made, kind = onnx.helper, onnx.TensorProto
    values = np.random.default_rng(0).standard_normal((3, PLANES)).astype(np.float32)
    weights = made.make_tensor("w", kind.FLOAT, values.shape, values.tobytes(), raw=True)
    if location is not None:
        weights = onnx.TensorProto(name="w", data_type=kind.FLOAT, dims=values.shape, data_location=kind.EXTERNAL)
        for key, value in {"location": location, "offset": "0", "length": str(values.nbytes)}.items():
            weights.external_data.add(key=key, value=value)
    shapes = (["b", 2, "n", 3], ["b", 6, 3], ["b", 3])
    inputs = [made.make_tensor_value_info(name, kind.FLOAT, shape) for name, shape in zip(INPUTS, shapes, strict=True)]
    outputs = [made.make_tensor_value_info(OUTPUTS[0], kind.FLOAT, ["b", PLANES])]
    graph = made.make_graph(
        [made.make_node("MatMul", [INPUTS[2], "w"], list(OUTPUTS))], "g", inputs, outputs, initializer=[weights]
    )
    model = made.make_model(graph, opset_imports=[made.make_opsetid("", 18)], ir_version=9)
    made.set_model_props(model, {METADATA: json.dumps(dict(about))})
    content: bytes = model.SerializeToString()
    return content
