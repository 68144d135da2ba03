"""State encoders: what the Q network sees of a component, s(m) = (F(m), F(CH(m))) in the paper's 3.3."""

from __future__ import annotations

from pathlib import Path
from typing import Protocol

import torch

from rlacd.errors import OptionError
from rlacd.learn.encoders.i2p_mae import I2PMAEEncoder
from rlacd.learn.options import TrainOptions
from rlacd.policies.plane_features import FEATURES, PLANES, surface_points, sweep_features
from rlacd.solid.arrays import Float32Array
from rlacd.solid.component import Component

PUBLISHED = "https://github.com/ZrrSkywalker/I2P-MAE"


class Encoder(Protocol):
    """Describes components; nothing of it is learned.

    Attributes
    ----------
    dim : int
        Number of features, of a component or of each of its planes.
    outputs : int
        Values that the network finds from them: one of each plane's own features, or those of all 150 at once.
    digest : str
        Identifies the encoder's weights; empty if it has none.
    """

    dim: int
    outputs: int
    digest: str

    def describe(self, component: Component) -> Float32Array:
        """Features of a component, [dim] or [150, dim]; the same component always has the same."""


class SweepEncoder:
    """The cheap default: see `sweep_features`. One small network values any plane, also those never tried."""

    def __init__(self, threshold: float) -> None:
        self.dim, self.outputs, self.digest = FEATURES, 1, ""
        self._threshold = threshold

    def describe(self, component: Component) -> Float32Array:
        """See `Encoder`."""
        return sweep_features(component, self._threshold)


class PublishedEncoder:
    """I2P-MAE of the component's surface and of its hull's, as in the paper."""

    def __init__(self, network: I2PMAEEncoder, points: int) -> None:
        network.require_points(points)
        self.dim, self.outputs, self.digest = network.dim, PLANES, network.digest()
        self._network, self._points = network, points

    def describe(self, component: Component) -> Float32Array:
        """See `Encoder`."""
        points = torch.from_numpy(surface_points(component, self._points))
        with torch.inference_mode():
            features: Float32Array = self._network.encode(points[None])[0].numpy()
        return features


def make_encoder(options: TrainOptions) -> Encoder:
    """Build the encoder that the options name.

    Raises
    ------
    OptionError
        The encoder lacks weights that it needs or is given weights that it cannot use.
    WeightsError
        The file of weights cannot be used.
    """
    weights = options.encoder_weights
    if options.encoder == "i2p-mae":
        if not weights:
            how = f"give --encoder-weights FILE, the pre-trained checkpoint that {PUBLISHED} links to"
            raise OptionError(f"encoder i2p-mae needs weights: {how}, or use --encoder sweep, which needs none.")
        network = I2PMAEEncoder.from_checkpoint(Path(weights)).to(pick_device(options))
        return PublishedEncoder(network, options.points)
    if weights:
        raise OptionError(f"encoder {options.encoder} takes no weights; leave --encoder-weights out, or use i2p-mae.")
    return SweepEncoder(options.threshold)


def pick_device(options: TrainOptions) -> torch.device:
    """Get the device that the options ask for.

    Raises
    ------
    OptionError
        A GPU is requested and there is none.
    """
    has_gpu = torch.cuda.is_available()
    if options.device == "cuda" and not has_gpu:
        raise OptionError("device is 'cuda', but torch finds no GPU; use cpu, or install torch for CUDA.")
    if options.device == "auto":  # the network of sweep is so small that it learns as fast on the CPU
        return torch.device("cuda" if has_gpu and options.encoder == "i2p-mae" else "cpu")
    return torch.device(options.device)
