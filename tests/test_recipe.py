"""A report repeats its run and warns in Python, too; and which threshold leads to how many hulls."""

from __future__ import annotations

import json
import subprocess
import sys
import warnings
from pathlib import Path
from typing import Any

import pytest
import trimesh
from click.testing import CliRunner

import rlacd
from rlacd.cli.main import app
from rlacd.plain_json import to_json


@pytest.mark.parametrize(
    "given",
    [
        {},
        {"threshold_abs": 0.1, "seed": 3, "quality": "fast", "overlap_abs": 0.01},
        {"criterion": "volume", "volume_tolerance": 0.2, "merge": False, "policy": "navacd"},
        {"criterion": rlacd.NavigableSpace(radius_abs=0.2, reachable_only=False), "keep_cavities": True},
        {"preset": "unreal", "max_hulls": 3, "primitives": True},
    ],
)
def test_a_report_is_the_recipe_of_its_run(given: dict[str, Any], tmp_path: Path) -> None:
    pipe = trimesh.creation.annulus(0.8, 1.0, 0.3, sections=16)
    pipe.export(tmp_path / "pipe.obj")
    first = rlacd.decompose(tmp_path / "pipe.obj", threads=1, **given)
    (tmp_path / "report.json").write_text(to_json(first.report))
    options = json.loads(to_json(first.report))["options"]
    again = rlacd.decompose(tmp_path / "pipe.obj", **options)
    assert again.report.options == first.report.options
    assert [h.vertices.tobytes() for h in again] == [h.vertices.tobytes() for h in first]
    first.save(tmp_path / "first.ply")
    words = [str(tmp_path / "pipe.obj"), "-o", str(tmp_path / "again.ply"), "--like", str(tmp_path / "report.json")]
    assert CliRunner().invoke(app, ["decompose", *words]).exit_code == 0
    assert (tmp_path / "again.ply").read_bytes() == (tmp_path / "first.ply").read_bytes()


def test_options_override_those_of_a_report(tmp_path: Path) -> None:
    trimesh.creation.box().export(tmp_path / "box.obj")
    report, words = tmp_path / "report.json", ["decompose", str(tmp_path / "box.obj"), "-o", str(tmp_path / "box.ply")]
    report.write_text(json.dumps({"options": {"threshold_abs": 0.1, "seed": 3}}))
    run = CliRunner().invoke(app, [*words, "--like", str(report), "-t", "0.2", "--report", "-"])
    assert run.exit_code == 0, run.stderr
    options = json.loads(run.stdout)["options"]
    assert (options["threshold"], options.get("threshold_abs"), options["seed"]) == (0.2, None, 3)


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("[]", "is not a JSON report of a decomposition"),
        ("[" * 200_000, "is not a JSON report of a decomposition"),
        ("{}", "is not a JSON report of a decomposition"),
        ('{"options": [[{}, 1]]}', "is not a JSON report of a decomposition"),
        ('{"options": {"threshold": 0.05, "later": 1}}', f"rlacd {rlacd.__version__} does not know: 'later'"),
        ('{"options": [["a", 1], [2, 3]]}', "does not know: 'a'"),
        ('{"options": {"mesh": "a.obj"}}', "does not know: 'mesh'"),
        ('{"version": "99.0.0", "options": {}}', f"by rlacd '99.0.0', but this is {rlacd.__version__}: install that"),
        ('{"version": "two", "options": {}}', "by rlacd 'two'"),
        ('{"version": null, "options": {}}', "by rlacd 'None'"),
        ('{"options": {"threshold": [[[]]]}}', "threshold is [[[]]]; it has to be a number"),
        ('{"options": {"criterion": {"depth": 1}}}', "criterion is {'depth': 1}; it has to be"),
    ],
)
@pytest.mark.parametrize("command", ["decompose", "batch"])
def test_json_of_others_is_told_in_one_sentence(command: str, text: str, says: str, tmp_path: Path) -> None:
    trimesh.creation.box().export(tmp_path / "box.obj")
    (tmp_path / "other.json").write_text(text)
    mesh, out = (tmp_path / "box.obj", "box.ply") if command == "decompose" else (tmp_path, "out")
    words = [command, str(mesh), "-o", str(tmp_path / out), "--like", str(tmp_path / "other.json")]
    run = CliRunner().invoke(app, words)
    assert (run.exit_code, len(run.stderr.splitlines())) == (2, 1), run.stderr
    assert says in run.stderr


