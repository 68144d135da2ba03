"""Random options of a decomposition, as plain keyword arguments of `rlacd.decompose`."""

from __future__ import annotations

from typing import Any

import numpy as np

from rlacd import PRESETS, NavigableSpace
from rlacd.policies import POLICIES


def draw_options(seed: int) -> dict[str, Any]:
    """Draw the options of a seed, including `threads`."""
    random = np.random.default_rng([seed, 2])

    def chance(share: float) -> bool:
        return bool(random.random() < share)

    options: dict[str, Any] = {"threads": int(random.integers(1, 4)), "seed": int(random.integers(0, 100))}
    if chance(0.25):
        options["criterion"] = _space(random, chance)
    else:
        options["threshold"] = float(random.choice([0.02, 0.05, 0.05, 0.1, 0.2, 0.5, 1.5]))
    quality = str(random.choice(["fast", "balanced", "best", "none"], p=[0.45, 0.25, 0.1, 0.2]))
    if quality != "none":
        options["quality"] = quality
    if quality == "best" or (quality == "balanced" and chance(0.3)):
        options["search_steps"] = int(random.choice([0, 1, 7, 40]))
    if quality in ("fast", "none") and chance(0.15):
        options["merge"] = False
    if chance(0.5):
        options["policy"] = str(random.choice(POLICIES))
    if chance(0.2):
        options["max_hulls"] = int(random.choice([1, 2, 3, 8]))
    if chance(0.25):
        options["preset"] = str(random.choice(list(PRESETS)))
    for name in ("max_vertices", "max_faces"):
        if chance(0.15):
            options[name] = int(random.choice([4, 5, 8, 24, 44, 64]))
    if chance(0.2):
        options["resolution"] = int(random.choice([20, 60]))
    if "criterion" in options and options["criterion"].radius < 0.1:
        options["timeout"] = 30.0  # loose sheets and small balls may give tens of thousands of parts
    if chance(0.05):
        options["timeout"] = float(random.choice([1e-6, 0.05, 0.5]))
    if "criterion" not in options and chance(0.1):
        options["keep_cavities"] = True
    if chance(0.15):
        options["keep_open"] = float(random.choice([0.5, 0.8, 0.9, 0.95]))
    return options


def _space(random: np.random.Generator, chance: Any) -> NavigableSpace:
    radius, tolerance = float(random.choice([0.04, 0.1, 0.2, 0.8, 3.0])), float(random.choice([0.01, 0.04, 0.2]))
    planes: tuple[tuple[tuple[float, float, float], float], ...] = ()
    if chance(0.2):
        x, y, z, offset = random.normal(size=4).tolist()
        planes = (((x, y, z), offset),)
    return NavigableSpace(radius, tolerance, reachable_only=not chance(0.3), closed_planes=planes)
