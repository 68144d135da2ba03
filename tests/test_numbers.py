"""Numbers of README and docs are the program's: limits are its constants, results are those of a run today.

Tables of options, presets, exit codes, reports, the gallery and the guides' scripts have tests of their own
(test_examples.py, test_promises.py). Times and figures of other tools stand beside the command that measures them.
"""

from __future__ import annotations

import functools
import json
import re
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from benchmarks.runner import find_meshes

import rlacd
from rlacd.batch import assets
from rlacd.cut import MANY_COMPONENTS
from rlacd.cut_and_merge import MOST_CUTTING, MOST_MERGING, MOST_PER_FACE
from rlacd.finish import narrowed, primitives, report
from rlacd.io.read import apart, contents, open_file, xml
from rlacd.io.robots import spans
from rlacd.io.write.model import MASSES, SIZES
from rlacd.merge import grow
from rlacd.options import Options
from rlacd.planes.candidates import EDGES_PER_COMPONENT
from rlacd.planes.sweep import SLIVER
from rlacd.pool import ProcessLimits
from rlacd.pool.on_ray import MACHINES
from rlacd.repair import distance, holes, state, wraps
from rlacd.report import Report
from rlacd.search.levels import LEAST_WORK, MOST_WORK, PATIENCE, TIMES_FIRST_PASS
from rlacd.solid.component import DENSE
from rlacd.solid.frame import HALF_THICKNESS
from rlacd.solid.passages import FACES
from rlacd.viewer import server

ROOT = Path(__file__).resolve().parents[1]
GB = 2**30
WORDS = {2: "two", 3: "three", 4: "four", 5: "five"}
ORDINALS = {3: "third", 4: "quarter"}
HALVES = {0.5: "half"}
TIMES = {1.0: "the work of another first pass", 2.0: "twice the work of the first pass"}


def page(name: str) -> str:
    """A page on one line, without emphasis."""
    text = (ROOT / name).read_text(encoding="utf-8").replace("**", "")
    return re.sub(r"\s+", " ", text)


LIMITS = {
    "docs/reliability.md": [
        f"no file over {open_file.LARGEST_FILE // GB} GB",
        f"within {apart.LIMITS.memory // GB} GB and {apart.LIMITS.seconds / 60:g} minutes",
        f"at most {contents.MOST_TRIANGLES / 1e6:g} million triangles, {contents.MOST_PLACES:,} instances, "
        f"{contents.DEEPEST_PART} levels",
        f"{xml.MOST_MEMBERS:,} members",
        f"at most {HALVES[spans.MOST_ELEMENTS / 1e6]} a million elements",
    ],
    "docs/search.md": [
        f"may do {TIMES_FIRST_PASS:g} times the work of the first pass, at least {LEAST_WORK / 1e6:g} and at most "
        f"{MOST_WORK / 1e6:g} million units",
        f"saved nothing in {TIMES[PATIENCE]}",
        f"at {MOST_CUTTING / 1e6:g} million units and {MOST_PER_FACE} per triangle",
        f"merging at {MOST_MERGING / 1e6:g} million",
        f"more than {MANY_COMPONENTS:,} pieces",
        f"at most {DENSE:,} triangles",
        f"if in {100 * grow.CROSSING:g}% of the hulls",
        f"fills {100 * (grow.SHARED - 1):.0f}% more",
    ],
    "docs/repair.md": [
        f"within {state._WELDS[0] * 1e5:g}·10⁻⁵ (else {state._WELDS[1] * 1e4:g}·10⁻⁴)",
        f"{2 * HALF_THICKNESS * 1e3:g}·10⁻³ thick",
        f"over {wraps._CROWD} slabs, or over {wraps._CROSSINGS:,} pairs",
        f"radius is {50 * Options.gap:g}% of the longest side",
        f"({100 * holes.HOLE_SHARE:g}% of its area, up to {holes.HOLE:g} away)",
        f"may have {100 * holes._END:g}% of its area",
        f"in more than {100 * distance.TANGLED:g}% of the surface",
    ],
    "docs/batch.md": [
        f"`--memory` ({ProcessLimits().memory // GB} GB)",
        f"`--limit` ({ProcessLimits().seconds:g} s)",
        f"up to {WORDS[MACHINES]} times",
        f"(`{assets.RESERVED[0]}`)",
    ],
    "docs/viewer.md": [
        f"up to {server.LARGEST_MESH >> 20} MiB",
        f"localhost:{server.USUAL_PORT}",
    ],
    "src/rlacd/report.py": [
        f"narrower than {50 * 2 * narrowed.NARROWEST:g}% of the longest side",
        f"Over {FACES:,} triangles or {narrowed.MOST_BALLS} places",
        f"most doubtful first, at most {report.MOST_HOLES:,}.",
    ],
    "docs/policies.md": [
        f"those of {WORDS[EDGES_PER_COMPONENT]} reflex edges",
        f"more than {MANY_COMPONENTS:,} pieces",
    ],
    "docs/training.md": [f"a side thinner than {100 * SLIVER:g}%"],
    "docs/guides/scans.md": [
        f"more than {DENSE:,} triangles",
        f"more than {report.COVERAGE_TOLERANCE:g} outside",
    ],
    "docs/guides/robots.md": [
        f"smaller than {1e3 * SIZES[0]:g} mm or larger than {SIZES[1]:g} m",
        f"lighter than {1e6 * MASSES[0]:g} mg or heavier than {1e-3 * MASSES[1]:,g} t",
    ],
    "docs/guides/primitives.md": [
        f"within a {ORDINALS[1 / (primitives.SIMPLER - 1)]} of the least",
    ],
}


