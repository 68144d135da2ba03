"""Networks as files: weights of linear layers in an uncompressed .npz without pickle, evaluated by a kernel.

The paper's Q network chooses the best of the 150 planes, or a plane by the paper's deployment rule (4.2).
"""

from __future__ import annotations

import io
import json
import math
import os
import zipfile
from collections.abc import Callable, Mapping, Sequence
from functools import lru_cache
from itertools import chain, pairwise
from types import MappingProxyType
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rlacd import _native
from rlacd.errors import OptionError, WeightsError, import_extra
from rlacd.io.read.open_file import read_file
from rlacd.planes.candidates import EDGES_PER_COMPONENT
from rlacd.planes.sweep import distinct_planes, paper_planes
from rlacd.policies.encoder import Encoder, SweepEncoder
from rlacd.policies.greedy import least_hulls
from rlacd.solid.arrays import Float32Array
from rlacd.solid.component import Component, Plane

MOST_BYTES = 2**28
"""Size of the largest file that is read; the paper's network has 7 MB."""


DAMAGE = (
    *(ValueError, KeyError, TypeError, AttributeError, EOFError, OSError, ArithmeticError),
    *(MemoryError, RuntimeError, zipfile.BadZipFile),
)
"""Exceptions that parsing a damaged file may raise."""

DAMAGED = "{} is damaged or not a network of rlacd; train or fetch it again."

ENCODER = "encoder."
"""Prefix of the encoder's weights in a file."""


class Network:
    """Linear layers with ReLU between them.

    Parameters
    ----------
    layers : sequence of (weight [outputs, inputs], bias [outputs])
    about : mapping
        Facts in the file: ``kind``; ``threshold``, the length of the criterion it was trained with; ``encoder``, if it
        is not the sweep's: its ``digest``, and what `rlacd.policies.points.PointEncoder` is made from.
    encoder : mapping
        The encoder's weights by name, if it has any.
    """

    def __init__(
        self,
        layers: Sequence[tuple[NDArray[np.generic], NDArray[np.generic]]],
        about: Mapping[str, Any],
        encoder: Mapping[str, NDArray[Any]] = MappingProxyType({}),
    ) -> None:
        self.layers = [(w.astype(np.float32), b.astype(np.float32)) for w, b in layers]
        self._by_input = [np.ascontiguousarray(weight.T) for weight, _ in self.layers]
        self._biases = [bias for _, bias in self.layers]
        self.about, self.encoder = about, encoder
        self.threshold = float(about["threshold"])

    def __call__(self, features: Float32Array) -> Float32Array:
        """Outputs [..., outputs] of features [..., inputs]."""
        *rows, inputs = features.shape
        flat = np.ascontiguousarray(features.reshape(-1, inputs))
        return _native.network_outputs(flat, self._by_input, self._biases).reshape(*rows, len(self._biases[-1]))

    def to_bytes(self) -> bytes:
        """Make the content of a file."""
        arrays = {f"{name}{i}": a for i, layer in enumerate(self.layers) for name, a in zip("wb", layer, strict=True)}
        arrays |= {ENCODER + name: array for name, array in self.encoder.items()}
        file = io.BytesIO()
        about = np.frombuffer(json.dumps(dict(self.about)).encode(), np.uint8)
        np.savez(file, allow_pickle=False, about=about, **arrays)
        return file.getvalue()


def load_network(path: str | os.PathLike[str], kind: str, inputs: int, outputs: int) -> Network:
    """Read a network of a kind; the last four are cached, by their content.

    Raises
    ------
    WeightsError
        The file is missing, damaged, or not a network of this kind.
    """
    return _of_kind(_read(path), path, kind, inputs, outputs)


def _of_kind(network: Network, path: str | os.PathLike[str], kind: str, inputs: int, outputs: int) -> Network:
    shape = network.layers[0][0].shape[1], network.layers[-1][0].shape[0]
    if network.about.get("kind") != kind or shape != (inputs, outputs):
        raise WeightsError(f"{path} is not a network of this kind ({kind}, {inputs} inputs); give another path.")
    return network


def _read(path: str | os.PathLike[str]) -> Network:
    """Read a network; what a file holds may change, as that of a training does."""
    try:
        content = read_file(path)
    except OSError as error:
        raise WeightsError(f"The policy {path} cannot be read ({error}); give another path.") from error
    try:
        return _parsed(content)
    except DAMAGE as error:
        raise WeightsError(DAMAGED.format(path)) from error


