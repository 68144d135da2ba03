"""Methods side by side on the meshes that all of them managed; the first is what the others are compared with."""

from __future__ import annotations

import math
import os
import platform
import re
import statistics
from collections.abc import Callable, Mapping, Sequence
from functools import lru_cache
from itertools import pairwise
from pathlib import Path

import click

from benchmarks.cli import check_methods, experiment, words
from benchmarks.methods import make_method
from benchmarks.runner import Bench
from benchmarks.store import Row, Task
from benchmarks.tables import Page, Table, failures, managed, mean, ratio_of

METHODS = "coacd,vhacd,fast,default"

REACH = 0.055
"""Hulls that reach farther than this beyond the input are counted: a tenth more than the usual threshold."""

PACKAGES = {"coacd": "coacd", "vhacd": "vhacdx"}
"""Other tools' packages."""

AS_MANY = "vhacd, as many"
"""V-HACD with as many hulls as the first method left of each mesh."""

SIZES = (0, 1_000, 10_000, math.inf)
"""Triangles of the input between which the classes of size lie."""


@experiment(check_methods)
@click.option("--methods", default=METHODS, show_default=True, help="With commas between; the first is the reference.")
@click.option("--threshold", "-t", type=float, help="Of all that have one; default: each tool's own.")
@click.option("--as-many", is_flag=True, help="V-HACD once more, with as many hulls as the first left of each mesh.")
def app(bench: Bench, methods: str, threshold: float | None, as_many: bool) -> Page:
    """Compare methods: number of hulls, how tight they are, broken promises, time.

    The first table is that of README and docs/benchmarks.md. NAME@SETTING sets a method's threshold, or whatever it has
    in its place. Methods are:

    \b
    default                rlacd.decompose(mesh)
    fast, best             with that quality; fast:policy=navacd:max_vertices=32  with other options
    fast:space[=RADIUS]    with navigable space (tolerance 0.1, half of it as radius; longest side 2)
    coacd, vhacd           other tools with their default options
    """
    settings = {}
    for word in words(methods):
        name, _, own = word.partition("@")
        method = make_method(name)
        given = threshold if method.setting == "threshold" else None
        settings[word] = (name, float(own) if own else method.default if given is None else given)
    groups = bench.run_together(settings)
    if as_many:
        first, rows = next(iter(groups.items()))
        tasks = [Task(row["mesh"], "vhacd", row["parts"]) for row in rows if "error" not in row]
        groups = {first: rows, AS_MANY: bench.run_tasks(tasks)} | groups
    blocks = [published(groups), by_size(groups), about(bench, groups), comparison(groups), mesh_by_mesh(groups)]
    return Page("Side by side", [*blocks, failures(row for rows in groups.values() for row in rows)])


def about(bench: Bench, groups: Mapping[str, Sequence[Row]]) -> str:
    """Describe the data and the measurements."""
    rows = [row for some in groups.values() for row in some]
    versions = sorted({f"{PACKAGES.get(r['method'], 'rlacd')} {r['version']}" for r in rows if "version" in r})
    return (
        f"{len(bench.names)} meshes; {', '.join(versions)}; one thread each, {bench.limits.jobs} at a time, at most "
        f"{bench.limits.process.seconds:g} s each, {sum(row['seconds'] for row in rows) / 60:.1f} minutes in all with "
        f"measuring; {machine()}, Python {platform.python_version()}. Lengths where the longest side of the input is "
        "2. Distance is the two-sided Hausdorff distance between the input's surface and that of the hulls' union. "
        "Concavity is decided by bounds on the repaired input inside each hull. Seconds are from arrays in memory to "
        f"hulls in memory.{_walls(rows)}"
    )


def _walls(rows: Sequence[Row]) -> str:
    """What wall times mean, where they were taken: with how many threads, on how busy a machine."""
    loads = [row["load"] for row in rows if row.get("load") is not None]
    if not loads:
        return ""
    return (
        f" Wall seconds were taken on {os.cpu_count()} processors at load averages of {min(loads):.1f} to "
        f"{max(loads):.1f}, median {statistics.median(loads):.1f}."
    )


