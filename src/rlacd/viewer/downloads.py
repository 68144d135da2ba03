"""The viewer's downloads: hulls in every format, models for simulators and engines, the balls, the report."""

from __future__ import annotations

import io
import tempfile
import zipfile
from dataclasses import dataclass
from importlib.util import find_spec
from pathlib import Path
from typing import cast

from rlacd.errors import OptionError, extra_needed
from rlacd.io.write import FORMATS, MODELS, file_stem, save
from rlacd.io.write.balls import save_balls
from rlacd.io.write.target import WITH_MESHES
from rlacd.options.output import Axis
from rlacd.plain_json import to_json
from rlacd.result import Result
from rlacd.viewer.report import report_page
from rlacd.viewer.robot import RobotResult

FOLDERS = ("obj", "stl")
"""Formats also offered with one file per hull."""


@dataclass(frozen=True)
class Offer:
    """An entry of the download menu."""

    name: str
    """The name that `download` takes."""
    label: str
    """Its text in the menu."""
    hint: str
    """A sentence about its content."""
    group: str
    """The heading it is listed under."""
    missing: str | None = None
    """Why it is unavailable here; None if it is available."""


def offered() -> list[Offer]:
    """List everything that can be downloaded."""
    return [
        *(Offer(ending, ending.upper(), f"All hulls in one .{ending} file.", "Hulls") for ending in FORMATS),
        *(
            Offer(f"{ending}.zip", f"{ending.upper()} zip", f"One .{ending} file per hull, zipped.", "Hulls")
            for ending in FOLDERS
        ),
        *(
            Offer(
                name,
                model.label,
                f"The mesh with its hulls as collision shapes, for {model.reader}"
                f" (.{model.endings[0]}{' and its meshes, zipped' if model.with_meshes else ''}).",
                "Models",
                extra_needed("USD", "usd") if name == "usd" and find_spec("pxr") is None else None,
            )
            for name, model in MODELS.items()
        ),
        Offer("report.html", "Report", "This view as one HTML file that opens anywhere, offline.", "More"),
        Offer("report.json", "Numbers", "Everything that was measured, as JSON.", "More"),
        Offer("balls.csv", "Balls", "The balls that no hull touches: x, y, z and radius.", "More"),
    ]


def download(decomposition: Result, wanted: str, *, up: str = "z") -> tuple[str, bytes]:
    """Make one of the files `offered`: its name and content; several files are zipped.

    Parameters
    ----------
    decomposition : Result
    wanted : str
        The name of the offer.
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
    names = [offer.name for offer in offered()]
    if wanted not in names:
        raise OptionError(f"{wanted!r} cannot be downloaded; choose one of {', '.join(names)}.")
    if isinstance(decomposition, RobotResult) and wanted in MODELS:
        raise OptionError("a robot is not one body: rlacd decompose writes it with its joints; copy the command.")
    stem = file_stem(decomposition.name)
    if wanted == "report.html":
        return (f"{stem}_hulls.html", report_page(decomposition, up=up).encode())
    if wanted == "report.json":
        return (f"{stem}_hulls.json", to_json(decomposition.report).encode())
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        if wanted == "balls.csv":
            if decomposition.balls is None:
                raise OptionError("there are no balls to write; decompose with a NavigableSpace.")
            save_balls(decomposition.balls, folder / f"{stem}_balls.csv")
        elif wanted in MODELS:
            place = folder / f"{stem if wanted in WITH_MESHES else f'{stem}_{wanted}'}.{MODELS[wanted].endings[0]}"
            save(decomposition, place, file_type=wanted, up=cast(Axis, up))
        elif wanted.endswith(".zip"):
            save(decomposition, folder, file_type=wanted.removesuffix(".zip"))
        else:
            save(decomposition, folder / f"{stem}_hulls.{wanted}")
        files = sorted(path for path in folder.rglob("*") if path.is_file())
        if len(files) == 1 and not wanted.endswith(".zip"):
            return (files[0].name, files[0].read_bytes())
        return (f"{stem}_hulls_{wanted.removesuffix('.zip')}.zip", _zipped(folder, files))


def _zipped(folder: Path, files: list[Path]) -> bytes:
    content = io.BytesIO()
    with zipfile.ZipFile(content, "w", zipfile.ZIP_DEFLATED) as archive:
        for path in files:
            # Without a date, so that the same hulls give the same bytes.
            entry = zipfile.ZipInfo(path.relative_to(folder).as_posix())
            archive.writestr(entry, path.read_bytes(), zipfile.ZIP_DEFLATED)
    return content.getvalue()
