"""What decompositions are for: the same objects simulated as hulls of every tool, and as primitives."""

from __future__ import annotations

import statistics
import time
from collections.abc import Iterator, Sequence
from dataclasses import asdict

import click
import trimesh

from benchmarks.cli import experiment, words
from benchmarks.compare import machine
from benchmarks.methods import make_method, rlacd_options
from benchmarks.runner import Bench
from benchmarks.simulate import (
    COPIES,
    NEAR,
    SECONDS,
    SIZE,
    STEP,
    drops_in_mujoco,
    get_mujoco,
    get_warp,
    model_size,
    pile_in_mujoco,
    pile_in_warp,
    scaled_source,
)
from benchmarks.store import Row, Task, load_hulls
from benchmarks.tables import Page, Table, managed, mean, ratio_of
from rlacd.decompose_mesh import decompose
from rlacd.errors import RlacdError
from rlacd.result import Result

OTHERS = ("coacd", "vhacd")
"""Other tools, at their authors' settings."""

ONE_HULL = "fast:max_hulls=1"

METHODS = f"{ONE_HULL},fast,default,fast:max_vertices=16,fast:primitives=true,coacd,vhacd"


def _check(methods: str, worlds: int | None, **_: object) -> None:
    get_mujoco()
    if worlds:
        get_warp()
    for name in words(methods):
        make_method(name) if name in OTHERS else rlacd_options(name)


@experiment(_check)
@click.option("--methods", default=METHODS, show_default=True, help="coacd, vhacd, and rlacd as for compare.")
@click.option("--piles", default=1, type=click.IntRange(1), help="Piles of each object, turned differently.")
@click.option("--worlds", type=click.IntRange(1), help="The pile in so many worlds at once too, in MuJoCo Warp.")
def app(bench: Bench, methods: str, piles: int, worlds: int | None) -> Page:
    """Simulate the hulls in MuJoCo: a pile, and balls dropped into every hole; needs rlacd[sim].

    \b
    python -m benchmarks piles MESHES --list MESHES/quick.txt --out RUN
    """
    groups: dict[str, list[Row]] = {way: [] for way in words(methods)}
    for mesh in bench.names:
        for way, result, cpu in _decompositions(bench, mesh, list(groups)):
            row: Row = {"mesh": mesh}
            try:
                row |= {"error": result} if isinstance(result, str) else _simulated(result, piles, worlds)
                row["cpu"] = cpu
            except (RlacdError, ValueError, RuntimeError) as error:
                row["error"] = " ".join(str(error).split())[:200]
            groups[way].append(row)
            bench.say(f"{way}: {row}")
    about = (
        f"{len(bench.names)} objects, scaled to {SIZE:g} m, of density 1000, each decomposed in every way; {COPIES} "
        f"copies fall into a bin for {SECONDS:g} s ({piles} piles, steps of {1000 * STEP:g} ms). {machine()}, one "
        "thread; CPU time."
    )
    failed = [f"- {r['mesh']}, {way}: {r['error']}" for way, rows in groups.items() for r in rows if "error" in r]
    return Page("Piles", [about, _summary(groups), _details(groups), "## Failures", "\n".join(failed) or "none"])


def _decompositions(bench: Bench, mesh: str, ways: Sequence[str]) -> Iterator[tuple[str, Result | str, float]]:
    """Hulls, or why there are none, and the CPU seconds that they took."""
    scaled, factor, centre = scaled_source(bench.meshes / mesh)
    mass = decompose(scaled, threads=1, **rlacd_options(ONE_HULL)).report.mass
    for way in ways:
        if way not in OTHERS:
            began = time.process_time()
            yield way, decompose(scaled, threads=1, **rlacd_options(way)), time.process_time() - began
            continue
        task = Task(mesh, way, make_method(way).default)
        (row,) = bench.run_tasks([task])
        if "error" in row:
            yield way, row["error"], 0.0
            continue
        hulls, _ = load_hulls(bench.hulls_of(task))
        shapes = [trimesh.Trimesh((v - centre) * factor, f, process=False) for v, f in hulls]
        source = trimesh.Trimesh(*scaled, process=False)
        yield way, Result.of(shapes, source, mass=mass), row["cpu"]


