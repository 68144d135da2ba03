"""Hulls beside primitives: the same decompositions with and without, piled up in MuJoCo."""

from __future__ import annotations

import math
import statistics
import time
from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

from benchmarks.compare import machine
from benchmarks.page import Heading, Page, Text
from benchmarks.runner import Bench
from benchmarks.simulate import COPIES, SECONDS, SIZE, STEP, model_size, pile_in_mujoco, scaled_source
from benchmarks.tables import Table
from rlacd.decompose_mesh import decompose
from rlacd.decomposition import Decomposition
from rlacd.primitive_kinds import PRIMITIVE_KINDS

NORMAL_95 = 1.96
"""Standard errors on either side of a mean that make a 95 % interval."""


@dataclass(frozen=True)
class Measured:
    """One object, decomposed in one way.

    Attributes
    ----------
    parts : int
    kinds : Counter of str
        How many parts are a primitive, by kind.
    size : int
        Bytes of the MJCF file and its collision meshes.
    over, concavity : float
        How far the hulls reach beyond the input, and the worst concavity, where the longest side is 2.
    volume : float
        Sum of the hulls' volumes.
    cpu : float
        Seconds to decompose.
    rates : list of float
        MuJoCo's steps per CPU second, a pile each.
    contacts : float
        Mean over the piles.
    """

    parts: int
    kinds: Counter[str]
    size: int
    over: float
    concavity: float
    volume: float
    cpu: float
    rates: list[float]
    contacts: float


def primitives_page(
    bench: Bench, piles: int = 1, threshold: float = 0.05, say: Callable[[str], None] = lambda line: None
) -> Page:
    """Decompose every mesh with hulls and with primitives, both `quality="fast"`, and let copies of both fall.

    Parameters
    ----------
    bench : Bench
    piles : int
        Piles of each, all turned differently; the same for hulls and primitives, one after the other.
    threshold : float
    say : callable
        Receives a line per mesh.

    Raises
    ------
    MissingExtraError
        MuJoCo is not installed.
    """
    pairs = []
    for mesh in bench.names:
        source, _, _ = scaled_source(bench.meshes / mesh)
        usual: dict[str, Any] = {"quality": "fast", "threshold": threshold, "threads": bench.limits.threads}
        hulls, others = (_decomposed(source, usual | {"primitives": wanted}) for wanted in (False, True))
        pair = _piled(hulls, others, piles)
        pairs.append(pair)
        faster = math.exp(_log_ratio(pair))
        say(f"{mesh}: {pair[1].parts} parts, {pair[1].kinds.total()} primitives, {faster:.2f} times the steps/s")
    return Page(
        "Primitives",
        [
            Text(
                f"{len(bench.names)} objects of {SIZE:g} m, `quality=fast`, threshold {threshold:g}, as hulls and with "
                f"`primitives=True`; {piles} pile{'s' * (piles > 1)} of {COPIES} copies of each for {SECONDS:g} s in "
                f"MuJoCo (steps of {1000 * STEP:g} ms). {machine()}, one thread; CPU time."
            ),
            _summary(pairs),
            Heading("Object by object"),
            _details(bench.names, pairs),
        ],
    )


_Pair = tuple[Measured, Measured]


def _decomposed(source: Any, options: dict[str, Any]) -> tuple[Decomposition, float]:
    began = time.process_time()
    result = decompose(source, **options)
    return result, time.process_time() - began


def _piled(hulls: tuple[Decomposition, float], others: tuple[Decomposition, float], piles: int) -> _Pair:
    rates: tuple[list[float], list[float]] = ([], [])
    contacts: tuple[list[float], list[float]] = ([], [])
    for seed in range(piles):
        for place, (result, _) in enumerate((hulls, others)):
            pile = pile_in_mujoco(result, seed)
            rates[place].append(pile.steps_per_second)
            contacts[place].append(pile.contacts)
    first, second = (
        _measured(*each, rates[place], statistics.fmean(contacts[place])) for place, each in enumerate((hulls, others))
    )
    return first, second


def _measured(result: Decomposition, cpu: float, rates: list[float], contacts: float) -> Measured:
    kinds = Counter(str(each.kind) for each in result.primitives if each is not None)
    volume = sum(
        hull.volume if each is None else each.volume for hull, each in zip(result, result.primitives, strict=True)
    )
    over, concavity = result.report["hausdorff"]["over"], result.report["concavity"]["max"]
    return Measured(len(result), kinds, model_size(result), over, concavity, volume, cpu, rates, contacts)


def _log_ratio(pair: _Pair) -> float:
    """Of the steps per second: primitives to hulls, over all piles."""
    hulls, others = (statistics.fmean(map(math.log, each.rates)) for each in pair)
    return others - hulls


def _summary(pairs: Sequence[_Pair]) -> Table:
    hulls, others = zip(*pairs, strict=True)
    left, right = _column(hulls), _column(others)
    volume = math.exp(statistics.fmean(math.log(other.volume / hull.volume) for hull, other in pairs))
    logs = [_log_ratio(pair) for pair in pairs]
    mean = statistics.fmean(logs)
    spread = NORMAL_95 * statistics.stdev(logs) / math.sqrt(len(logs)) if len(logs) > 1 else math.nan
    low, middle, high = (f"{math.exp(value):.2f}" for value in (mean - spread, mean, mean + spread))
    return Table(
        ("", "hulls", "with primitives"),
        [
            *((name, value, right[name]) for name, value in left.items()),
            ("volumes, geometric mean", "1", f"{volume:.3f}"),
            ("steps/s, relative (95 % interval)", "1", f"{middle} ({low} to {high})"),
        ],
        "Bytes: MJCF files with their collision meshes. Distances: where the longest side is 2. Steps/s: steps per CPU "
        "second, geometric means.",
    )


def _column(rows: Sequence[Measured]) -> dict[str, str]:
    kinds = sum((row.kinds for row in rows), Counter[str]())
    named = ", ".join(_counted(kinds[kind], kind) for kind in PRIMITIVE_KINDS if kinds[kind])
    return {
        "parts": str(sum(row.parts for row in rows)),
        "of these primitives": f"{kinds.total()} ({named})" if named else "0",
        "bytes": f"{sum(row.size for row in rows):,}",
        "farthest beyond the input, mean": f"{statistics.fmean(row.over for row in rows):.4f}",
        "farthest beyond the input, largest": f"{max(row.over for row in rows):.4f}",
        "worst concavity": f"{max(row.concavity for row in rows):.4f}",
        "CPU s to decompose": f"{sum(row.cpu for row in rows):.1f}",
        "contacts": f"{statistics.fmean(row.contacts for row in rows):.0f}",
        "steps/s": f"{statistics.geometric_mean(rate for row in rows for rate in row.rates):.0f}",
    }


def _counted(count: int, kind: str) -> str:
    return f"{count} {kind}" + ("" if count == 1 else "es" if kind.endswith("x") else "s")


def _details(names: Sequence[str], pairs: Sequence[_Pair]) -> Table:
    return Table(
        ("object", "parts", "primitives", "bytes, hulls", "bytes, primitives", "steps/s, hulls", "steps/s, primitives"),
        [
            (
                name,
                hulls.parts,
                others.kinds.total(),
                hulls.size,
                others.size,
                f"{statistics.geometric_mean(hulls.rates):.0f}",
                f"{statistics.geometric_mean(others.rates):.0f}",
            )
            for name, (hulls, others) in zip(names, pairs, strict=True)
        ],
    )
