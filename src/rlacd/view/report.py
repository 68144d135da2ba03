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
from rlacd.options.output import PAGES
from rlacd.result import Result
from rlacd.view.heat import heat_map
from rlacd.view.page import still_page
from rlacd.view.picture import check_up, picture_bytes
from rlacd.view.scene import heat_scene, scene


def save_report_page(
    decomposition: Result, path: str | os.PathLike[str], *, up: str | None = None, picture: bool = True
) -> Path:
    """Write a report; see `rlacd.Decomposition.save_report`.

    It may leave out the picture, which takes a few seconds to render. Without the extra ``view`` it does, and says so.
    """
    check_up(up)
    place = checked_place(path, "the report", PAGES)
    write_file(place, report_page(decomposition, up=up, picture=picture).encode())
    return place


def report_page(decomposition: Result, *, up: str | None = None, picture: bool = True) -> str:
    """Build the text of the report; see `save_report_page`."""
    up = decomposition.up_axis(up)
    # The heat map gets that many triangles, up to a few times as many: about half a megabyte.
    heat = heat_scene(heat_map(decomposition, triangles=16_000))
    data: dict[str, Any] = {**scene(decomposition, up), "heat": heat}
    if picture:
        try:
            png = picture_bytes(decomposition, width=1500, up=up, clear=True)
            data["picture"] = "data:image/png;base64," + base64.b64encode(png).decode("ascii")
        except MissingExtraError as error:
            data["note"] = f"The picture is left out: {error}"
    return still_page(f"{decomposition.name}: convex hulls", {"version": __version__}, data)