@lru_cache(maxsize=1)
def machine() -> str:
    """Name of the processor."""
    about = Path("/proc/cpuinfo")
    named = re.search(r"model name\s*: (.+)", about.read_text(encoding="utf-8")) if about.is_file() else None
    return named[1] if named else platform.processor() or platform.machine()


def published(groups: Mapping[str, Sequence[Row]]) -> Table:
    """The table of README, with the best of what is counted in bold."""
    titles, good = _titles(groups), [rows for rows in managed(groups).values() if rows]
    if not good:
        return Table(["no mesh that all managed", *groups], [])
    first = titles[0].partition(" 1.")[0]
    numbers: dict[str, tuple[Callable[[Sequence[Row]], float], str, Callable[[list[float]], float] | None]] = {
        "hulls": (lambda rows: sum(row["parts"] for row in rows), ",.0f", min),
        "triangles per mesh": (lambda rows: mean(rows, "faces"), ",.0f", min),
        "farthest from the input at most: mean, worst mesh": (lambda rows: mean(rows, "hausdorff"), ".3f", min),
        "volume added, median": (lambda rows: statistics.median(row["added"] for row in rows), ".1%", min),
        "input's surface left uncovered": (lambda rows: mean(rows, "uncovered"), ".1%", None),
        "invalid hulls": (lambda rows: sum(row["invalid"] for row in rows), ".0f", None),
        f"times as fast as {first} (CPU, median)": (lambda rows: _times_as_fast(rows, good[0]), ".3g", max),
    }
    lines = []
    for name, (number, form, best) in numbers.items():
        values = [number(rows) for rows in good]
        cells = [f"{value:{form if value < 10 else ',.0f'}}" for value in values]
        if best:
            cells = [f"**{c}**" if v == best(values) else c for c, v in zip(cells, values, strict=True)]
        if "worst" in name:
            cells = [f"{c}, {max(r['hausdorff'] for r in rows):.3f}" for c, rows in zip(cells, good, strict=True)]
        lines.append([name, *cells])
    thresholds = {row["setting"] for rows in good for row in rows if row["exceeding"] is not None}
    told = f", threshold {min(thresholds):g}" if len(thresholds) == 1 else ""
    lines.append(["the threshold", *map(_certainty, good)])
    return Table([f"{len(good[0])} meshes{told}", *titles], lines)


def by_size(groups: Mapping[str, Sequence[Row]]) -> Table:
    """Hulls and speed on the meshes of each class of size."""
    lines = []
    for least, most in pairwise(SIZES):
        some = [[row for row in rows if least <= row["input_faces"] < most] for rows in managed(groups).values()]
        if some and some[0]:
            cells = (f"{sum(row['parts'] for row in rows):,}; {_times_as_fast(rows, some[0]):.3g}" for rows in some)
            lines.append([f"{least:,} to {most:,}" if most < math.inf else f"from {least:,}", len(some[0]), *cells])
    note = "Hulls; times as fast as the first (CPU, median)."
    return Table(["triangles", "meshes", *_titles(groups)], lines, note)


def _titles(groups: Mapping[str, Sequence[Row]]) -> list[str]:
    version = next((row["version"] for row in groups.get("coacd", ()) if "version" in row), "")
    known = {
        "coacd": f"CoACD {version}",
        "vhacd": "V-HACD 4",
        AS_MANY: "V-HACD 4, as many hulls",
        "default": "rlacd (default)",
    }
    return [known.get(label, f"rlacd `{label}`") for label in groups]


def _times_as_fast(rows: Sequence[Row], reference: Sequence[Row]) -> float:
    pairs = zip(reference, rows, strict=True)  # in the order of the meshes, both
    ratios: list[float] = [before["cpu"] / max(row["cpu"], 1e-9) for before, row in pairs]
    return statistics.median(ratios)


