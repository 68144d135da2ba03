"""The unit of lengths: all that a run tells are in one, the one that was typed, else the input's."""

from __future__ import annotations

import json
import re
from pathlib import Path

import pytest
import trimesh
from click.testing import CliRunner
from trimesh import creation

from rlacd.cli.main import app
from rlacd.options.names import UNITS
from tests.moving import fork_and_lug

PLACE = re.compile(r"\([-\d.e+]+, [-\d.e+]+, [-\d.e+]+\)")
LENGTH = re.compile(r"([\d.]+(?:e[-+]?\d+)?) (units|mm|cm|in|m)(³?)(?![\w³])")
OTHERS = re.compile(r"\d+\.\d+(?:e[-+]?\d+)? (?:%|s\b|hulls a link)|threshold_abs = \d.*|_joint = -?[\d.]+(?=,)")
BARE = re.compile(r"\d*\.\d+(?:e[-+]?\d+)?(?=[\s,;:)]|\.\s|\.$)")


def placed(mesh: trimesh.Trimesh, *where: float) -> trimesh.Trimesh:
    mesh.apply_translation(where)
    return mesh


def troubles() -> trimesh.Scene:
    """A ring, a ball, a box with a cavity, a cup, and a speck, 1.8 long together: much to warn of."""
    inner = creation.box((0.3, 0.3, 0.3))
    inner.invert()
    cup = creation.cylinder(0.2, 0.3, sections=32)
    cup.update_faces(cup.triangles_center[:, 2] < 0.149)
    return trimesh.Scene(
        {
            "ring": creation.annulus(0.02, 0.3, 0.1, sections=24),
            "ball": placed(creation.icosphere(3, 0.2), 1.3, 0, 0),
            "hollow": placed(trimesh.util.concatenate([creation.box((0.4, 0.4, 0.4)), inner]), 0, 1, 0),
            "cup": placed(cup, 1, 1, 0),
            "speck": trimesh.Trimesh([[1.4, 0.5, 0.5]] * 3, [[0, 1, 2]], process=False),
        }
    )


def rod(*where: float) -> trimesh.Trimesh:
    return placed(creation.cylinder(0.01, 2.0), *where)


def told(words: str) -> tuple[str, set[str], list[float]]:
    """What a run says, without its lengths; their units; and the lengths, in metres where the unit is known."""
    run = CliRunner().invoke(app, words.split())
    assert "warning: " in run.stderr, run.stderr
    return lengths_in(run.stderr)


def lengths_in(said: str) -> tuple[str, set[str], list[float]]:
    found = LENGTH.findall(said)
    plain = LENGTH.sub("LENGTH", OTHERS.sub("", PLACE.sub("", said)))
    assert not BARE.findall(plain), "a length without a unit"
    metres = [float(number) * UNITS.get(unit, 1.0) ** (3 if power else 1) for number, unit, power in found]
    return plain, {unit for _, unit, _ in found}, metres


WAYS = {"50mm": "mm", "5cm": "cm", "0.05m": "m", f"{0.05 / 0.0254}in": "in"}
"""A length of 0.05 m, and the unit that it is typed in."""


@pytest.mark.parametrize(
    ("given", "least"),
    [
        ("--threshold LENGTH --max-vertices 8 --max-hulls 6 --overlap 2%", 12),
        ("--threshold LENGTH --avoid rod.stl --keep-open 0.9 --max-hulls 4 --openings solid", 9),
        ("--threshold LENGTH --max-hulls 1 --per-node", 9),
        ("--criterion navigable --radius LENGTH --max-hulls 2 --max-vertices 6", 8),
        ("--keep-open LENGTH --max-hulls 4", 7),
    ],
)
def test_a_run_tells_all_lengths_in_one_unit(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, given: str, least: int
) -> None:
    """The same run in another unit says the same, with the same lengths; places stay those of the file."""
    monkeypatch.chdir(tmp_path)
    troubles().export("all.glb")
    troubles().to_mesh().export("all.stl")
    rod(0.1, 0.1, 0).export("rod.stl")
    common = f"-o out.glb --quality fast --threads 1 {given}"
    ways = dict([*WAYS.items()] if "--per-node" in given else [*WAYS.items()][::3])  # all where a run is short
    runs = [told("decompose all.glb " + common.replace("LENGTH", typed)) for typed in ways]
    assert [units for _, units, _ in runs] == [{unit} for unit in ways.values()]
    assert len(runs[0][2]) >= least
    for plain, _, lengths in runs:
        assert plain == runs[0][0]
        assert lengths == pytest.approx(runs[0][2], rel=1e-3)
    share = "60%" if "--keep-open LENGTH" in given else "2.5%"
    assert told("decompose all.glb " + common.replace("LENGTH", share))[1] == {"m"}
    if "--per-node" not in given:
        assert told("decompose all.stl " + common.replace("LENGTH", share))[1] == {"units"}


def test_a_comparison_of_thresholds_is_in_their_unit(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    creation.annulus(0.02, 0.3, 0.1, sections=24).export("ring.stl")
    for typed, units in (("1cm --unit m", {"cm"}), ("10mm --unit m", {"mm"}), ("0.02", set()), ("5%", set())):
        table = CliRunner().invoke(app, f"tradeoff ring.stl --threads 1 -t {typed}".split()).stdout
        assert len(table.splitlines()) > 3
        assert {unit for _, unit, _ in LENGTH.findall(table)} == units


@pytest.mark.parametrize("typed", [pytest.param("5mm", marks=pytest.mark.nightly), "2%"])
def test_a_robot_tells_all_lengths_in_one_unit(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, typed: str) -> None:
    monkeypatch.chdir(tmp_path)
    robot = fork_and_lug(play=1e-3).write(tmp_path).name
    found = re.fullmatch(r"[\d.]+(m|cm|mm)", typed)
    unit = found[1] if found else "m"
    limits = "--max-vertices 6 --max-hulls 3 --overlap 2%"
    run = f"decompose {robot} -o out.urdf --threshold {typed} {limits} --quality fast --threads 1 --samples 3"
    _, units, lengths = told(run)
    assert units == {unit}
    assert len(lengths) >= 6


def test_a_batch_tells_all_lengths_in_one_unit(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    Path("assets").mkdir()
    for ending in ("stl", "glb"):
        troubles().to_mesh().export(f"assets/all_{ending}.{ending}")
    common = "batch assets -o out --max-vertices 8 --max-hulls 6 --quality fast --jobs 1"
    for given, units in (
        ("-t 50mm --unit m", {"mm"}),
        ("-t 0.05", {"m", "units"}),
    ):
        _, found, _ = told(f"{common} {given}")
        assert found == units
        for line in Path("out/manifest.jsonl").read_text(encoding="utf-8").splitlines():
            row = json.loads(line)
            own = units if len(units) == 1 else {"m" if row["mesh"].endswith("glb") else "units"}
            _, found, lengths = lengths_in("\n".join([row["missed"], *row["warnings"]]))
            assert row["status"] == "uncovered"
            assert found == own
            assert len(lengths) >= 5
