"""One PNG that shows the quality of a decomposition: the input, its hulls, and the exploded hulls."""

from __future__ import annotations

import io
import os
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from rlacd._native import points_within
from rlacd.errors import import_extra
from rlacd.io.write import write_file
from rlacd.io.write.palette import linear_from_srgb
from rlacd.io.write.target import checked_place
from rlacd.options.fields import checked, integer, read
from rlacd.options.output import OutputOptions
from rlacd.result import Result
from rlacd.solid.balls import Balls
from rlacd.viewer.coloring import color_hulls
from rlacd.viewer.render import Body, Spheres, render_apart
from rlacd.viewer.robot import RobotResult

INPUT_COLOR = np.array([0.46, 0.47, 0.50])  # linear reflectance
BALL_COLOR = np.array([0.10, 0.30, 0.75])
PAPER, INK, FADED = (255, 255, 255), (28, 30, 34), (120, 124, 132)
BALLS_AT_ONCE = 256
"""Balls compared pair by pair when balls are chosen; the others are compared with all chosen ones at once."""

TO_Z_UP = {  # rows: the source of the drawing's x, y, z axes
    "x": np.array([[0.0, 1.0, 0.0], [0.0, 0.0, 1.0], [1.0, 0.0, 0.0]]),
    "y": np.array([[1.0, 0.0, 0.0], [0.0, 0.0, -1.0], [0.0, 1.0, 0.0]]),  # +z, the front of glTF, faces the camera
    "z": np.eye(3),
}


def check_picture(path: str | os.PathLike[str], up: str | None = None) -> Path:
    """Check, before any work, that `draw_picture` will be able to write to `path`.

    Raises
    ------
    OptionError
        The name does not end in ``.png``, or `up` is not an axis.
    OutputError
        The place is not writable.
    MissingExtraError
        The extra ``view`` is not installed.
    """
    check_up(up)
    place = checked_place(path, "the picture", [".png"])
    for module in ("mitsuba", "PIL"):
        import_extra(module, "a picture", "view")
    return place


def check_up(up: str | None) -> None:
    """Raise `OptionError` if `up` is not an axis; None means no choice and is accepted."""
    checked(OutputOptions, "up", up)


def draw_picture(
    decomposition: Result,
    path: str | os.PathLike[str],
    *,
    width: int = 1600,
    samples: int = 16,
    up: str | None = None,
) -> Path:
    """Draw the input, its hulls and the exploded hulls; `rlacd.Decomposition.save_picture` says what is given.

    Parameters
    ----------
    samples : int
        Light paths per pixel: more are slower and less grainy.
    """
    place = check_picture(path, up=up)
    write_file(place, picture_bytes(decomposition, width=width, samples=samples, up=up))
    return place