def _certainty(rows: Sequence[Row]) -> str:
    """Whether the threshold was kept."""
    if rows[0]["exceeding"] is None:
        return "none to keep"
    over = [f"up to {max(row['concavity'] for row in rows):.2f}"] if any(row["exceeding"] for row in rows) else []
    return "; ".join(["by samples" if rows[0]["method"] == "coacd" else "certified", *over])


def comparison(groups: Mapping[str, Sequence[Row]]) -> Table:
    """A column for each method, over the meshes that all managed; ratios are to the first."""
    good = managed(groups)
    reference = next(iter(good.values()), [])
    failed = ["failed", *(f"{sum('error' in row for row in rows)} of {len(rows)}" for rows in groups.values())]
    if not reference:
        return Table(["no mesh that all managed", *groups], [failed])
    cells = [_column(rows, reference) for rows in good.values()]
    lines = [[name, *(column[name] for column in cells)] for name in cells[0]]
    note = "Ratios are geometric means over the meshes that every method managed, with 95% intervals."
    return Table([f"{len(reference)} meshes", *groups], [*lines, failed], note)


def _column(rows: Sequence[Row], reference: Sequence[Row]) -> dict[str, str]:
    def worst(key: str) -> str:
        return f"{mean(rows, key):.3f}, {max(row[key] for row in rows):.4f}"

    def spread(values: Sequence[float]) -> str:
        return f"{statistics.median(values):.2f}, {statistics.fmean(values):.2f}, {max(values):.4g}, {sum(values):.4g}"

    cpu = [row["cpu"] for row in rows]
    slower = [seconds / max(before["cpu"], 1e-9) for seconds, before in zip(cpu, reference, strict=True)]
    parts = sum(row["parts"] for row in rows)
    exceeding = [row["exceeding"] for row in rows if row["exceeding"] is not None]
    walls = [row["wall_threads"] for row in rows if "wall_threads" in row]
    overlap = statistics.median(row["overlap"] for row in rows)
    return {
        "hulls; a mesh": f"{parts:,}; {parts / len(rows):.1f}",
        "hulls, ratio": ratio_of(rows, reference),
        "triangles per hull": f"{sum(row['faces'] for row in rows) / parts:.0f}",
        f"beyond the input: mean, worst, over {REACH}": f"{worst('over')}, {sum(r['over'] > REACH for r in rows)}",
        "input outside: mean, worst": worst("under"),
        "concavity: mean, worst": worst("concavity"),
        "parts over the threshold": str(sum(exceeding)) if exceeding else "–",
        "volume outside the input, median": f"{statistics.median(row['added'] for row in rows):.1%}",
        "hulls' volume / solid, median": f"{statistics.median(row['volume'] for row in rows):.2f}",
        "volume in several hulls: mean, median": f"{mean(rows, 'overlap'):.1%}, {overlap:.1%}",
        "invalid, empty hulls": f"{sum(row['invalid'] for row in rows)}, {sum(row['empty'] for row in rows)}",
        "CPU s: median, mean, most, sum": spread(cpu),
        "CPU s / the first's: median, most": f"{statistics.median(slower):.3g}, {max(slower):.3g}",
        **({f"wall s, {rows[0]['threads']} threads: median, mean, most, sum": spread(walls)} if walls else {}),
        "peak MB": f"{max(row['peak_mb'] for row in rows):.0f}",
    }


def mesh_by_mesh(groups: Mapping[str, Sequence[Row]]) -> Table:
    """Hulls, distance and CPU seconds of each method on each mesh."""
    found = [{row["mesh"]: _cell(row) for row in rows} for rows in groups.values()]
    lines = [[mesh, *(cells.get(mesh, "–") for cells in found)] for mesh in found[0]]
    return Table(["mesh", *groups], lines, "Hulls / distance / CPU seconds.")


def _cell(row: Row) -> str:
    return "failed" if "error" in row else f"{row['parts']} / {row['hausdorff']:.3f} / {row['cpu']:.2f}"
