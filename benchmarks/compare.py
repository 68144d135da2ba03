"""Methods side by side on the meshes that all of them managed; the first is what the others are compared with."""

from __future__ import annotations

import os
import platform
import statistics
from collections.abc import Mapping, Sequence
from functools import lru_cache
from pathlib import Path
from typing import Annotated

import typer

from benchmarks.cli import check_methods, experiment, words
from benchmarks.methods import make_method
from benchmarks.runner import Bench
from benchmarks.store import Row
from benchmarks.tables import Page, Table, common_meshes, failures, managed, mean, ratio_of

app = typer.Typer(add_completion=False)

METHODS = "coacd,vhacd,fast,default"


@experiment(app, "compare", check_methods)
def compare(
    bench: Bench,
    methods: Annotated[str, typer.Option(help="Separated by commas; the first is the reference.")] = METHODS,
    threshold: Annotated[
        float | None, typer.Option("--threshold", "-t", help="Of all that have one; default: each tool's own.")
    ] = None,
) -> Page:
    """Compare methods: number of hulls, how tight they are, time.

    \b
    default                rlacd.decompose(mesh)
    fast, best             with that quality; fast:policy=navacd:max_vertices=32  with other options
    fast:space[=RADIUS]    with navigable space (tolerance 0.1, half of it as radius; longest side 2)
    coacd, vhacd           other tools with their default options
    disjoint               rlacd's cuts, united only where hulls stay disjoint
    planes[:ap=N][:ce=N][:no-spatial][:no-principal][:excess|:random|:FILE.npz]
                           the paper's deployment
    """
    settings = {}
    for name in words(methods):
        method = make_method(name)
        given = threshold if method.setting == "threshold" else None
        settings[name] = (name, method.default if given is None else given)
    groups = bench.run_together(settings)
    page = Page("Side by side", [about(bench)])
    page.add(comparison(groups), "## Mesh by mesh", mesh_by_mesh(groups))
    page.add("## Failures", failures(row for rows in groups.values() for row in rows))
    return page


def about(bench: Bench) -> str:
    """Describe the data and the measurements."""
    versions = sorted({f"{_package(r['method'])} {r['version']}" for r in bench.store.rows() if "version" in r})
    return (
        f"{len(bench.names)} meshes; {', '.join(versions)}; one thread each, {bench.limits.jobs} at a time, at most "
        f"{bench.limits.seconds:g} s each; {machine()}, Python {platform.python_version()}. Lengths where the longest "
        "side of the input is 2. Distance is the two-sided Hausdorff distance between the input's surface and that of "
        "the hulls' union. Concavity is decided by bounds on the repaired input inside each hull. Seconds are from "
        f"arrays in memory to hulls in memory.{_walls(bench)}"
    )


def _walls(bench: Bench) -> str:
    """What wall times mean, where they were taken: with how many threads, on how busy a machine."""
    loads = [row["load"] for row in bench.store.rows() if row.get("load") is not None]
    if not loads:
        return ""
    return (
        f" Wall seconds were taken on {os.cpu_count()} processors at load averages of {min(loads):.1f} to "
        f"{max(loads):.1f}, median {statistics.median(loads):.1f}."
    )


@lru_cache(maxsize=1)
def machine() -> str:
    """Name of the processor."""
    try:
        for line in Path("/proc/cpuinfo").read_text(encoding="utf-8").splitlines():
            if line.startswith("model name"):
                return line.partition(":")[2].strip()
    except OSError:
        pass
    return platform.processor() or platform.machine()


def _package(method: str) -> str:
    return {"coacd": "coacd", "vhacd": "vhacdx"}.get(method, "rlacd")


def comparison(groups: Mapping[str, Sequence[Row]]) -> Table:
    """A column for each method, over the meshes that all managed; ratios are to the first."""
    good = managed(groups)
    reference = next(iter(good.values()), [])
    failed = [f"{sum('error' in row for row in rows)} of {len(rows)}" for rows in groups.values()]
    if not reference:
        return Table(["no mesh that all managed", *groups], [["failed", *failed]])
    cells = [_column(rows, reference) for rows in good.values()]
    lines = [[name, *(column[name] for column in cells)] for name in cells[0]]
    note = "Ratios are geometric means over the meshes that every method managed, with 95 % intervals."
    return Table([f"{len(reference)} meshes", *groups], [*lines, ["failed", *failed]], note)


def _column(rows: Sequence[Row], reference: Sequence[Row]) -> dict[str, str]:
    def worst(key: str) -> str:
        return f"{mean(rows, key):.3f}, {max(row[key] for row in rows):.3f}"

    is_first = rows is reference
    pairs = zip(reference, rows, strict=True)  # in the order of the meshes, both
    faster = statistics.median(before["cpu"] / max(row["cpu"], 1e-9) for before, row in pairs)
    parts = sum(row["parts"] for row in rows)
    exceeding = [row["exceeding"] for row in rows if row["exceeding"] is not None]
    return {
        "hulls": f"{parts:,}",
        "hulls, ratio": "1" if is_first else ratio_of(rows, reference),
        "triangles per mesh; per hull": f"{mean(rows, 'faces'):,.0f}; {sum(row['faces'] for row in rows) / parts:.0f}",
        "distance: mean, worst": worst("hausdorff"),
        "beyond the input: mean, worst": worst("over"),
        "input outside: mean, worst": worst("under"),
        "input's surface uncovered": f"{100 * mean(rows, 'uncovered'):.1f} %",
        "concavity: mean, worst": worst("concavity"),
        "parts over the threshold": str(sum(exceeding)) if exceeding else "–",
        "hulls' volume / solid, median": f"{statistics.median(row['volume'] for row in rows):.2f}",
        "volume in several hulls": f"{100 * mean(rows, 'overlap'):.1f} %",
        "invalid, empty hulls": f"{sum(row['invalid'] for row in rows)}, {sum(row['empty'] for row in rows)}",
        "CPU s: median, sum": (
            f"{statistics.median(row['cpu'] for row in rows):.2f}, {sum(row['cpu'] for row in rows):.1f}"
        ),
        **_wall(rows),
        "times as fast, median": "1" if is_first else f"{faster:.3g}",
        "peak MB": f"{max(row['peak_mb'] for row in rows):.0f}",
    }


def _wall(rows: Sequence[Row]) -> dict[str, str]:
    """Wall seconds with threads, where they were taken."""
    times = [row["wall_threads"] for row in rows if "wall_threads" in row]
    if len(times) < len(rows):
        return {}
    return {f"wall s, {rows[0]['threads']} threads: median, sum": f"{statistics.median(times):.2f}, {sum(times):.1f}"}


def mesh_by_mesh(groups: Mapping[str, Sequence[Row]]) -> Table:
    """Hulls, distance and CPU seconds of each method on each mesh."""
    by_mesh = {label: {row["mesh"]: row for row in rows} for label, rows in groups.items()}
    lines = [
        [row["mesh"], *(_cell(rows.get(row["mesh"])) for rows in by_mesh.values())]
        for row in next(iter(groups.values()))
    ]
    return Table(["mesh", *groups], lines, "Hulls / distance / CPU seconds.")


def _cell(row: Row | None) -> str:
    if row is None or "error" in row:
        return "failed"
    return f"{row['parts']} / {row['hausdorff']:.3f} / {row['cpu']:.2f}"


def mean_of_shared(groups: Sequence[Sequence[Row]], key: str) -> list[float]:
    """Mean of a column for each group, over the meshes that all managed."""
    shared = common_meshes(groups)
    return [mean((row for row in rows if row["mesh"] in shared), key) for rows in groups]