def picture_bytes(
    decomposition: Result,
    *,
    width: int = 1600,
    samples: int = 16,
    up: str | None = None,
    clear: bool = False,
) -> bytes:
    """Draw the picture as the bytes of a PNG file; see `draw_picture`.

    With `clear` it has a transparent background and no header, so that it fits any page.
    """
    width = read(integer(300, 8000, rule="a number of pixels between 300 and 8000"), "width", width)
    samples = read(integer(1, 10_000), "samples", samples)

    image = import_extra("PIL.Image", "a picture", "view")
    import_extra("mitsuba", "a picture", "view")  # before a process is started that needs it
    up = decomposition.up_axis(up)
    panels: list[tuple[str, list[Body], Spheres | None]] = [
        ("input", [_body(decomposition.source.triangles, INPUT_COLOR, up)], None),
        ("hulls", _hull_bodies(decomposition, up, pull=0.0), None),
        ("pulled apart", _hull_bodies(decomposition, up, pull=0.55), None),
    ]
    if decomposition.balls is not None:
        some = disjoint(decomposition.balls)
        spheres = Spheres(some.centres @ TO_Z_UP[up].T, some.radii, BALL_COLOR)
        panels.insert(2, ("some of the balls they leave free", _hull_bodies(decomposition, up, pull=0.0), spheres))
    columns, rows = (3, 1) if len(panels) == 3 else (2, 2)
    panel_width, unit = width // columns, width / 1600
    panel_height = round(panel_width * (0.92 if rows == 1 else 0.62))
    header, footer = 0 if clear else round(104 * unit), round(44 * unit)
    size = width, header + rows * (panel_height + footer)
    sheet = image.new("RGBA", size, (*PAPER, 0 if clear else 255))
    drawn = render_apart([(bodies, veil) for _, bodies, veil in panels], panel_width, panel_height, samples)
    for number, ((title, _, _), pixels) in enumerate(zip(panels, drawn, strict=True)):
        left = number % columns * panel_width
        top = header + number // columns * (panel_height + footer)
        sheet.alpha_composite(image.fromarray(pixels), (left, top))
        middle = (left + panel_width // 2, top + panel_height + footer // 2)
        _write(sheet, title, middle, round(20 * unit), FADED, anchor="mm")
    if not clear:
        margin = round(32 * unit)
        _write(sheet, decomposition.name, (margin, round(40 * unit)), round(34 * unit), INK, anchor="lm")
        facts = "   ·   ".join(decomposition.facts())
        _write(sheet, facts, (margin, round(79 * unit)), round(21 * unit), FADED, anchor="lm")

    encoded = io.BytesIO()
    (sheet if clear else sheet.convert("RGB")).save(encoded, format="PNG")
    return encoded.getvalue()


def disjoint(balls: Balls) -> Balls:
    """Choose balls that do not overlap, smallest first; all of them together would look like one cloud."""
    left, shown = np.argsort(balls.radii, kind="stable"), list[int]()
    while len(left):
        some, left = left[:BALLS_AT_ONCE], left[BALLS_AT_ONCE:]
        chosen = list[int]()
        for i in some:
            away = np.linalg.norm(balls.centres[chosen] - balls.centres[i], axis=1)
            if (away >= balls.radii[chosen] + balls.radii[i]).all():
                chosen.append(int(i))
        reach = balls.radii[chosen] + balls.radii.max()
        counts, near = points_within(balls.centres[left], balls.centres[chosen], reach)
        by, other = np.repeat(chosen, counts), left[near]
        away = np.linalg.norm(balls.centres[by] - balls.centres[other], axis=1)
        left = np.delete(left, near[away < balls.radii[by] + balls.radii[other]])
        shown += chosen
    return balls.some(np.array(shown))


def _hull_bodies(decomposition: Result, up: str, *, pull: float) -> list[Body]:
    """The hulls, and a robot's primitives, each further from the centre by the share `pull`."""
    kept = [one for own in decomposition.kept for one in own] if isinstance(decomposition, RobotResult) else []
    drawn = [*decomposition, *kept]
    corners = np.concatenate([each.bounds for each in drawn])
    middle = (corners.min(axis=0) + corners.max(axis=0)) / 2.0
    colors = [*linear_from_srgb(color_hulls(decomposition.hulls)[0]), *len(kept) * [INPUT_COLOR]]
    moved = [each.triangles + pull * (each.bounds.mean(axis=0) - middle) for each in drawn]
    return [_body(triangles, color, up) for triangles, color in zip(moved, colors, strict=True)]


def _body(triangles: npt.ArrayLike, color: npt.NDArray[np.float64], up: str) -> Body:
    return Body(np.asarray(triangles, dtype=np.float64) @ TO_Z_UP[up].T, color)


def _write(sheet: Any, text: str, place: tuple[int, int], size: int, ink: tuple[int, int, int], anchor: str) -> None:
    from PIL import ImageDraw, ImageFont

    ImageDraw.Draw(sheet).text(place, text, font=ImageFont.load_default(size=size), fill=ink, anchor=anchor)