def _simulated(result: Result, piles: int, worlds: int | None) -> Row:
    rates, contacts = zip(*(pile_in_mujoco(result, seed) for seed in range(piles)), strict=True)
    return {
        "parts": len(result),
        "primitives": sum(each is not None for each in getattr(result, "primitives", [])),
        "vertices": statistics.fmean(len(hull.vertices) for hull in result.hulls),
        "bytes": model_size(result),
        "over": result.report.hausdorff.added,  # unknown for other tools
        "volume": float(sum(hull.volume for hull in result.hulls)),
        **asdict(drops_in_mujoco(result)),
        "rate": statistics.geometric_mean(rates),
        "contacts": statistics.fmean(contacts),
        **({"warp": pile_in_warp(result, worlds)} if worlds else {}),
    }


NOTE = (
    "Over objects that every way solved; ratios are to the first way. Bytes: the MJCF file with its collision "
    "meshes. Over: how far the hulls reach beyond the input (longest side: 2). Holes: of the balls that pass through "
    "by the exact mesh, how many pass. Hollows: of those that come to rest inside the convex hull, how many rest "
    f"within {100 * NEAR:g}% of the longest side of that place; both where a ball wider by as much does the same."
)


def _summary(groups: dict[str, list[Row]]) -> Table:
    """One column for each way, over the objects that every way solved."""
    good = managed(groups)
    first = next(iter(good.values()))
    if not first:
        return Table(["", *groups], [])
    columns = [_column(rows, first) for rows in good.values()]
    lines = [[name, *(column[name] for column in columns)] for name in columns[0]]
    return Table([f"{len(first)} objects", *groups], lines, NOTE)


def _column(rows: list[Row], first: list[Row]) -> dict[str, str]:
    over = [row["over"] for row in rows if row["over"] is not None]

    def total(key: str) -> int:
        return sum(row[key] for row in rows)

    return {
        "parts; a mesh": f"{total('parts')}; {mean(rows, 'parts'):.1f}",
        "of these primitives": f"{total('primitives')}",
        "vertices a hull": f"{mean(rows, 'vertices'):.0f}",
        "bytes; a mesh": f"{total('bytes'):,}; {mean(rows, 'bytes'):,.0f}",
        "over: mean, worst": f"{statistics.fmean(over):.4f}, {max(over):.4f}" if over else "–",
        "volume, ratio": ratio_of(rows, first, "volume"),
        "CPU s to decompose": f"{sum(row['cpu'] for row in rows):.1f}",
        "holes": f"{total('passed')} of {total('holes')}",
        "hollows": f"{total('rested')} of {total('hollows')}",
        "steps/s": f"{statistics.geometric_mean(row['rate'] for row in rows):.0f}",
        "steps/s, ratio": ratio_of(rows, first, "rate"),
        "contacts": f"{mean(rows, 'contacts'):.0f}",
        **(_in_warp(rows, first) if "warp" in rows[0] else {}),
    }


def _in_warp(rows: list[Row], first: list[Row]) -> dict[str, str]:
    return {
        "MuJoCo Warp, steps/s": f"{statistics.geometric_mean(row['warp'] for row in rows):,.0f}",
        "MuJoCo Warp, ratio": ratio_of(rows, first, "warp"),
    }


def _details(groups: dict[str, list[Row]]) -> Table:
    lines = [
        [f"{r['mesh']}, {way}", r["parts"], f"{r['passed']} of {r['holes']}", f"{r['rested']} of {r['hollows']}"]
        for way, rows in groups.items()
        for r in rows
        if "error" not in r
    ]
    return Table(["object, way", "parts", "holes", "hollows"], lines)
