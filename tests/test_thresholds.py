"""Which threshold: each choice is the decomposition that its threshold leads to, and one of them is picked."""

from __future__ import annotations

import json
from pathlib import Path

import pytest
import trimesh
from click.testing import CliRunner

import rlacd
from rlacd.cli.main import app


def ring() -> trimesh.Trimesh:
    """A pipe of thin wall."""
    return trimesh.creation.annulus(0.8, 1.0, 0.3, sections=32)


@pytest.mark.slow
@pytest.mark.parametrize("given", [{}, {"threshold_abs": 0.05}, {"criterion": "volume", "max_vertices": 16}])
def test_each_choice_is_what_its_threshold_leads_to(given: dict[str, object]) -> None:
    mesh = ring()
    found = rlacd.tradeoff(mesh, threads=1, **given)
    assert 3 <= len(found.choices) <= 10
    for choice in found.choices:
        alone = rlacd.decompose(mesh, quality="fast", threads=1, **{**given, found.option: choice.threshold})
        assert choice.hulls == len(alone)
        assert choice.triangles == alone.report.faces
        unit = alone.report.scale if found.option == "threshold_abs" else 1.0
        assert choice.farthest == pytest.approx(alone.report.hausdorff.over / unit, abs=1e-6)
        if found.option != "volume_tolerance":
            assert choice.farthest <= 1.001 * choice.threshold
    assert found.choices[0].added < found.choices[-1].added


def test_the_finest_with_few_hulls_is_picked_or_the_knee() -> None:
    found = rlacd.tradeoff(ring(), threads=1)
    few = found.choices[-2].hulls
    limited = rlacd.tradeoff(ring(), threads=1, max_hulls=few)
    assert limited.choices == found.choices
    assert limited.pick is not None
    assert found.pick is not None
    assert limited.pick == min(i for i, choice in enumerate(found.choices) if choice.hulls <= few)
    assert str(found).splitlines()[1 + found.pick].startswith("*")


def test_the_command_prints_a_table_or_json_and_draws_the_curve(tmp_path: Path) -> None:
    pytest.importorskip("PIL")
    mesh, picture = tmp_path / "ring.obj", tmp_path / "ring.png"
    ring().export(mesh)
    table = CliRunner().invoke(app, ["tradeoff", str(mesh), "-t", "0.1", "--picture", str(picture)])
    assert table.exit_code == 0, table.stderr
    assert table.stdout == f"{rlacd.tradeoff(mesh, threshold=0.1)}\n"
    assert picture.read_bytes().startswith(b"\x89PNG")
    plain = json.loads(CliRunner().invoke(app, ["tradeoff", str(mesh), "-t", "0.1", "--json"]).stdout)
    assert plain == json.loads(json.dumps(rlacd.tradeoff(mesh, threshold=0.1).as_plain()))


@pytest.mark.parametrize("given", [{"criterion": rlacd.NavigableSpace()}, {"per_node": True}])
def test_what_has_no_single_threshold_is_refused(given: dict[str, object]) -> None:
    with pytest.raises(rlacd.OptionError, match="concavity, distance or volume"):
        rlacd.tradeoff(trimesh.creation.box(), **given)


def test_without_time_there_are_fewer_choices() -> None:
    found = rlacd.tradeoff(ring(), timeout=1e-9)
    assert (found.choices, found.pick, found.complete) == ([], None, False)
