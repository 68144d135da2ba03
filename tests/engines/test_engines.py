"""Every engine takes the hulls of its preset whole, as convex shapes; bodies of them come to rest and stay stacked."""

from __future__ import annotations

import os
from pathlib import Path
from typing import Any

import pytest

from tests.engines.engines import ENGINES, REAL, TABLE_HEIGHT, Body, ask, lowest, speed, to_fall

pytestmark = pytest.mark.nightly

FALLING = ["table", *list(REAL)[:2]]

AT_REST = 0.05
"""Metres and radians a second, of a body a metre wide: engines stop bodies in their own time."""

MOVED = 0.0007
"""How far faces may move, metres, where an engine does not keep hulls as they are: as far as PhysX joins faces."""

SUNK = 0.02
"""How far a body may sink into another, metres: as far as Jolt lets them; most stay within a millimetre."""


@pytest.fixture(scope="module", params=ENGINES)
def name(request: pytest.FixtureRequest) -> str:
    return str(request.param)


@pytest.fixture(scope="module")
def answers(name: str, tmp_path_factory: pytest.TempPathFactory) -> dict[str, Body]:
    beside = Path(__file__).resolve().parents[3] / "shared" / "meshes"
    meshes = Path(os.environ.get("RLACD_MESHES", beside))
    engine = ENGINES[name]
    engine.command  # noqa: B018 - skips at once what is not installed
    bodies = to_fall(engine, meshes if meshes.is_dir() else None)
    return ask(engine, bodies, tmp_path_factory.mktemp("engine"))[1]


def of(answers: dict[str, Body], body: str) -> Body:
    if body not in answers:
        pytest.skip("no folder of real meshes (set RLACD_MESHES)")
    return answers[body]


@pytest.mark.parametrize("body", ["table", *REAL])
def test_every_hull_is_a_convex_shape_with_all_its_corners_and_its_volume(
    name: str, answers: dict[str, Body], body: str
) -> None:
    found = of(answers, body)
    is_rough = ENGINES[name].is_rough
    assert len(found.hulls) == len(found.given)
    for hull, taken in zip(found.given, found.hulls, strict=True):
        corners, close = len(hull.vertices), MOVED * hull.area if is_rough else 1e-3 * hull.volume
        assert corners * (0.5 if is_rough else 1) <= taken.get("vertices", corners) <= corners
        assert taken.get("volume", hull.volume) == pytest.approx(hull.volume, abs=close)
    if name == "PhysX on a GPU":
        refused = sum(not taken["gpu"] for taken in found.hulls)
        warned = [int(said.split()[0]) for said in found.given.report.warnings if "PhysX on a GPU" in said]
        assert refused <= sum(warned)
    if body == "table" and "mass" in found.hulls[0]:
        assert found.hulls[0]["mass"] == pytest.approx(1000 * found.given.source.volume, rel=1e-6)


@pytest.mark.parametrize("body", FALLING)
def test_what_falls_comes_to_rest_on_the_floor(answers: dict[str, Body], body: str) -> None:
    (end,) = ends_of(of(answers, body))
    assert speed([end]) < AT_REST
    assert lowest(answers[body], end) == pytest.approx(0.0, abs=SUNK)


def test_three_bodies_stay_stacked(answers: dict[str, Body]) -> None:
    ends = ends_of(answers["stack"])
    heights = [end["pose"][2] for end in ends]
    assert heights == pytest.approx([0, TABLE_HEIGHT, 2 * TABLE_HEIGHT], abs=3 * SUNK)
    assert speed(ends) < AT_REST


def ends_of(body: Body) -> list[dict[str, Any]]:
    if not body.falls:
        pytest.skip("this engine does not simulate, or takes minutes for it")
    return body.falls[0]
