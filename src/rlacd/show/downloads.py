"""What the viewer offers to keep: hulls in every format, models for simulators and engines, the balls, the report."""

from __future__ import annotations

import io
import tempfile
import zipfile
from dataclasses import dataclass
from pathlib import Path
from typing import cast

from rlacd.decomposition import Axis, Decomposition
from rlacd.errors import OptionError
from rlacd.formats import FORMATS, MODELS, file_stem
from rlacd.plain_json import to_json
from rlacd.show.html_report import report_page

FOLDERS = ("obj", "stl")
"""Formats that are offered as a file a hull too."""


@dataclass(frozen=True)
class Download:
    """A file's name and bytes."""

    name: str
    content: bytes


def offered() -> list[tuple[str, str]]:
    """Name what can be downloaded, each with a hint."""
    return [
        *((ending, f"All hulls in one .{ending} file") for ending in FORMATS),
        *((f"{ending}.zip", f"A .{ending} file a hull, zipped") for ending in FOLDERS),
        *((model, f"A model with the input and its hulls (.{MODELS[model][0]})") for model in MODELS),
        ("balls.csv", "The balls that no hull touches: x, y, z, radius"),
        ("report.html", "A page with all there is to see, for others"),
        ("report.json", "Everything measured"),
    ]


def download(decomposition: Decomposition, wanted: str, *, up: str = "z") -> Download:
    """Make one of the files `offered`; what takes several files comes zipped.

    Parameters
    ----------
    decomposition : Decomposition
    wanted : str
        The name of what is offered.
    up : {"x", "y", "z"}
        The axis of the input that points up.

    Raises
    ------
    OptionError
        `wanted` is not offered.
    OutputError
        The hulls cannot be written in this format, or there are no balls.
    MissingExtraError
        The format needs an extra that is not installed.
    """
    if wanted not in dict(offered()):
        raise OptionError(f"{wanted!r} cannot be downloaded; choose one of {', '.join(dict(offered()))}.")
    stem = file_stem(decomposition.name)
    if wanted == "report.html":
        return Download(f"{stem}_hulls.html", report_page(decomposition, up=up).encode())
    if wanted == "report.json":
        return Download(f"{stem}_hulls.json", to_json(decomposition.report).encode())
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        if wanted == "balls.csv":
            decomposition.save_balls(folder / f"{stem}_balls.csv")
        elif wanted in MODELS:
            place = folder / f"{stem}.{MODELS[wanted][0]}"
            decomposition.save(place, file_format=wanted, up=cast(Axis, up))
        elif wanted.endswith(".zip"):
            decomposition.save(folder, file_format=wanted.removesuffix(".zip"))
        else:
            decomposition.save(folder / f"{stem}_hulls.{wanted}")
        files = sorted(path for path in folder.rglob("*") if path.is_file())
        if len(files) == 1 and not wanted.endswith(".zip"):
            return Download(files[0].name, files[0].read_bytes())
        return Download(f"{stem}_hulls_{wanted.removesuffix('.zip')}.zip", _zipped(folder, files))


def _zipped(folder: Path, files: list[Path]) -> bytes:
    content = io.BytesIO()
    with zipfile.ZipFile(content, "w", zipfile.ZIP_DEFLATED) as archive:
        for path in files:
            # Without a date: the same hulls give the same bytes.
            entry = zipfile.ZipInfo(path.relative_to(folder).as_posix())
            archive.writestr(entry, path.read_bytes(), zipfile.ZIP_DEFLATED)
    return content.getvalue()