def parse_network(content: bytes) -> Network:
    """Parse the content of a file; anything but a network raises one of many exceptions."""
    with zipfile.ZipFile(io.BytesIO(content)) as archive:
        if len(content) > MOST_BYTES or any(m.compress_type != zipfile.ZIP_STORED for m in archive.infolist()):
            raise ValueError
    with np.load(io.BytesIO(content), allow_pickle=False) as arrays:
        about = json.loads(arrays["about"].tobytes())
        layers = []
        for i in range(sum(name.startswith("w") for name in arrays.files)):
            weight, bias = arrays[f"w{i}"], arrays[f"b{i}"]
            if weight.ndim != 2 or bias.shape != weight.shape[:1] or {weight.dtype.kind, bias.dtype.kind} != {"f"}:
                raise ValueError
            layers.append((weight, bias))
        encoder = {name.removeprefix(ENCODER): arrays[name] for name in arrays.files if name.startswith(ENCODER)}
    if not layers or any(a[0].shape[0] != b[0].shape[1] for a, b in pairwise(layers)):
        raise ValueError
    if not {array.dtype.kind for array in encoder.values()} <= {"f", "i"}:
        raise ValueError
    if not all(np.isfinite(a).all() for a in (*chain(*layers), *encoder.values())):
        raise ValueError
    network = Network(layers, about, encoder)
    if not 0 < network.threshold < math.inf:
        raise ValueError
    return network


_parsed = lru_cache(maxsize=4)(parse_network)

SHORTLIST = 10
"""Number of planes of greatest value from which the paper takes the one with the least sum of hull volumes."""

KIND = "rl-acd"

QFunction = Callable[[Component], Float32Array]
"""Values [150] of a component's planes (`paper_planes`)."""


class QPolicy:
    """Takes the plane of greatest value, or the one with the least hull sum among the best (the paper's deployment).

    Parameters
    ----------
    values : callable
    shortlist : int
        Number of best planes from which the one with the least sum of hull volumes is taken (paper: 10).
    reflex_edges : int
        Number of reflex edges whose planes join the shortlist (paper: 4, three planes each).
    """

    def __init__(self, values: QFunction, shortlist: int = 1, reflex_edges: int = 0) -> None:
        self._values = values
        self._shortlist = shortlist
        self._reflex_edges = reflex_edges

    def choose(self, component: Component, threads: int = 1) -> Plane | None:
        """Choose the plane to cut a component by; None if no candidate is valid."""
        candidates = paper_planes(component)
        valid = distinct_planes(component, candidates)
        if not valid.any():
            return None
        best = best_planes(self._values(component), valid, self._shortlist)
        if len(best) == 1 and not self._reflex_edges:
            return candidates.plane(int(best[0]))
        return least_hulls(component, candidates, best, self._reflex_edges, threads)


def deployed(path: str, scale: float | None = None) -> QPolicy:
    """Deploy a network as the paper does; see `q_values`."""
    return QPolicy(q_values(path, scale), SHORTLIST, EDGES_PER_COMPONENT)


def q_values(path: str, scale: float | None = None, encoder: Encoder | None = None) -> QFunction:
    """Get the values of planes by a file that ``rlacd train`` wrote.

    Parameters
    ----------
    scale : float, optional
        The criterion's length in the frame; the network's own by default.
    encoder : Encoder, optional
        One of your own that the network was trained with; by default the one that the file names.

    Raises
    ------
    WeightsError
        The file is missing, damaged, or not a network of this kind.
    OptionError
        The network was trained with an encoder of one's own, and this is not it.
    MissingExtraError
        The encoder needs torch.
    """
    file = _read(path)
    own = file.about.get("encoder")
    if isinstance(own, str) and (encoder is None or encoder.digest != own):
        raise OptionError(f"{path} needs an encoder of your own ({own}); give it to load_policy of rlacd.learn.train.")
    sees = encoder or _encoder_of(file, path, scale)
    network = _of_kind(file, path, KIND, sees.dim, sees.outputs)
    return lambda component: network(sees.describe(component)).reshape(-1)


def named_encoder(path: str, scale: float | None = None) -> Encoder:
    """Get the encoder that a network's file names; raises as `q_values`."""
    return _encoder_of(_read(path), path, scale)


def _encoder_of(file: Network, path: str, scale: float | None) -> Encoder:
    try:
        return _stored_encoder(file, file.threshold if scale is None else scale)
    except DAMAGE as error:
        raise WeightsError(DAMAGED.format(path)) from error


@lru_cache(maxsize=4)
def _stored_encoder(file: Network, threshold: float) -> Encoder:
    if "encoder" not in file.about:
        return SweepEncoder(threshold)
    import_extra("torch", "a policy that sees points", "train")
    from rlacd.policies.points import PointEncoder

    return PointEncoder.stored(file.about["encoder"], file.encoder)


def best_planes(values: Float32Array, mask: NDArray[np.bool_], count: int) -> NDArray[np.intp]:
    """Indices of up to `count` valid planes of greatest value, greatest first; ties in index order."""
    order = np.argsort(-np.where(mask, values, -np.inf), kind="stable")
    kept: NDArray[np.intp] = order[: min(count, int(mask.sum()))]
    return kept
