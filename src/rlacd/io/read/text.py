"""Checks of what headers declare about the lines that follow, and of text that would take parsers too long.

A check raises MeshFileError. A ``plain_…`` function returns the same triangles in a form that every parser reads in
time linear in its length.
"""

from __future__ import annotations

import re
from pathlib import Path

from rlacd.errors import MeshFileError
from rlacd.io.read.limits import MOST_TRIANGLES

MOST_FIELDS = 2000
"""Lines of a PLY file's header: the parser revisits all earlier properties for every list among them."""

PLY_ELEMENT = re.compile(rb"^element\s+(\S+)\s+(\S+)", re.MULTILINE)
PLY_END = re.compile(rb"^end_header[ \t]*\r?\n", re.MULTILINE)
EMPTY_LINES = re.compile(rb"[ \t]*[\r\n]\s*")
BODY_END = re.compile(rb"endsolid", re.IGNORECASE)


def check_text(path: Path, content: bytes) -> None:
    """Refuse text in UTF-16, and text of more lines than any mesh has."""
    if b"\0" in content.rstrip(b"\0"):
        raise MeshFileError(f"{path} is no plain text: save it as UTF-8, or export it again if it is damaged")
    lines = content.count(b"\n")
    if lines > MOST_TRIANGLES:
        raise MeshFileError(f"{path} has {lines} lines, more than {MOST_TRIANGLES}: simplify it first")


def declared_triangles(content: bytes, extension: str) -> int | None:
    """Return how many triangles a file holds by its own account, before anything is parsed.

    None if its format does not say so, or if the file is too short for as many: parsers have words for that.
    """
    count = None
    match extension:
        case "stl" if b"\0" in content[:512]:
            count = int.from_bytes(content[80:84], "little")
        case "stl":
            return content.count(b"endfacet")
        case "obj":
            return content.count(b"\nf ")
        case "ply" if (end := PLY_END.search(content)) is not None:
            found = PLY_ELEMENT.findall(content[: end.end()])
            count = next((int(word) for name, word in found if name == b"face" and word.isdigit()), None)
    return count if count is not None and 4 * count <= len(content) else None


def plain_obj(path: Path, content: bytes) -> bytes:
    """Remove the materials of faces: each would make a separate mesh with a table as long as all vertices."""
    check_text(path, content)
    return content.replace(b"usemtl ", b"# ")


def plain_stl(path: Path, content: bytes) -> bytes:
    """Check a binary file's length against its count (a short one would be read as text); join the solids of text."""
    if b"\0" in content[:512]:
        count = int.from_bytes(content[80:84], "little")
        if len(content) < 84 + 50 * count:
            raise MeshFileError(f"{path} is cut off: its header promises {count} triangles; export it again")
        return content
    if len(content) == 84 + 50 * int.from_bytes(content[80:84], "little"):
        return content
    check_text(path, content)
    last = content.lower().rfind(b"endsolid")
    return BODY_END.sub(b"", content[:last]) + content[last:] if last >= 0 else content


def plain_ply(path: Path, content: bytes) -> bytes:
    """Check a text file's lines against the counts in its header, and drop empty lines.

    The parser itself checks binary files, except for negative counts.
    """
    end = PLY_END.search(content)
    if end is None:
        raise MeshFileError(f"{path} cannot be read as ply: its header has no end; export it again")
    header = content[: end.end()]
    fields = header.count(b"\n")
    if fields > MOST_FIELDS:
        raise MeshFileError(f"{path} has a header of {fields} lines, more than {MOST_FIELDS}: export it again")
    counts = [count_in(path, word) for _, word in PLY_ELEMENT.findall(header)]
    if b"ascii" not in header.lower().split(b"\n", 2)[1]:
        return content
    check_text(path, content)
    body = EMPTY_LINES.sub(b"\n", content[end.end() :].strip())
    if body.count(b"\n") + bool(body) < sum(counts):
        raise MeshFileError(f"{path} is cut off: its header promises {sum(counts)} lines; export it again")
    return header + body + b"\n"


def count_in(path: Path, word: bytes) -> int:
    """Read a count in a header; raises MeshFileError if it is not one."""
    if not re.fullmatch(rb"\+?\d{1,18}", word):
        said = word[:20].decode(errors="replace")
        raise MeshFileError(f"{path} has {said!r} in its header where a count belongs: it is damaged; export it again")
    return int(word)
