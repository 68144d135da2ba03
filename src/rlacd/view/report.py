"""The report: one HTML file with a 3-D view, the picture, and all measurements; works offline."""

from __future__ import annotations

import base64
import os
from pathlib import Path
from typing import Any

from rlacd._version import __version__
from rlacd.errors import MissingExtraError
from rlacd.io.write import write_file
from rlacd.io.write.target import checked_place
from rlacd.result import Result
from rlacd.view.heat import heat_map
from rlacd.view.page import still_page
from rlacd.view.picture import check_up, picture_bytes
from rlacd.view.render import Render, render
from rlacd.view.scene import heat_scene, scene


def check_report_page(path: str | os.PathLike[str], up: str | None = None) -> Path:
    """Check, before any work, that `save_report_page` will be able to write to `path`.

    Raises
    ------
    OptionError
        The name does not end in ``.html``, or `up` is not an axis.
    OutputError
        The place is not writable.
    """
    check_up(up)
    return checked_place(path, "the report", (".html", ".htm"))


def save_report_page(
    decomposition: Result, path: str | os.PathLike[str], *, up: str | None = None, picture: bool = True
) -> Path:
    """Write a report as one self-contained HTML file.

    It holds a 3-D view that can be rotated and exploded, the list of parts, an error heat map, the repairs, timings,
    options and warnings. The same decomposition gives the same bytes.

    Parameters
    ----------
    decomposition : Result
    path : path-like
        A ``.html`` file.
    up : {"x", "y", "z"}, optional
        The axis of the input that points up.
    picture : bool
        Include the picture, which takes a few seconds to render. Without the extra ``view`` it is left out, and a note
        says so.

    Returns
    -------
    pathlib.Path
        Where it was written.

    Raises
    ------
    OutputError, OptionError
        As for `check_report_page`.
    """
    place = check_report_page(path, up)
    write_file(place, report_page(decomposition, up=up, picture=picture).encode())
    return place


def report_page(
    decomposition: Result,
    *,
    up: str | None = None,
    picture: bool = True,
    unit: str | None = None,
    render: Render = render,
) -> str:
    """Build the text of the report; see `save_report_page`. The unit is the input's, unless it is given."""
    up = decomposition.up_axis(up)
    if unit is None:
        unit = "" if decomposition.input is None else decomposition.input.unit
    # The heat map gets that many triangles, up to a few times as many: about half a megabyte.
    data: dict[str, Any] = {
        **scene(decomposition, up, unit=unit),
        "heat": heat_scene(heat_map(decomposition, triangles=16_000)),
        **(_picture(decomposition, up, render) if picture else {}),
    }
    return still_page(f"{decomposition.name}: convex hulls", {"version": __version__}, data)


def _picture(decomposition: Result, up: str, render: Render) -> dict[str, str]:
    """The picture as a data URL, or a note that explains its absence."""
    try:
        png = picture_bytes(decomposition, width=1500, up=up, clear=True, render=render)
    except MissingExtraError as error:
        return {"note": f"The picture is left out: {error}"}
    return {"picture": "data:image/png;base64," + base64.b64encode(png).decode("ascii")}
