"""An endless, fixed sequence of colours that tell hulls apart."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

# Found by a greedy search in Oklab (Ottosson 2020, https://bottosson.github.io/posts/oklab/): each colour is the
# farthest from all before it, as seen by the eye that tells it apart least: normal, protanopic, deuteranopic
# or tritanopic (Machado et al. 2009, https://doi.org/10.1109/TVCG.2009.113); tests/io/test_palette.py.
DISTINCT = bytes.fromhex("5899e0f8d05cb05315ec8781abd2fe8a5e97ad8b1c65f2c353c1c54b7f5fbdba42d26ea4")

SHADES = 0.1  # how far the lightness of repeated colours is spread


def hull_colors(count: int) -> npt.NDArray[np.uint8]:
    """Return `count` colours as sRGB, uint8 [count, 3].

    Twelve colours that colour-blind people can tell apart too, then the same colours slightly lighter or darker, and so
    on: the first two hundred all differ. The first colours do not depend on `count`.
    """
    twelve = np.frombuffer(DISTINCT, dtype=np.uint8).reshape(-1, 3)
    index = np.arange(count)
    shaded = twelve[index % len(twelve)] + 255 * SHADES * _spread(index // len(twelve))[:, None]
    return np.asarray(np.rint(shaded.clip(0, 255)), dtype=np.uint8)


def _spread(index: npt.NDArray[np.int64]) -> npt.NDArray[np.float64]:
    """Numbers in (-1/2, 1/2) without repetition, the first 0: the van der Corput sequence with alternating halves."""
    reversed_bits, weight = np.zeros(len(index)), 0.5
    while index.any():
        reversed_bits += weight * (index % 2)
        index, weight = index // 2, weight / 2
    return np.where(reversed_bits >= 0.5, reversed_bits - 1.0, reversed_bits)


def srgb_from_linear(linear: npt.NDArray[np.float64]) -> npt.NDArray[np.uint8]:
    """sRGB bytes of linear light [..., 3] in [0, 1] (IEC 61966-2-1)."""
    encoded = np.where(linear <= 0.0031308, 12.92 * linear, 1.055 * linear ** (1.0 / 2.4) - 0.055)
    return np.rint(255.0 * encoded).astype(np.uint8)


def linear_from_srgb(srgb: npt.NDArray[np.uint8]) -> npt.NDArray[np.float64]:
    """Linear light in [0, 1] of sRGB bytes [..., 3] (IEC 61966-2-1)."""
    encoded = srgb / 255.0
    return np.where(encoded <= 0.04045, encoded / 12.92, ((encoded + 0.055) / 1.055) ** 2.4)
