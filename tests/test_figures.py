"""Figures on pages are the program's: its constants, and results that are measured again every night.

``python -m tests.test_figures MESHES`` measures the results again and writes them to docs/results.json.
"""

from __future__ import annotations

import functools
import json
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from benchmarks.runner import find_meshes

import rlacd
from rlacd.options.criterion import with_criterion
from rlacd.planes.sweep import SLIVER
from rlacd.report import Report
from rlacd.solid.component import DENSE
from tests.scripts import script

ROOT = Path(__file__).resolve().parents[1]
HOOKS = script(ROOT / "docs" / "hooks.py")
RESULTS: dict[str, dict[str, Any]] = json.loads(HOOKS.RESULTS.read_text(encoding="utf-8"))
PAGES = {path: path.read_text(encoding="utf-8") for path in (ROOT / "docs").rglob("*.md")}

STATISTICS: dict[str, Callable[[list[Report]], str]] = {
    "hulls": lambda reports: f"{sum(report.hulls for report in reports):,}",
    "hulls a mesh": lambda reports: f"{sum(report.hulls for report in reports) / len(reports):.1f}",
    "primitives": lambda reports: f"{sum(report.hulls - (report.primitives or {})['hull'] for report in reports):,}",
}


def test_every_figure_that_a_page_asks_for_is_known_and_every_result_is_asked_for() -> None:
    asked = {found for text in PAGES.values() for found, _ in HOOKS.FIGURE.findall(text)}
    assert len(asked) > 40
    assert {f"results.{name}" for name in RESULTS} == {one for one in asked if one.startswith("results.")}
    for text in PAGES.values():
        assert "{{" not in HOOKS.with_figures(text)
    text = "{{ results.quick_fast_hulls }} {{ solid.component.DENSE:, }} {{ 10 * planes.sweep.SLIVER:g }}"
    assert HOOKS.with_figures(text) == f"{RESULTS['quick_fast_hulls']['value']} {DENSE:,} {10 * SLIVER:g}"
    with pytest.raises(AttributeError):
        HOOKS.with_figures("{{ solid.component.THICK }}")


@functools.cache
def measured(meshes: Path, group: str, options: str) -> list[Report]:
    """The reports of a group of meshes: a list of the folder, or a folder in it."""
    listed = ROOT / "benchmarks" / "unseen.txt" if group == "unseen" else meshes / f"{group}.txt"
    folder = meshes if listed.is_file() else meshes / group
    names = find_meshes(folder, listed if listed.is_file() else None)
    given = with_criterion(json.loads(options))
    return [rlacd.decompose(folder / name, **given).report for name in names]


def value(meshes: Path, result: dict[str, Any]) -> str:
    """What a result is today."""
    return STATISTICS[result["statistic"]](measured(meshes, result["meshes"], json.dumps(result["options"])))


@pytest.mark.nightly
@pytest.mark.parametrize("name", RESULTS)
def test_results_are_those_of_today(corpus: Path, name: str) -> None:
    assert (corpus / "train").is_dir()  # or not all meshes are there
    assert RESULTS[name]["value"] == value(corpus, RESULTS[name])


if __name__ == "__main__":
    for one in RESULTS.values():
        one["value"] = value(Path(sys.argv[1]), one)
    rows = (f"  {json.dumps(name)}: {json.dumps(result)}" for name, result in RESULTS.items())
    HOOKS.RESULTS.write_text("{\n" + ",\n".join(rows) + "\n}\n", encoding="utf-8")
