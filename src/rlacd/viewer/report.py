"""The report: one HTML file with a 3-D view, the picture, and all measurements; works offline."""

from __future__ import annotations

import base64
import os
from collections.abc import Callable
from pathlib import Path
from typing import Any

from rlacd._version import __version__
from rlacd.errors import MissingExtraError
from rlacd.io.write import write_file
from rlacd.io.write.target import checked_place
from rlacd.options.output import PAGES, REPORTS
from rlacd.plain_json import to_json
from rlacd.result import Result
from rlacd.viewer.heat import heat_map
from rlacd.viewer.page import still_page
from rlacd.viewer.picture import check_up, picture_bytes
from rlacd.viewer.scene import heat_scene, scene


def save_report_page(
    decomposition: Result, path: str | os.PathLike[str], *, up: str | None = None, picture: bool = True
) -> Path:
    """Write a report; see `rlacd.Decomposition.save_report`.

    A page may leave out the picture, which takes a few seconds to render. Without the extra ``view`` it does, and says
    so.
    """
    check_up(up)
    return save_report(path, decomposition.report, lambda: report_page(decomposition, up=up, picture=picture))


def save_report(path: str | os.PathLike[str], values: Any, page: Callable[[], str]) -> Path:
    """Write measurements as JSON or as a page, by the ending of the path."""
    place = checked_place(path, "the report", REPORTS)
    write_file(place, (page() if place.suffix.lower() in PAGES else to_json(values)).encode())
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
