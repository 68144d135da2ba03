"""What the viewer offers to keep: hulls in every format, the balls, the report."""

from __future__ import annotations

import io
import tempfile
import zipfile
from dataclasses import dataclass
from pathlib import Path

from rlacd.decomposition import Decomposition
from rlacd.errors import OptionError
from rlacd.formats import FORMATS
from rlacd.plain_json import to_json
from rlacd.show.html_report import report_page

REPORTS = {"report.html": "A page with all there is to see, for others", "report.json": "Everything measured"}


@dataclass(frozen=True)
class Download:
    """A file's name and bytes."""

    name: str
    content: bytes


def offered() -> list[tuple[str, str]]:
    """Name what can be downloaded, each with a hint."""
    return [
        *((ending, f"All hulls in one .{ending} file") for ending in FORMATS),
        *((f"{ending}.zip", f"A .{ending} file a hull, zipped") for ending in ("obj", "stl")),
        *REPORTS.items(),
    ]


def download(decomposition: Decomposition, wanted: str, *, up: str = "z") -> Download:
    """Make one of the files `offered`.

    A format that writes several files comes zipped.

    Raises
    ------
    OptionError
        `wanted` is not offered.
    OutputError
        The hulls cannot be written in this format.
    """
    if wanted not in dict(offered()):
        raise OptionError(f"{wanted!r} cannot be downloaded; choose one of {', '.join(dict(offered()))}.")
    stem = f"{_plain_name(decomposition.name)}_hulls"
    if wanted == "report.html":
        return Download(f"{stem}.html", report_page(decomposition, up=up).encode())
    if wanted == "report.json":
        return Download(f"{stem}.json", to_json(decomposition.report).encode())
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        if wanted.endswith(".zip"):
            decomposition.save(folder, file_format=wanted.removesuffix(".zip"))
        else:
            decomposition.save(folder / f"{stem}.{wanted}")
        files = sorted(path for path in folder.rglob("*") if path.is_file())
        if len(files) == 1 and not wanted.endswith(".zip"):
            return Download(files[0].name, files[0].read_bytes())
        return Download(f"{stem}_{wanted.removesuffix('.zip')}.zip", _zipped(folder, files))


def _zipped(folder: Path, files: list[Path]) -> bytes:
    content = io.BytesIO()
    with zipfile.ZipFile(content, "w", zipfile.ZIP_DEFLATED) as archive:
        for path in files:
            # Without a date: the same hulls give the same bytes.
            archive.writestr(
                zipfile.ZipInfo(path.relative_to(folder).as_posix()), path.read_bytes(), zipfile.ZIP_DEFLATED
            )
    return content.getvalue()


def _plain_name(name: str) -> str:
    kept = "".join("_" if mark in '/\\:*?"<>|' or ord(mark) < 32 else mark for mark in name)
    return kept.encode(errors="replace")[:150].decode(errors="ignore").strip(". ") or "mesh"
