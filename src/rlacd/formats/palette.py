"""Colours that tell neighbouring hulls apart, without end and always in the same order."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

# Successive multiples of the golden angle never come close to each other, so any run of hulls has well-spread hues;
# three lightnesses keep hues that do return (the 8th, the 13th, ...) apart as well.
GOLDEN_ANGLE = np.pi * (3.0 - np.sqrt(5.0))
FIRST_HUE = np.deg2rad(250.0)
LIGHTNESS = np.array([0.70, 0.80, 0.62])
CHROMA = 0.125


def hull_colors(count: int) -> npt.NDArray[np.uint8]:
    """Give `count` distinct colours as sRGB, uint8 [count, 3].

    They lie on circles of equal chroma in Oklab (Ottosson 2020, https://bottosson.github.io/posts/oklab/), so that no
    hull looks more important than another. The first colours do not depend on `count`.
    """
    index = np.arange(count)
    hue = FIRST_HUE + index * GOLDEN_ANGLE
    oklab = np.stack([LIGHTNESS[index % 3], CHROMA * np.cos(hue), CHROMA * np.sin(hue)], axis=1)
    return srgb_from_linear(linear_from_oklab(oklab))


def srgb_from_linear(linear: npt.NDArray[np.float64]) -> npt.NDArray[np.uint8]:
    """sRGB bytes of linear light [..., 3] in [0, 1] (IEC 61966-2-1)."""
    encoded = np.where(linear <= 0.0031308, 12.92 * linear, 1.055 * linear ** (1.0 / 2.4) - 0.055)
    return np.rint(255.0 * encoded).astype(np.uint8)


def linear_from_srgb(srgb: npt.NDArray[np.uint8]) -> npt.NDArray[np.float64]:
    """Linear light in [0, 1] of sRGB bytes [..., 3] (IEC 61966-2-1)."""
    encoded = srgb / 255.0
    return np.where(encoded <= 0.04045, encoded / 12.92, ((encoded + 0.055) / 1.055) ** 2.4)


def linear_from_oklab(oklab: npt.NDArray[np.float64]) -> npt.NDArray[np.float64]:
    """Linear sRGB [N, 3], clipped to [0, 1], of Oklab colours [N, 3]."""
    to_cone_root = np.array(
        [
            [1.0, 0.3963377774, 0.2158037573],
            [1.0, -0.1055613458, -0.0638541728],
            [1.0, -0.0894841775, -1.2914855480],
        ]
    )
    to_rgb = np.array(
        [
            [4.0767416621, -3.3077115913, 0.2309699292],
            [-1.2684380046, 2.6097574011, -0.3413193965],
            [-0.0041960863, -0.7034186147, 1.7076147010],
        ]
    )
    linear: npt.NDArray[np.float64] = np.clip((oklab @ to_cone_root.T) ** 3 @ to_rgb.T, 0.0, 1.0)
    return linear
