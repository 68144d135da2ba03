"""Writing the network for deployment (ONNX) and for further training (safetensors)."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import torch
from safetensors.torch import load_file, save_file

from rlacd.learn.onnx_file import onnx_bytes, to_onnx
from rlacd.learn.ranker.network import Ensemble, RankerNetwork
from rlacd.planes.candidates import OFFSETS_PER_AXIS
from rlacd.policies.features import COMPONENT_FEATURES, DIRECTIONS, EDGE_PLANES, PLANE_FEATURES, VERSION
from rlacd.policies.learned import INPUTS, OUTPUTS


def export(network: Ensemble, path: Path, about: dict[str, Any]) -> None:
    """Write ``path`` (ONNX) and the weights beside it (``.safetensors``).

    Parameters
    ----------
    network : Ensemble
    path : Path
        Ends in ``.onnx``.
    about : dict
        Goes into both files' metadata as JSON: inputs of the policy (see `rlacd.policies.learned`), and the weights'
        origin.
        the weights come from.
    """
    about = {"kind": "guide", "features": VERSION, "per_axis": OFFSETS_PER_AXIS, "width": network.width, **about}
    network = network.eval()
    example = (
        torch.zeros(2, DIRECTIONS, PLANE_FEATURES, OFFSETS_PER_AXIS),
        torch.zeros(2, EDGE_PLANES, PLANE_FEATURES),
        torch.zeros(2, COMPONENT_FEATURES),
    )
    model = to_onnx(network, example, INPUTS, OUTPUTS, {"planes": {3: "per_axis"}})
    path.write_bytes(onnx_bytes(model, about))
    weights = path.with_suffix(".safetensors")
    save_file(network.state_dict(), weights, {"rlacd": json.dumps(about, sort_keys=True)})
    weights.chmod(0o644)  # temporary files are private to their owner


def load_network(path: Path) -> Ensemble:
    """Read the network back from its ``.safetensors``."""
    state = load_file(path)
    width = state["members.0.plane.weight"].shape[0]
    members = {key.split(".")[1] for key in state}
    network = Ensemble([RankerNetwork(width) for _ in members])
    network.load_state_dict(state)
    return network.eval()
