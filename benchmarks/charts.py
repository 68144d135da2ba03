"""Plots of a comparison, as SVG: curves of parts against D_h, and the trade between parts and seconds."""

from __future__ import annotations

import io
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Any

from rlacd.errors import MissingExtraError


@dataclass(frozen=True)
class Curve:
    """Points of one method, joined in the order of x.

    Attributes
    ----------
    label : str
    x, y : sequence of float
    """

    label: str
    x: Sequence[float]
    y: Sequence[float]


def curves_chart(
    curves: Iterable[Curve], x: str, y: str, *, log_x: bool = False, log_y: bool = False, markers: bool = True
) -> bytes:
    """Draw curves as SVG, with a marker at every point if requested.

    Raises
    ------
    MissingExtraError
        matplotlib is not installed.
    """
    figure, axes = _figure()
    for number, curve in enumerate(curves):
        points = sorted(zip(curve.x, curve.y, strict=True))
        marker = _MARKERS[number % len(_MARKERS)] if markers else ""
        axes.plot([p[0] for p in points], [p[1] for p in points], marker=marker, label=curve.label)
    axes.set(xlabel=x, ylabel=y, xscale="log" if log_x else "linear", yscale="log" if log_y else "linear")
    _plain_numbers(axes, log_x, log_y)
    axes.legend(fontsize=7, frameon=False)
    return _svg(figure)


def pareto_chart(points: Iterable[tuple[str, float, float]], x: str, y: str) -> bytes:
    """Draw one point per method as SVG, smaller being better on both axes, and join the Pareto front.

    Parameters
    ----------
    points : iterable of (label, x, y)
    x, y : str
        Axis labels; x is logarithmic.

    Raises
    ------
    MissingExtraError
        matplotlib is not installed.
    """
    figure, axes = _figure()
    points = sorted(points, key=lambda p: p[1:])
    front = pareto_front([p[1:] for p in points])
    axes.plot([points[i][1] for i in front], [points[i][2] for i in front], color="0.8", zorder=0)
    for number, (label, a, b) in enumerate(points):
        axes.plot([a], [b], linestyle="", marker=_MARKERS[number % len(_MARKERS)])
        axes.annotate(label, (a, b), textcoords="offset points", xytext=(6, 4), fontsize=7)
    axes.set(xlabel=x, ylabel=y, xscale="log")
    axes.margins(0.15)
    _plain_numbers(axes, True, False)
    return _svg(figure)


def pareto_front(points: Sequence[tuple[float, ...]]) -> list[int]:
    """Indices of the points that no other point dominates, being no larger in every coordinate and smaller in one."""

    def beaten(p: tuple[float, ...]) -> bool:
        return any(q != p and all(a <= b for a, b in zip(q, p, strict=True)) for q in points)

    return [i for i, p in enumerate(points) if not beaten(p)]


_MARKERS = "osD^vPX*<>"


def _figure() -> tuple[Any, Any]:
    try:
        from matplotlib.figure import Figure  # pyplot would look for a window system
    except ModuleNotFoundError as error:
        raise MissingExtraError("charts need an extra: run  pip install 'rlacd[bench]'  and try again.") from error
    figure = Figure(figsize=(6.4, 4.2), layout="constrained")
    axes = figure.add_subplot()
    axes.spines[["top", "right"]].set_visible(False)
    axes.grid(color="0.93")
    axes.set_axisbelow(True)
    return figure, axes


def _plain_numbers(axes: Any, x: bool, y: bool) -> None:
    from matplotlib.ticker import FuncFormatter, LogLocator, NullFormatter

    for wanted, axis in ((x, axes.xaxis), (y, axes.yaxis)):
        if wanted:
            axis.set_major_locator(LogLocator(subs=(1, 2, 5)))
            axis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
            axis.set_minor_formatter(NullFormatter())


def _svg(figure: Any) -> bytes:
    import matplotlib

    drawn = io.BytesIO()
    with matplotlib.rc_context({"svg.hashsalt": "rlacd"}):  # makes the bytes reproducible
        figure.savefig(drawn, format="svg", metadata={"Date": None})
    return drawn.getvalue()
