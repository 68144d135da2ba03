"""Networks against the exact optimum of their objective, by recursion over all trees of cuts by two planes."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

pytest.importorskip("torch", reason="needs the extra train")

from rlacd.criteria import Concavity
from rlacd.learn.environment import CutEnv
from rlacd.learn.meshes import Solids
from rlacd.learn.options import TrainOptions
from rlacd.learn.train import load_policy, train
from rlacd.planes.candidates import OFFSETS_PER_AXIS
from rlacd.planes.sweep import paper_planes, valid_planes
from rlacd.policies import Policy
from rlacd.solid.component import Component
from tests.shapes import box, trimesh_of


def worth(component: Component, unit: float) -> float:
    """Value of a component where only volume is rewarded, in units of a volume: eq. 7 and 8 as they stand."""
    best = 0.0
    for plane in TWO:
        cutting = CutEnv(component, LIMIT)
        if not cutting.unfinished:
            break
        cut = cutting.step(component, cutting.candidates(component).plane(plane))
        if cut.left.stuck != [component]:
            below = sum(d * worth(c, unit) for c, d in zip(cut.left.unfinished, cut.discounts, strict=True))
            best = max(best, cut.saved * component.hull.volume / unit + below)
    return best


TWO = [axis * OFFSETS_PER_AXIS + OFFSETS_PER_AXIS // 2 for axis in (0, 2)]
"""Those that halve a component along x and z."""

LIMIT = Concavity(0.07)


@pytest.fixture
def two_planes(monkeypatch: pytest.MonkeyPatch) -> None:
    """Leave only two planes to cut a component by."""

    def two(component: Component, candidates: object = None) -> np.ndarray:
        allowed = np.isin(np.arange(150), TWO)
        return allowed & valid_planes(component, paper_planes(component))

    for place in ("learn.environment.valid", "learn.episodes.valid", "policies.network.distinct"):
        monkeypatch.setattr(f"rlacd.{place}_planes", two)


@pytest.fixture
def u_shape(tmp_path: Path, two_planes: None) -> Component:
    """A "u" with arms of different height: 31 components in all."""
    solid = box((0, 0, 0), (3, 1, 0.4)) + box((0, 0, 0), (0.4, 1, 2)) + box((2.6, 0, 0), (3, 1, 1))
    (tmp_path / "meshes").mkdir()
    trimesh_of(solid).export(tmp_path / "meshes" / "u.ply")
    read = Solids(tmp_path / "meshes", tmp_path / "solids").get("u.ply")
    assert read is not None
    return read


@pytest.mark.nightly
@pytest.mark.parametrize(
    "changes",
    [
        {"target": "one-step"},
        {"target": "return", "epsilon": 0.1},
    ],
    ids=["one step", "return"],
)
def test_networks_reach_the_optimum_of_their_objective(u_shape: Component, tmp_path: Path, changes: Any) -> None:
    """The reward for finishing the whole solid is no part of a component's own value: there is none to compare with."""
    steps = {
        "env_steps": 1500,
        "learning_starts": 100,
        "batch_size": 32,
        "buffer_size": 5000,
        "target_frequency": 50,
        "environments": 1,
    }
    given = {"finish_reward": 0.0, "learning_rate": 1e-3, "epsilon": 0.3, "validation": 0, "rotate": False}
    options = TrainOptions(threshold=LIMIT.threshold, **{**given, **steps, **changes})
    train(tmp_path / "meshes", tmp_path / "run", options, say=lambda line: None)
    policy = load_policy(tmp_path / "run")
    unit = CutEnv(u_shape, LIMIT).excess(u_shape) if options.target == "return" else 1
    known = worth(u_shape, u_shape.hull.volume)
    assert (policy._values(u_shape)[TWO] * unit).max() == pytest.approx(known, abs=0.03)
    assert cuts_by(policy, u_shape) in range(3, 11)


def cuts_by(policy: Policy, solid: Component) -> int:
    """Number of cuts that a policy needs, at most 40."""
    cutting, made = CutEnv(solid, LIMIT), 0
    while cutting.unfinished and made < 40:
        component = cutting.unfinished[0]
        plane = policy.choose(component)
        assert plane is not None
        cutting.step(component, plane)
        made += 1
    return made
