"""The paper's experiments that train: arms that differ in what they say only, each trained once."""

from __future__ import annotations

from pathlib import Path

import pytest
import trimesh
from benchmarks.tables import Table
from benchmarks.training import ARMS, LARGEST_WEIGHT, _options, train_arms

from rlacd.errors import OptionError
from rlacd.learn.options import PRESETS
from tests.shapes import box, from_manifold

CROSS = box((-1, -0.2, -0.2), (1, 0.2, 0.2)) + box((-0.2, -1, -0.2), (0.2, 1, 0.2))


@pytest.mark.parametrize("experiment", ARMS)
def test_arms_differ_in_what_they_say_only(experiment: str) -> None:
    for preset in ("two-cores", "paper"):
        arms = [_options(preset, 100, 1, changes) for changes in ARMS[experiment].values()]
        assert len(set(arms)) == len(arms)
    assert {(a.iterations, a.seed, a.warmup, a.validate_every) for a in arms} == {(100, 1, 20, 50)}


def test_weights_have_the_ratio() -> None:
    for label, changes in ARMS["rewards"].items():
        if label.startswith("λ1/λ2"):
            options = _options("two-cores", 100, 0, changes)
            ratio = options.volume_reward / options.finish_reward
            assert ratio == pytest.approx(float(label.rpartition("=")[2]))
            assert max(options.volume_reward, options.finish_reward) == LARGEST_WEIGHT


def test_too_short(tmp_path: Path) -> None:
    with pytest.raises(OptionError, match="at least 2"):
        train_arms("curves", tmp_path, tmp_path, "two-cores", 1)


@pytest.mark.nightly
def test_arms_are_trained_once(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    pytest.importorskip("torch")
    folder = tmp_path / "meshes"
    folder.mkdir()
    for number in range(6):
        mesh = from_manifold(CROSS + box((0, 0, 0), (0.3 + 0.1 * number, 0.4, 1)))
        trimesh.Trimesh(mesh.vertices, mesh.faces, process=False).export(folder / f"{number}.stl")
    monkeypatch.setattr("rlacd.learn.options.PRESETS", {"two-cores": {**PRESETS["two-cores"], "validation": 2}})
    said: list[str] = []
    page = train_arms("curves", folder, tmp_path / "run", "two-cores", 40, seeds=2, say=said.append)
    table = next(block for block in page.blocks if isinstance(block, Table))
    assert [line[0] for line in table.lines] == list(ARMS["curves"])
    assert all(float(str(line[1]).partition(" ± ")[0]) > 0 for line in table.lines)
    assert len({(tmp_path / "run" / f"curves-1-seed-{s}" / "curves.jsonl").read_text() for s in (0, 1)}) == 2
    monkeypatch.setattr("rlacd.learn.train.train", None)  # would fail if called
    again = train_arms("curves", folder, tmp_path / "run", "two-cores", 40, seeds=2, say=said.append)
    assert str(again) == str(page)
