"""The colours of hulls: told apart by everybody, also by people who see two primary colours only."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial.distance import pdist

from rlacd.io.write.palette import hull_colors, linear_from_srgb, srgb_from_linear

# What is seen, in linear RGB: Machado, Oliveira & Fernandes 2009, severity 1.
SIGHT = {
    "normal": np.eye(3),
    "protanopia": np.array(
        [[0.152286, 1.052583, -0.204868], [0.114503, 0.786281, 0.099216], [-0.003882, -0.048116, 1.051998]]
    ),
    "deuteranopia": np.array(
        [[0.367322, 0.860646, -0.227968], [0.280085, 0.672501, 0.047413], [-0.011820, 0.042940, 0.968881]]
    ),
    "tritanopia": np.array(
        [[1.255528, -0.076749, -0.178779], [-0.078411, 0.930809, 0.147602], [0.004733, 0.691367, 0.303900]]
    ),
}
_CONE_FROM_RGB = np.array(
    [
        [0.4122214708, 0.5363325363, 0.0514459929],
        [0.2119034982, 0.6806995451, 0.1073969566],
        [0.0883024619, 0.2817188376, 0.6299787005],
    ]
)
_OKLAB_FROM_CONE_ROOT = np.array(
    [
        [0.2104542553, 0.7936177850, -0.0040720468],
        [1.9779984951, -2.4285922050, 0.4505937099],
        [0.0259040371, 0.7827717662, -0.8086757660],
    ]
)
JUST_SEEN = 0.02  # a difference in Oklab


def as_seen(colors: np.ndarray, sight: str) -> np.ndarray:
    """In Oklab, where distances are those that are seen."""
    linear = np.clip(linear_from_srgb(colors) @ SIGHT[sight].T, 0.0, 1.0)
    return np.asarray(np.cbrt(linear @ _CONE_FROM_RGB.T) @ _OKLAB_FROM_CONE_ROOT.T)


@pytest.mark.parametrize("sight", SIGHT)
def test_the_first_colours_and_those_that_follow_each_other_are_told_apart_by_everybody(sight: str) -> None:
    seen = as_seen(hull_colors(500), sight)
    for count, times in ((4, 6.0), (8, 4.0), (12, 3.0)):
        assert pdist(seen[:count]).min() > times * JUST_SEEN
    for step, times in ((1, 3.0), (2, 3.0), (3, 2.0)):
        assert np.linalg.norm(seen[step:] - seen[:-step], axis=1).min() > times * JUST_SEEN


def test_two_hundred_colours_differ_and_do_not_depend_on_the_count() -> None:
    colors = hull_colors(200)
    assert len(np.unique(colors, axis=0)) == 200
    assert np.array_equal(srgb_from_linear(linear_from_srgb(colors)), colors)
    for count in (0, 1, 12, 13, 100):
        assert np.array_equal(hull_colors(count), colors[:count])


def test_every_colour_stands_out_from_white_paper_and_dark_ink() -> None:
    lightness = as_seen(hull_colors(400), "normal")[:, 0]
    assert lightness.min() > 0.45
    assert lightness.max() < 0.93
