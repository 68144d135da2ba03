"""Five robots as USD stages: rewritten, opened by OpenUSD, loaded by Newton with their inertia, dropped to rest.

The stages are made from URDF by a converter, which has an OpenUSD of its own and so an environment of its own.
"""

from __future__ import annotations

import json
import subprocess
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import rlacd
from tests.engines.engines import FOLDER, HERE, PATIENCE, python_with

pytestmark = pytest.mark.nightly

CONVERTER = FOLDER / "usd" / "bin" / "urdf_usd_converter"

ROBOTS = {
    "kuka_iiwa/model.urdf": (),
    "franka_panda/panda.urdf": ("meshes=meshes",),
    "laikago/laikago_toes_zup.urdf": (),
    "mini_cheetah/mini_cheetah.urdf": (),
    "robots/ur_description/urdf/ur5_robot.urdf": ("example-robot-data=../../..",),
}
"""Of PyBullet, and the last of example-robot-data, with their packages."""

AT_REST = 0.05
"""Metres and radians a second."""


def stage_of(robot: str, folder: Path) -> Path:
    data = pytest.importorskip("pybullet_data", reason="the extra sim is not installed")
    (others,) = (FOLDER / "usd").glob("lib/*/site-packages/cmeel.prefix/share/example-robot-data")
    source = next(root / robot for root in (Path(data.getDataPath()), others) if (root / robot).is_file())
    packages = [word for each in ROBOTS[robot] for word in ("--package", each.replace("=", f"={source.parent}/"))]
    subprocess.run([str(CONVERTER), str(source), str(folder), *packages], check=True, capture_output=True)
    (stage,) = folder.glob("*.usda")
    return stage


@pytest.fixture(scope="module")
def stages(tmp_path_factory: pytest.TempPathFactory) -> dict[str, tuple[Path, rlacd.RewrittenRobot]]:
    if not CONVERTER.exists():
        pytest.skip("urdf-usd-converter is not installed (make build/engines)")
    found = {}
    for robot in ROBOTS:
        folder = tmp_path_factory.mktemp(Path(robot).stem)
        stage = stage_of(robot, folder)
        place = folder / f"{stage.stem}_acd.usda"
        done = rlacd.rewrite_robot(stage, place, threads=1, quality="fast", threshold_abs=0.01)
        found[robot] = stage, done
    return found


@pytest.fixture(scope="module")
def answers(
    stages: dict[str, tuple[Path, rlacd.RewrittenRobot]], tmp_path_factory: pytest.TempPathFactory
) -> dict[str, Any]:
    asked, answered = (tmp_path_factory.mktemp("newton") / name for name in ("task.json", "answer.json"))
    asked.write_text(json.dumps([[str(stage), str(done.path)] for stage, done in stages.values()]))
    words = [python_with("newton"), str(HERE / "robots_in_newton.py"), str(asked), str(answered)]
    done = subprocess.run(words, capture_output=True, text=True, timeout=PATIENCE, check=False)
    assert done.returncode == 0, done.stderr[-3000:]
    return dict(zip(stages, json.loads(answered.read_text()), strict=True))


@pytest.mark.parametrize("robot", ROBOTS)
def test_openusd_finds_nothing_that_it_did_not_find_before(
    stages: dict[str, tuple[Path, rlacd.RewrittenRobot]], robot: str
) -> None:
    from tests.io.test_robots_usd import Usd, colliders, findings

    before, done = stages[robot]
    stage = Usd.Stage.Open(str(done.path))
    assert findings(stage) == findings(Usd.Stage.Open(str(before)))
    hulls = [prim for prim in colliders(stage) if prim.GetName().startswith("hull_")]
    assert len(hulls) == sum(len(link.files) for link in done.links) > 0


@pytest.mark.parametrize("robot", ROBOTS)
def test_newton_takes_convex_hulls_the_same_inertia_and_the_robot_rests(answers: dict[str, Any], robot: str) -> None:
    before, after = answers[robot]["before"], answers[robot]["after"]
    assert after["convex"] >= before["convex"] > 0
    assert after["shapes"] - after["convex"] == before["shapes"] - before["convex"]
    assert after["masses"] == pytest.approx(before["masses"], rel=1e-4)
    assert np.array(after["inertia"]) == pytest.approx(np.array(before["inertia"]), rel=1e-4)
    assert after["speed"] < AT_REST
