"""What decompositions are for: the same objects simulated as hulls of every tool, and as primitives."""

from __future__ import annotations

import math
import statistics
from collections.abc import Iterator, Sequence
from dataclasses import asdict, dataclass
from typing import Annotated, Any

import trimesh
import typer

from benchmarks.cli import experiment, words
from benchmarks.compare import machine
from benchmarks.handle import Handling, handle_in_mujoco
from benchmarks.methods import make_method, rlacd_options
from benchmarks.runner import Bench
from benchmarks.simulate import (
    COPIES,
    NEAR,
    SECONDS,
    SIZE,
    STEP,
    Drops,
    Pile,
    drops_in_mujoco,
    get_bullet,
    get_mujoco,
    model_size,
    pile_in_bullet,
    pile_in_mujoco,
    scaled_source,
)
from benchmarks.store import Task, load_hulls
from benchmarks.tables import Page, Ratio, Table
from rlacd.decompose_mesh import decompose
from rlacd.errors import RlacdError
from rlacd.result import Result

app = typer.Typer(add_completion=False)

OTHERS = ("coacd", "vhacd")
"""Other tools, at their authors' settings."""

ONE_HULL = "fast:max_hulls=1"

METHODS = (
    f"coacd,vhacd,{ONE_HULL},default,fast,fast:detail=full,fast:max_vertices=64,fast:max_vertices=32,"
    "fast:max_vertices=16,fast:primitives=true,fast:overlap=0.01"
)


@dataclass(frozen=True)
class Outcome:
    """One object, decomposed in one way.

    Attributes
    ----------
    mesh, way : str
    parts, primitives : int
        Hulls, and how many of them stand for a primitive.
    vertices : float
        Mean per hull.
    size : int
        Bytes of the MJCF file and its collision meshes.
    over : float or None
        How far the hulls reach beyond the input, where the longest side is 2; None for other tools.
    drops : Drops
    handling : Handling
    mujoco : list of Pile
    bullet : Pile or None
    """

    mesh: str
    way: str
    parts: int
    primitives: int
    vertices: float
    size: int
    over: float | None
    drops: Drops
    handling: Handling
    mujoco: list[Pile]
    bullet: Pile | None

    @property
    def rate(self) -> float:
        """MuJoCo's steps per CPU second, over the piles."""
        return statistics.geometric_mean(pile.steps_per_second for pile in self.mujoco)


def _check(methods: str, bullet: bool, **_: object) -> None:
    get_mujoco()
    if bullet:
        get_bullet()
    for name in words(methods):
        make_method(name) if name in OTHERS else rlacd_options(name)


@experiment(app, "physics", _check)
def physics(
    bench: Bench,
    methods: Annotated[str, typer.Option(help="coacd, vhacd, and rlacd as for compare.")] = METHODS,
    piles: Annotated[int, typer.Option(min=1, help="Piles of each object in MuJoCo, turned differently.")] = 1,
    bullet: Annotated[bool, typer.Option("--bullet/--no-bullet", help="Also simulate in PyBullet.")] = True,
) -> Page:
    """Simulate the hulls: a pile, balls dropped into every hole, grasps and pegs; needs rlacd\\[sim].

    \b
    python -m benchmarks physics MESHES --list MESHES/quick.txt --out RUN
    """
    outcomes: list[Outcome] = []
    failed: list[str] = []
    for mesh in bench.names:
        for way, result in _decompositions(bench, mesh, words(methods), failed):
            try:
                outcomes.append(_simulated(mesh, way, result, piles, bullet))
            except (RlacdError, ValueError) as error:
                failed.append(f"- {mesh}, {way}: {' '.join(str(error).split())[:200]}")
                continue
            found = asdict(outcomes[-1].drops) | asdict(outcomes[-1].handling)
            bench.say(f"{mesh}  {way}: {len(result)} parts, {outcomes[-1].rate:.0f} steps/s, {found}")
    about = (
        f"{len(bench.names)} objects, scaled to {SIZE:g} m, of density 1000, each decomposed in every way; {COPIES} "
        f"copies fall into a bin for {SECONDS:g} s (MuJoCo: {piles} piles, steps of {1000 * STEP:g} ms; PyBullet: of "
        f"1/240 s). {machine()}, one thread; CPU time."
    )
    page = Page("Physics", [about])
    if outcomes:
        page.add(_summary(outcomes), "## Object by object", _details(outcomes))
    page.add("## Failures", "\n".join(failed) or "none")
    return page


def _decompositions(bench: Bench, mesh: str, ways: Sequence[str], failed: list[str]) -> Iterator[tuple[str, Result]]:
    scaled, factor, centre = scaled_source(bench.meshes / mesh)
    mass = decompose(scaled, threads=1, **rlacd_options(ONE_HULL)).report["mass"]
    for way in ways:
        if way not in OTHERS:
            yield way, decompose(scaled, threads=1, **rlacd_options(way))
            continue
        task = Task(mesh, way, make_method(way).default)
        (row,) = bench.run_tasks([task])
        if "error" in row:
            failed.append(f"- {mesh}, {way}: {row['error']}")
            continue
        hulls, _ = load_hulls(bench.store.hulls_of(task))
        shapes = [trimesh.Trimesh((v - centre) * factor, f, process=False) for v, f in hulls]
        yield way, Result(shapes, {"name": "mesh", "mass": mass}, trimesh.Trimesh(*scaled, process=False))


