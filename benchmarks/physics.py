"""What decompositions are for: the same objects simulated as hulls of every tool, and as primitives."""

from __future__ import annotations

import math
import statistics
from collections.abc import Callable, Iterator, Sequence
from dataclasses import asdict, dataclass
from typing import Any

import trimesh

from benchmarks.compare import machine
from benchmarks.handle import Handling, handle_in_mujoco
from benchmarks.methods import make_method
from benchmarks.page import Heading, Page, Text
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
    model_size,
    pile_in_bullet,
    pile_in_mujoco,
    scaled_source,
)
from benchmarks.store import BenchTask, load_hulls
from benchmarks.tables import Table
from rlacd.decompose_mesh import decompose
from rlacd.errors import MissingExtraError, OptionError, RlacdError
from rlacd.result import Result

OURS: dict[str, dict[str, Any]] = {
    "one-hull": {"max_hulls": 1, "quality": "fast"},
    "fast:full": {"quality": "fast", "detail": "full"},
    "fast": {"quality": "fast"},
    "balanced": {},
    "fast:64": {"quality": "fast", "max_vertices": 64},
    "fast:32": {"quality": "fast", "max_vertices": 32},
    "fast:16": {"quality": "fast", "max_vertices": 16},
    "fast:overlap": {"quality": "fast", "overlap": 0.02},
    "fast:primitives": {"quality": "fast", "primitives": True},
}
"""The options of each way to use rlacd; a number is the most vertices a hull may have."""

OTHERS = ("coacd", "vhacdx:hulls")
"""Other tools, at their authors' settings."""

WAYS = (*OTHERS, *OURS)


@dataclass(frozen=True)
class Outcome:
    """One object, decomposed in one way.

    Attributes
    ----------
    mesh, way : str
    parts : int
    vertices : float
        Mean per hull.
    size : int
        Bytes of the MJCF file and its collision meshes.
    over : float or None
        How far the hulls reach beyond the input, where the longest side is 2; None for other tools.
    drops : Drops
    handling : Handling
    mujoco, bullet : Pile
        None if PyBullet is not installed.
    """

    mesh: str
    way: str
    parts: int
    vertices: float
    size: int
    over: float | None
    drops: Drops
    handling: Handling
    mujoco: Pile
    bullet: Pile | None


def physics_page(
    bench: Bench, ways: Sequence[str] = WAYS, bullet: bool = True, say: Callable[[str], None] = lambda line: None
) -> Page:
    """Simulate every mesh, decomposed in every way.

    Parameters
    ----------
    bench : Bench
    ways : sequence of str
        Some of `WAYS`.
    bullet : bool
        Also simulate in PyBullet, if it is installed.
    say : callable
        Receives a line per simulation.

    Raises
    ------
    MissingExtraError
        MuJoCo is not installed, or a tool to compare with.
    OptionError
        There is no such way.
    """
    unknown = [way for way in ways if way not in WAYS]
    if unknown or not ways:
        raise OptionError(f"there is no way {unknown[0] if unknown else ''!r}; take some of {', '.join(WAYS)}.")
    outcomes: list[Outcome] = []
    failed: list[str] = []
    for mesh in bench.names:
        for way, result in _decompositions(bench, mesh, ways, failed):
            try:
                drops, handling, mujoco = drops_in_mujoco(result), handle_in_mujoco(result), pile_in_mujoco(result)
                in_bullet = _in_bullet(result) if bullet else None
            except (RlacdError, ValueError) as error:
                if isinstance(error, MissingExtraError):
                    raise
                failed.append(f"- {mesh}, {way}: {' '.join(str(error).split())[:200]}")
                continue
            corners = statistics.fmean(len(hull.vertices) for hull in result.hulls)
            over = result.report["hausdorff"]["over"] if way in OURS else None
            outcomes.append(
                Outcome(mesh, way, len(result), corners, model_size(result), over, drops, handling, mujoco, in_bullet)
            )
            found = asdict(drops) | asdict(handling)
            say(f"{mesh}  {way}: {len(result)} parts, {mujoco.steps_per_second:.0f} steps/s, {found}")
    page = Page(
        "Physics",
        [
            Text(
                f"{len(bench.names)} objects, scaled to {SIZE:g} m, of density 1000, each decomposed in every way; "
                f"{COPIES} copies fall into a bin for {SECONDS:g} s (MuJoCo: steps of {1000 * STEP:g} ms; PyBullet: "
                f"of 1/240 s). {machine()}, one thread; CPU time."
            ),
            *([_summary(outcomes)] if outcomes else []),
            Heading("Object by object"),
            _details(outcomes),
        ],
    )
    if failed:
        page.add(Heading("Failures"), Text("\n".join(failed)))
    return page


