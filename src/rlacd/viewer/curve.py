"""The curve of hulls against thresholds, as a PNG file."""

from __future__ import annotations

import io
import math
import os
from collections.abc import Sequence
from pathlib import Path

from rlacd.errors import import_extra
from rlacd.io.write import write_file
from rlacd.viewer.picture import FADED, INK, PAPER, _write, check_picture

WIDTH, HEIGHT, LEFT, RIGHT, TOP, BOTTOM = 1200, 720, 110, 60, 110, 100
LINE, PICKED, GRID = (38, 104, 178), (214, 84, 30), (228, 230, 234)


def draw_curve(
    path: str | os.PathLike[str], name: str, option: str, points: Sequence[tuple[float, int]], pick: int | None
) -> Path:
    """Draw hulls (from zero) against thresholds (by their logarithm); the point to pick is marked.

    Raises
    ------
    MissingExtraError, OutputError, OptionError
        See `rlacd.viewer.picture.check_picture`.
    """
    place = check_picture(path)
    image, pen = (import_extra(f"PIL.{part}", "a picture", "view") for part in ("Image", "ImageDraw"))
    most, logs = max(hulls for _, hulls in points), [math.log(threshold) for threshold, _ in points]
    span, step = logs[-1] - logs[0] or 1.0, _step(most)
    top = step * math.ceil(most / step)

    def at(threshold: float, hulls: float) -> tuple[int, int]:
        x = LEFT + (math.log(threshold) - logs[0]) / span * (WIDTH - LEFT - RIGHT)
        return round(x), round(HEIGHT - BOTTOM - hulls / top * (HEIGHT - TOP - BOTTOM))

    sheet = image.new("RGB", (WIDTH, HEIGHT), PAPER)
    draw = pen.Draw(sheet)
    for hulls in range(0, top + 1, step):
        _, y = at(points[0][0], hulls)
        draw.line([(LEFT, y), (WIDTH - RIGHT, y)], fill=GRID, width=2)
        _write(sheet, str(hulls), (LEFT - 16, y), 22, FADED, anchor="rm")
    draw.line([at(*point) for point in points], fill=LINE, width=5)
    for number, (threshold, hulls) in enumerate(points):
        (x, y), size, ink = at(threshold, hulls), *((13, PICKED) if number == pick else (8, LINE))
        draw.ellipse([x - size, y - size, x + size, y + size], fill=ink)
        _write(sheet, str(hulls), (x + 4, y - 28), 24, ink, anchor="lm")
        _write(sheet, f"{threshold:.3g}", (x, HEIGHT - BOTTOM + 26), 22, FADED, anchor="mm")
    _write(sheet, f"{name}: hulls by {option}", (LEFT, 48), 34, INK, anchor="lm")
    if pick is not None:
        threshold, hulls = points[pick]
        _write(sheet, f"marked: {threshold:.3g}, {hulls} hulls", (WIDTH - RIGHT, 48), 26, PICKED, anchor="rm")
    _write(sheet, option, ((LEFT + WIDTH - RIGHT) // 2, HEIGHT - 30), 24, FADED, anchor="mm")
    encoded = io.BytesIO()
    sheet.save(encoded, format="PNG")
    write_file(place, encoded.getvalue())
    return place


def _step(most: int) -> int:
    """Spacing of at most six lines of the grid: 1, 2 or 5 times a power of ten."""
    power = 1
    while True:
        for step in (power, 2 * power, 5 * power):
            if most <= 6 * step:
                return step
        power *= 10