def _simulated(mesh: str, way: str, result: Result, piles: int, bullet: bool) -> Outcome:
    return Outcome(
        mesh,
        way,
        len(result),
        sum(each is not None for each in getattr(result, "primitives", [])),
        statistics.fmean(len(hull.vertices) for hull in result.hulls),
        model_size(result),
        None if way in OTHERS else result.report["hausdorff"]["over"],
        drops_in_mujoco(result),
        handle_in_mujoco(result),
        [pile_in_mujoco(result, seed) for seed in range(piles)],
        pile_in_bullet(result) if bullet else None,
    )


PILE = ("steps/s", "contacts", "depth, %", "drift, W/kg", "rest, s")

NOTE = (
    "Means over {} objects that every way solved; steps/s is a geometric mean, its ratio is to the first way. kB: the "
    "MJCF file with its collision meshes. Over: how far the hulls reach beyond the input (longest side: 2). Holes: of "
    "the balls that pass through by the exact mesh, how many pass. Hollows: of those that come to rest inside the "
    "convex hull, how many rest within {:g} % of the longest side of that place; both where a ball wider by as much "
    "does the same. Grasps: of the places where two fingertips meet the exact mesh squarely, how many hold the object "
    "with the fingertips as far apart. Pegs: of the holes that the exact mesh encloses, by how many the object hangs. "
    "Depth: of the deepest contact, in percent of the longest side. Drift: change of energy in the last half second. "
    "Rest: median seconds until nothing moves faster than 0.05 m/s."
)


def _summary(outcomes: list[Outcome]) -> Table:
    """One column for each way, over the objects that every way solved."""
    ways = list(dict.fromkeys(outcome.way for outcome in outcomes))
    by_way = {way: {o.mesh: o for o in outcomes if o.way == way} for way in ways}
    shared = sorted(set.intersection(*({*solved} for solved in by_way.values())))
    columns = [
        _column([by_way[way][mesh] for mesh in shared], [by_way[ways[0]][mesh] for mesh in shared]) for way in ways
    ]
    lines = [[name, *(column[name] for column in columns)] for name in columns[0]]
    return Table(["", *ways], lines, NOTE.format(len(shared), 100 * NEAR))


def _column(rows: list[Outcome], first: list[Outcome]) -> dict[str, Any]:
    if not rows:
        return {"parts": "–"}
    drops, handling = [row.drops for row in rows], [row.handling for row in rows]
    bullet = [row.bullet for row in rows if row.bullet is not None]
    mujoco = [pile for row in rows for pile in row.mujoco]
    over = [row.over for row in rows if row.over is not None]
    return {
        "parts": f"{statistics.fmean(row.parts for row in rows):.1f}",
        "of these primitives": f"{statistics.fmean(row.primitives for row in rows):.1f}",
        "vertices a hull": f"{statistics.fmean(row.vertices for row in rows):.0f}",
        "kB": f"{statistics.fmean(row.size for row in rows) / 1000:.0f}",
        "over: mean, worst": f"{statistics.fmean(over):.3f}, {max(over):.3f}" if over else "–",
        "holes": _share(sum(d.passed for d in drops), sum(d.holes for d in drops)),
        "hollows": _share(sum(d.rested for d in drops), sum(d.hollows for d in drops)),
        "grasps": _share(sum(h.held for h in handling), sum(h.grasps for h in handling)),
        "pegs": _share(sum(h.hung for h in handling), sum(h.pegs for h in handling)),
        "MuJoCo steps/s, ratio": str(Ratio.of([row.rate for row in rows], [row.rate for row in first])),
        **{f"MuJoCo {name}": cell for name, cell in zip(PILE, _cells(mujoco), strict=True)},
        **{f"Bullet {name}": cell for name, cell in zip(PILE, _cells(bullet) if bullet else ["–"] * 5, strict=True)},
    }


def _cells(piles: list[Pile]) -> list[str]:
    rest = statistics.median(pile.rest for pile in piles)
    return [
        f"{statistics.geometric_mean(pile.steps_per_second for pile in piles):.0f}",
        f"{statistics.fmean(pile.contacts for pile in piles):.0f}",
        f"{100 * statistics.fmean(pile.penetration for pile in piles):.2f}",
        f"{statistics.fmean(pile.drift for pile in piles):.4f}",
        f"{rest:.1f}" if math.isfinite(rest) else f"> {SECONDS:g}",
    ]


def _details(outcomes: list[Outcome]) -> Table:
    header = ["object, way", "parts", "primitives", "kB", "holes", "hollows", "grasps", "pegs", "MuJoCo steps/s"]
    lines = []
    for o in outcomes:
        d, h = o.drops, o.handling
        counts = [(d.passed, d.holes), (d.rested, d.hollows), (h.held, h.grasps), (h.hung, h.pegs)]
        of = [f"{some} of {all_}" for some, all_ in counts]
        lines.append([f"{o.mesh}, {o.way}", o.parts, o.primitives, f"{o.size / 1000:.1f}", *of, f"{o.rate:.0f}"])
    return Table(header, lines)


def _share(some: int, of: int) -> str:
    return "–" if of == 0 else f"{100 * some / of:.0f} %"