def _decompositions(bench: Bench, mesh: str, ways: Sequence[str], failed: list[str]) -> Iterator[tuple[str, Result]]:
    scaled, factor, centre = scaled_source(bench.meshes / mesh)
    mass = decompose(scaled, threads=bench.limits.threads, **OURS["one-hull"]).report["mass"]
    for way in ways:
        if way in OURS:
            yield way, decompose(scaled, threads=bench.limits.threads, **OURS[way])
    for name in [way for way in ways if way in OTHERS]:
        method = make_method(name)
        (row,) = bench.run_tasks([BenchTask(mesh, name, method.default)])
        if "error" in row:
            failed.append(f"- {mesh}, {name}: {row['error']}")
            continue
        hulls, _ = load_hulls(bench.store.hulls_of(BenchTask(mesh, name, method.default)))
        shapes = [trimesh.Trimesh((v - centre) * factor, f, process=False) for v, f in hulls]
        yield name, Result(shapes, {"name": "mesh", "mass": mass}, trimesh.Trimesh(*scaled, process=False))


def _in_bullet(result: Result) -> Pile | None:
    try:
        return pile_in_bullet(result)
    except MissingExtraError:
        return None


def _summary(outcomes: list[Outcome]) -> Table:
    """One line for each way, over the objects that every way solved; rates as geometric means."""
    ways = list(dict.fromkeys(outcome.way for outcome in outcomes))
    by_way = {way: {o.mesh: o for o in outcomes if o.way == way} for way in ways}
    shared = sorted(set.intersection(*({*solved} for solved in by_way.values())))
    lines = []
    for way in ways:
        rows = [by_way[way][mesh] for mesh in shared]
        if not rows:
            continue
        drops, handling = [row.drops for row in rows], [row.handling for row in rows]
        bullet = [row.bullet for row in rows if row.bullet is not None]
        lines.append(
            (
                way,
                f"{statistics.fmean(row.parts for row in rows):.1f}",
                f"{statistics.fmean(row.vertices for row in rows):.0f}",
                f"{statistics.fmean(row.size for row in rows) / 1000:.0f}",
                "–" if rows[0].over is None else f"{statistics.fmean(row.over or 0.0 for row in rows):.3f}",
                _share(sum(d.passed for d in drops), sum(d.holes for d in drops)),
                _share(sum(d.rested for d in drops), sum(d.hollows for d in drops)),
                _share(sum(h.held for h in handling), sum(h.grasps for h in handling)),
                _share(sum(h.hung for h in handling), sum(h.pegs for h in handling)),
                *_cells([row.mujoco for row in rows]),
                *(_cells(bullet) if bullet else ("–",) * 5),
            )
        )
    pile = ("steps/s", "contacts", "depth, %", "drift, W/kg", "rest, s")
    return Table(
        (
            *("", "parts", "vertices a hull", "kB", "over", "holes", "hollows", "grasps", "pegs"),
            *(f"MuJoCo {word}" for word in pile),
            *(f"Bullet {word}" for word in pile),
        ),
        lines,
        f"Means over {len(shared)} objects that every way solved; steps/s is a geometric mean. kB: the MJCF file with "
        "its collision meshes. Over: how far the hulls reach beyond the input (longest side: 2). Holes: of the balls "
        "that pass through by the exact mesh, how many pass. Hollows: of those that come to rest inside the convex "
        f"hull, how many rest within {100 * NEAR:g} % of the longest side of that place; both where a ball wider by as "
        "much does the same. Grasps: of the places where two fingertips meet the exact mesh squarely, how many hold "
        "the object with the fingertips as far apart. Pegs: of the holes that the exact mesh encloses, by how many the "
        "object hangs. Depth: of the deepest contact, in percent of the longest side. Drift: change of energy in "
        "the last half second. Rest: median seconds until nothing moves faster than 0.05 m/s.",
    )


def _cells(piles: list[Pile]) -> tuple[str, ...]:
    rest = statistics.median(pile.rest for pile in piles)
    return (
        f"{statistics.geometric_mean(pile.steps_per_second for pile in piles):.0f}",
        f"{statistics.fmean(pile.contacts for pile in piles):.0f}",
        f"{100 * statistics.fmean(pile.penetration for pile in piles):.2f}",
        f"{statistics.fmean(pile.drift for pile in piles):.4f}",
        f"{rest:.1f}" if math.isfinite(rest) else f"> {SECONDS:g}",
    )


def _details(outcomes: list[Outcome]) -> Table:
    return Table(
        (
            "object, way",
            "parts",
            "vertices a hull",
            "holes",
            "hollows",
            "grasps",
            "pegs",
            "MuJoCo steps/s",
            "Bullet steps/s",
        ),
        [
            (
                f"{o.mesh}, {o.way}",
                o.parts,
                f"{o.vertices:.0f}",
                f"{o.drops.passed} of {o.drops.holes}",
                f"{o.drops.rested} of {o.drops.hollows}",
                f"{o.handling.held} of {o.handling.grasps}",
                f"{o.handling.hung} of {o.handling.pegs}",
                f"{o.mujoco.steps_per_second:.0f}",
                "–" if o.bullet is None else f"{o.bullet.steps_per_second:.0f}",
            )
            for o in outcomes
        ],
    )


def _share(some: int, of: int) -> str:
    return "–" if of == 0 else f"{100 * some / of:.0f} %"
