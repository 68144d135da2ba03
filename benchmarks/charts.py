"""Curves, as SVG."""

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
    axes.legend(fontsize=7, frameon=False)
    return _svg(figure)


_MARKERS = "osD^vPX*<>"


def need_charts(**_: object) -> None:
    """Raise `MissingExtraError` if matplotlib is not installed: asked before any work."""
    try:
        import matplotlib  # noqa: F401
    except ModuleNotFoundError as error:
        raise MissingExtraError("charts need matplotlib: run  pip install matplotlib  and try again.") from error


def _figure() -> tuple[Any, Any]:
    from matplotlib.figure import Figure  # pyplot would look for a window system

    figure = Figure(figsize=(6.4, 4.2), layout="constrained")
    axes = figure.add_subplot()
    axes.spines[["top", "right"]].set_visible(False)
    axes.grid(color="0.93")
    axes.set_axisbelow(True)
    return figure, axes


def _svg(figure: Any) -> bytes:
    import matplotlib

    drawn = io.BytesIO()
    with matplotlib.rc_context({"svg.hashsalt": "rlacd"}):  # makes the bytes reproducible
        figure.savefig(drawn, format="svg", metadata={"Date": None})
    return drawn.getvalue()
