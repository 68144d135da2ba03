"""One object decomposed by every method, side by side, with the numbers under each: the paper's Fig. 5."""

from __future__ import annotations

import io
import math
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.methods import RawHull
from benchmarks.store import Row
from rlacd.io.read.load import load_mesh
from rlacd.io.write.palette import hull_colors, linear_from_srgb
from rlacd.view.picture import FADED, INK, INPUT_COLOR, PAPER, TO_Z_UP
from rlacd.view.render import Body, render, require_extra

PANEL = (340, 300)
"""Pixels of one picture."""

COLUMNS = 5
FOOTER = 62
HEADER = 40
SAMPLES = 6
"""Light paths per pixel; the pictures are small."""


def draw_sheet(
    mesh: Path, decompositions: Sequence[tuple[str, Sequence[RawHull], Row]], up: str = "z", samples: int = SAMPLES
) -> bytes:
    """Draw the input and the hulls of several methods as PNG.

    Parameters
    ----------
    mesh : Path
        The input.
    decompositions : sequence of (label, hulls, row)
        In panel order, after the input.
    up : {"x", "y", "z"}
        The axis of the input that points up in the picture.
    samples : int
        Light paths per pixel.

    Raises
    ------
    MissingExtraError
        The extra ``view`` is not installed.
    """
    image = require_extra("PIL.Image")
    source = load_mesh(mesh)
    panels: list[tuple[str, str, list[Body]]] = [
        ("input", f"{len(source.faces)} faces", [_body(source.vertices, source.faces, INPUT_COLOR, up)])
    ]
    for label, hulls, row in decompositions:
        colors = linear_from_srgb(hull_colors(len(hulls)))
        bodies = [_body(v, f, color, up) for (v, f), color in zip(hulls, colors, strict=True)]
        numbers = f"#P {row['parts']}   D_h {row['hausdorff']:.3f}   #F {row['faces']}   {row['cpu']:.2f} s"
        panels.append((label, numbers, bodies))
    width, height = PANEL
    rows = math.ceil(len(panels) / COLUMNS)
    columns = math.ceil(len(panels) / rows)
    sheet = image.new("RGB", (columns * width, HEADER + rows * (height + FOOTER)), PAPER)
    _write(sheet, mesh.stem, (14, HEADER // 2), 20, INK, "lm")
    for number, (label, numbers, bodies) in enumerate(panels):
        left, top = number % columns * width, HEADER + number // columns * (height + FOOTER)
        sheet.paste(image.fromarray(render(bodies, width, height, samples=samples)), (left, top))
        middle = left + width // 2
        _write(sheet, label, (middle, top + height + 16), 17, INK, "mm")
        _write(sheet, numbers, (middle, top + height + 38), 14, FADED, "mm")
    encoded = io.BytesIO()
    # The sheet has few colours on white; a palette cuts the file to a third without a visible difference.
    sheet.quantize(256).save(encoded, format="PNG", optimize=True)
    return encoded.getvalue()


def _body(vertices: Any, faces: Any, color: Any, up: str) -> Body:
    return Body(np.asarray(vertices, dtype=np.float64)[np.asarray(faces)] @ TO_Z_UP[up].T, color)


def _write(sheet: Any, text: str, place: tuple[int, int], size: int, ink: tuple[int, int, int], anchor: str) -> None:
    from PIL import ImageDraw, ImageFont

    ImageDraw.Draw(sheet).text(place, text, font=ImageFont.load_default(size=size), fill=ink, anchor=anchor)
