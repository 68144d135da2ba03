"""State encoders: from surface points of a component and of its hull to the features that the Q network sees.

An encoder is a torch module whose state does not change in training: its features are computed once per component and
kept in the replay buffer, and the module is exported to ONNX in front of the Q network.
"""

from __future__ import annotations

from typing import Protocol, runtime_checkable

import numpy as np
import torch
from torch import Tensor

from rlacd.policies.observe import Float32Array, Observation


@runtime_checkable
class Encoder(Protocol):
    """The interface of an encoder in training; a `torch.nn.Module` with a `dim` satisfies it."""

    @property
    def dim(self) -> int:
        """Number of features per component."""

    def encode(self, points: Tensor, directions: Tensor) -> Tensor:
        """Describe components by points of their surface and of their hull's.

        Parameters
        ----------
        points : float32 [B, 2, N, 3]
            In each component's own frame: bounding box centred, longest side 2.
        directions : float32 [B, 6, 3]
            The unit normals of the candidate planes. An encoder may ignore them.

        Returns
        -------
        float32 [B, dim]
        """


def describe(encoder: Encoder, observations: list[Observation], scale_input: bool) -> Float32Array:
    """Features [B, dim (+ 3)] of components, rounded to half precision as they are stored in replay."""
    points = torch.from_numpy(np.stack([o.points for o in observations]))
    directions = torch.from_numpy(np.stack([o.directions for o in observations]))
    with torch.inference_mode():
        features: Float32Array = encoder.encode(points, directions).numpy()
    if scale_input:
        features = np.concatenate([features, np.stack([o.scale for o in observations])], axis=1)
    return features.astype(np.float16).astype(np.float32)