@pytest.mark.parametrize("name", LIMITS)
def test_limits_of_a_page_are_those_of_the_program(name: str) -> None:
    assert [told for told in LIMITS[name] if told not in page(name)] == []


@functools.cache
def measured(corpus: Path, group: str, options: str) -> list[Report]:
    """The reports of a group of meshes: a list of the corpus, or a folder."""
    assert (corpus / "train").is_dir()  # or not all meshes are there
    listed = ROOT / "benchmarks" / "unseen.txt" if group == "unseen" else Path(corpus, f"{group}.txt")
    folder = corpus if listed.is_file() else corpus / group
    names = find_meshes(folder, listed if listed.is_file() else None)
    given = json.loads(options)
    if space := given.pop("space", None):
        given["criterion"] = rlacd.NavigableSpace(*space)
    return [rlacd.decompose(folder / name, **given).report for name in names]


STATISTICS: dict[str, Callable[[list[dict[str, Any]]], str]] = {
    "hulls": lambda reports: f"{sum(report.hulls for report in reports):,}",
    "hulls a mesh": lambda reports: f"{sum(report.hulls for report in reports) / len(reports):.1f}",
    "triangles a mesh": lambda reports: f"{sum(report.triangles for report in reports) / len(reports):,.0f}",
    "primitives": lambda reports: f"{sum(report.hulls - report.primitives['hull'] for report in reports):,}",
}

FAST, DEFAULT = '{"quality": "fast"}', "{}"
RESULTS: list[tuple[str, str, str, str, str]] = [
    ("docs/benchmarks.md", r"of all 60, `fast` makes ([\d,]+) hulls", "unseen", FAST, "hulls"),
    ("docs/benchmarks.md", r"hulls and the default ([\d,]+)\.", "unseen", DEFAULT, "hulls"),
    ("docs/benchmarks.md", r"were tuned: .*?`fast` ([\d,]+), the default", "quick", FAST, "hulls"),
    ("docs/benchmarks.md", r"were tuned: .*? the default ([\d,]+) ", "quick", DEFAULT, "hulls"),
    ("docs/benchmarks.md", r"\| `fast` \| ([\d,]+) \| 1 \|", "test", FAST, "hulls"),
    ("docs/benchmarks.md", r"\| `test/` \| 181 of 181 \| 0 \| 0 \| ([\d,]+) \|", "test", FAST, "hulls"),
    ("docs/benchmarks.md", r"\| `balanced` \(default\) \| ([\d,]+) \|", "test", DEFAULT, "hulls"),
    ("docs/benchmarks.md", r"several hulls.*?\| `fast` \| ([\d.]+) \|", "vhacd_set", FAST, "hulls a mesh"),
    ("docs/benchmarks.md", r"\| rlacd \(default\) \| ([\d.]+) \|", "vhacd_set", DEFAULT, "hulls a mesh"),
    ("docs/benchmarks.md", r"threshold 0.043 \| ([\d.]+) \|", "vhacd_set", '{"threshold": 0.043}', "hulls a mesh"),
    (
        "docs/benchmarks.md",
        r"`fast` makes\s([\d,]+) hulls of the 25 meshes, NavACD",
        "quick",
        '{"quality": "fast", "space": [0.05, 0.01]}',
        "hulls",
    ),
    ("docs/physics.md", r"(\d+), 0 \| \d+, \d+ \|", "quick", FAST, "hulls"),
    ("docs/physics.md", r", 0 \| \d+, (\d+) \|", "quick", '{"quality": "fast", "primitives": true}', "primitives"),
    (
        "docs/guides/primitives.md",
        r"(\d+) of \d+ parts",
        "quick",
        '{"quality": "fast", "primitives": true}',
        "primitives",
    ),
]


@pytest.mark.nightly
@pytest.mark.parametrize(("name", "pattern", "group", "options", "statistic"), RESULTS)
def test_results_of_a_page_are_those_of_today(
    corpus: Path, name: str, pattern: str, group: str, options: str, statistic: str
) -> None:
    assert re.findall(pattern, page(name))[:1] == [STATISTICS[statistic](measured(corpus, group, options))]


def test_results_of_pages_are_where_the_nightly_test_looks() -> None:
    for name, pattern, *_ in RESULTS:
        assert re.search(pattern, page(name)), f"{name} lacks {pattern}"