def test_what_the_report_warns_of_is_a_python_warning_too(tmp_path: Path) -> None:
    box = trimesh.creation.box()
    with pytest.warns(rlacd.DecompositionWarning, match="mesh: per_node had no effect") as heard:
        found = rlacd.decompose(box, per_node=True)
    assert len(heard) == 1
    assert all(sentence in str(heard[0].message) for sentence in found.report.warnings)
    assert heard[0].filename == __file__
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        rlacd.decompose(box)
    box.export(tmp_path / "box.obj")
    words = [sys.executable, "-m", "rlacd", "decompose", str(tmp_path / "box.obj"), "--per-node"]
    said = subprocess.run(words, capture_output=True, text=True, check=True).stderr
    assert "per_node had no effect" in said
    assert "DecompositionWarning" not in said


def test_hulls_are_exported_by_the_name_that_trimesh_has(tmp_path: Path) -> None:
    found = rlacd.decompose(trimesh.creation.box())
    assert found.export(tmp_path / "a.obj").read_bytes() == found.save(tmp_path / "b.obj").read_bytes()


# --- which threshold --------------------------------------------------------------------------------------------------


def ring() -> trimesh.Trimesh:
    """A pipe of thin wall."""
    return trimesh.creation.annulus(0.8, 1.0, 0.3, sections=32)


@pytest.mark.slow
@pytest.mark.parametrize("given", [{}, {"threshold_abs": 0.05}, {"criterion": "volume", "max_vertices": 16}])
def test_each_choice_is_what_its_threshold_leads_to(given: dict[str, object]) -> None:
    mesh = ring()
    found = rlacd.tradeoff(mesh, threads=1, **given)
    assert 3 <= len(found.rows) <= 10
    for choice in found.rows:
        alone = rlacd.decompose(mesh, quality="fast", threads=1, **{**given, found.option: choice.threshold})
        assert choice.hulls == len(alone)
        assert choice.triangles == alone.report.triangles
        unit = alone.report.scale if found.option == "threshold_abs" else 1.0
        assert choice.added == pytest.approx(alone.report.hausdorff.added / unit, abs=1e-6)
        if found.option != "volume_tolerance":
            assert choice.added <= 1.001 * choice.threshold
    assert found.rows[0].added_volume < found.rows[-1].added_volume


def test_the_finest_with_few_hulls_is_picked_or_the_knee() -> None:
    found = rlacd.tradeoff(ring(), threads=1)
    few = found.rows[-2].hulls
    limited = rlacd.tradeoff(ring(), threads=1, max_hulls=few)
    assert limited.rows == found.rows
    assert limited.pick is not None
    assert found.pick is not None
    assert limited.pick == min(i for i, choice in enumerate(found.rows) if choice.hulls <= few)
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
    assert plain == json.loads(json.dumps(rlacd.tradeoff(mesh, threshold=0.1).as_dict()))


@pytest.mark.parametrize("given", [{"criterion": rlacd.NavigableSpace()}, {"per_node": True}])
def test_what_has_no_single_threshold_is_refused(given: dict[str, object]) -> None:
    with pytest.raises(rlacd.OptionError, match="concavity, distance or volume"):
        rlacd.tradeoff(trimesh.creation.box(), **given)


def test_without_time_there_are_fewer_choices() -> None:
    found = rlacd.tradeoff(ring(), timeout=1e-9)
    assert (found.rows, found.pick, found.complete) == ([], None, False)
