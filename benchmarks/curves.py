"""The curves of trainings, drawn side by side as an SVG."""

from __future__ import annotations

import json
from html import escape
from pathlib import Path

import click

from benchmarks.cli import PATH
from rlacd.cli.exit_codes import exit_codes
from rlacd.errors import OptionError
from rlacd.io.write import write_file

PANELS = {
    "parts, in times greedy-150's: own plane, ten best (dashed)": ("validation_own_plane", "validation_ten_best"),
    "Q over a batch: mean, maximum (dashed)": ("q_mean", "q_max"),
    "loss": ("loss",),
    "share of random cuts": ("epsilon",),
    "cuts a second": ("steps_per_s",),
}
"""Title to names in ``curves.jsonl``: the first is drawn solid, the second dashed."""

WIDE, HIGH, LEFT, TOP, GAP = 420, 150, 50, 20, 45
COLOURS = ("#357", "#c22", "#282", "#a60", "#727", "#088")

Curve = list[tuple[float, float]]


def read(run: Path) -> dict[str, Curve]:
    """The curves of a run's folder, or of the file itself, by name: (cuts, value).

    Raises
    ------
    OptionError
        It is not there, or not such a file.
    """
    path = run / "curves.jsonl" if run.is_dir() else run
    curves: dict[str, Curve] = {}
    try:
        for line in path.read_text(encoding="utf-8").splitlines():
            point = json.loads(line)
            for name, value in point.items():
                curves.setdefault(name, []).append((float(point["env_steps"]), float(value)))
    except (OSError, ValueError, TypeError, KeyError, AttributeError) as error:
        raise OptionError(f"{path} holds no curves of `rlacd train` ({error}).") from error
    return curves


def picture(runs: dict[str, dict[str, Curve]]) -> str:
    """Panels below each other, those that no run has values for left out; a colour a run."""
    drawn = {t: keys for t, keys in PANELS.items() if any(key in curves for curves in runs.values() for key in keys)}
    cuts = max((x for curves in runs.values() for curve in curves.values() for x, _ in curve), default=1) or 1
    high, lines = len(drawn) * (HIGH + GAP) + TOP + 18 * len(runs), []
    for number, (title, keys) in enumerate(drawn.items()):
        top = TOP + number * (HIGH + GAP)
        values = [y for curves in runs.values() for key in keys for _, y in curves.get(key, [])]
        low, most = min(0, *values), max(0, *values)
        tall = most - low or 1
        lines.append(f'<text x="{LEFT}" y="{top - 6}">{escape(title)}</text>')
        lines.append(f'<rect x="{LEFT}" y="{top}" width="{WIDE}" height="{HIGH}" stroke="#aaa"/>')
        for value, y in ((most, top + 10), (low, top + HIGH)):
            lines.append(f'<text x="{LEFT - 4}" y="{y}" text-anchor="end">{value:.3g}</text>')
        lines.append(f'<text x="{LEFT + WIDE}" y="{top + HIGH + 14}" text-anchor="end">{cuts:,.0f} cuts</text>')
        for colour, curves in enumerate(runs.values()):
            for key, dashes in zip(keys, ("", ' stroke-dasharray="5 3"'), strict=False):
                points = [(LEFT + WIDE * x / cuts, top + HIGH * (most - y) / tall) for x, y in curves.get(key, [])]
                path = " ".join(f"{x:.1f},{y:.1f}" for x, y in points)
                lines.append(f'<polyline points="{path}" stroke="{COLOURS[colour % len(COLOURS)]}"{dashes}/>')
    for colour, name in enumerate(runs):
        y, stroke = high - 18 * (len(runs) - colour) + 10, COLOURS[colour % len(COLOURS)]
        lines.append(f'<text x="{LEFT}" y="{y}" fill="{stroke}">{escape(name)}</text>')
    size = f'width="{LEFT + WIDE + 20}" height="{high}"'
    head = [
        f'<svg xmlns="http://www.w3.org/2000/svg" {size} font-family="sans-serif" font-size="11">',
        "<style>text:not([fill]) { fill: #123 } polyline, rect { fill: none } .paper { fill: #fff }</style>",
        '<rect class="paper" width="100%" height="100%"/>',
    ]
    return "\n".join([*head, *lines, "</svg>", ""])


@click.command("curves")
@click.argument("runs", type=PATH, nargs=-1, required=True)
@click.option("--out", "-o", required=True, type=PATH, help="The picture, an .svg.")
def app(runs: tuple[Path, ...], out: Path) -> None:
    """Draw the curves of runs of `rlacd train`, their folders or curves.jsonl, in one picture.

    \b
    python -m benchmarks curves RUN OTHER_RUN --out curves.svg
    """
    with exit_codes():
        write_file(out, picture({str(run): read(run) for run in runs}).encode())
