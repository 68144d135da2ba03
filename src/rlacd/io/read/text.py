"""Checks of what headers declare about the lines that follow, and of text that would take parsers too long.

A check raises MeshFileError. A ``plain_…`` function returns the same triangles in a form that every parser reads in
time linear in its length.
"""

from __future__ import annotations

import re
import warnings
from pathlib import Path

import numpy as np

from rlacd.errors import MeshFileError
from rlacd.io.read.limits import MOST_TRIANGLES
from rlacd.io.read.polygons import obj_without_folds
from rlacd.io.read.polygons_ply import STRIPS, triangles_ply

OBJ_ZERO = re.compile(rb"^[ \t]*f[^\n#]*[ \t]-?0+(?=[/\s]|$)", re.MULTILINE)
OBJ_BLANKS = re.compile(rb"^[ \t]*(v[nt]?|f)[ \t]+", re.MULTILINE)

MOST_FIELDS = 2000
"""Lines of a PLY file's header: the parser revisits all earlier properties for every list among them."""

PLY_ELEMENT = re.compile(rb"^element\s+(\S+)\s+(\S+)", re.MULTILINE)
PLY_END = re.compile(rb"^end_header[ \t]*\r?\n", re.MULTILINE)
_COMMENTS = rb"(?:(?:comment|obj_info)[^\n]*\n)*"
PLAIN_HEADER = re.compile(
    rb"ply\r?\n"
    + _COMMENTS
    + rb"format ascii 1\.0\s*\n"
    + _COMMENTS
    + rb"element vertex (?P<vertices>\d{1,9})\s*\n(?P<fields>(?:property (?:float|double|float32|float64) \w+\s*\n)+)"
    + _COMMENTS
    + rb"element face (?P<faces>\d{1,9})\s*\nproperty list \w+ u?int(?:32)? vertex_ind(?:ex|ices)\s*\n"
    + _COMMENTS
    + rb"end_header[ \t]*\r?\n"
)
EMPTY_LINES = re.compile(rb"[ \t]*[\r\n]\s*")
BODY_END = re.compile(rb"endsolid", re.IGNORECASE)


def check_text(path: Path, content: bytes) -> None:
    """Refuse text in UTF-16, and text of more lines than any mesh has."""
    if b"\0" in content.rstrip(b"\0"):
        raise MeshFileError(f"{path} is not plain text: save it as UTF-8, or export it again if it is damaged")
    lines = content.count(b"\n")
    if lines > MOST_TRIANGLES:
        raise MeshFileError(f"{path} has {lines} lines, more than {MOST_TRIANGLES}: simplify it first")


def plain_text(content: bytes) -> bytes:
    """Return text as UTF-8 without a byte order mark, with line feeds only; what is no UTF-8 is Latin-1."""
    content = content.removeprefix(b"\xef\xbb\xbf")
    if b"\r" in content:
        content = content.replace(b"\r\n", b"\n").replace(b"\r", b"\n")
    try:
        content.decode()
    except UnicodeDecodeError:
        return content.decode("latin-1").encode()
    return content


def is_text(content: bytes, extension: str) -> bool:
    """Whether a file of this format is text: STL and PLY may be binary."""
    match extension:
        case "stl":
            return b"\0" not in content[:512] and len(content) != 84 + 50 * int.from_bytes(content[80:84], "little")
        case "ply":
            return b"format ascii" in content[:1000]
        case _:
            return extension in ("obj", "off", "xyz")


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
    """Remove the materials of faces: each would make a separate mesh with a table as long as all vertices.

    Concave faces become triangles, as the parser makes fans.
    """
    check_text(path, content)
    content = content.replace(b"\\\n", b" ")
    if OBJ_ZERO.search(content) is not None:
        raise MeshFileError(f"{path} has a face that uses vertex 0, but OBJ counts from 1: export it again")
    return obj_without_folds(spaced_obj(content).replace(b"usemtl ", b"# "))


def spaced_obj(content: bytes) -> bytes:
    """Take blanks from before the words of an OBJ file, and tabs from behind them: the parser skips such lines."""
    if OBJ_BLANKS.match(content) or any(
        mark in content for mark in (b"\n ", b"\n\t", b"\nv\t", b"\nf\t", b"\nvt\t", b"\nvn\t")
    ):
        return OBJ_BLANKS.sub(rb"\1 ", content)
    return content


def plain_stl(path: Path, content: bytes) -> bytes:
    """Check a binary file's length against its count (a short one would be read as text); join the solids of text."""
    if b"\0" in content[:512]:
        count = int.from_bytes(content[80:84], "little")
        if len(content) < 84 + 50 * count:
            raise MeshFileError(f"{path} is cut off: its header declares {count} triangles; export it again")
        return content[: 84 + 50 * count]
    if len(content) == 84 + 50 * int.from_bytes(content[80:84], "little"):
        return content
    check_text(path, content)
    last = content.lower().rfind(b"endsolid")
    return BODY_END.sub(b"", content[:last]) + content[last:] if last >= 0 else content


def plain_ply(path: Path, content: bytes) -> bytes:
    """Check a text file's lines against the counts in its header, and drop empty lines; take polygons apart.

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
    is_ascii = b"ascii" in header.lower().split(b"\n", 2)[1]
    if is_ascii:
        check_text(path, content)
        if (plain := binary_ply(header, content[end.end() :])) is not None:
            return plain
    if (plain := triangles_ply(header, content[end.end() :])) is not None:
        return plain
    if any(name == STRIPS.encode() and int(count) for name, count in PLY_ELEMENT.findall(header)):
        raise MeshFileError(f"{path} holds triangle strips that are damaged, or not all it holds: export triangles")
    if not is_ascii:
        return content
    body = EMPTY_LINES.sub(b"\n", content[end.end() :].strip())
    if body.count(b"\n") + bool(body) < sum(counts):
        raise MeshFileError(f"{path} is cut off: its header declares {sum(counts)} lines; export it again")
    return header + body + b"\n"


def binary_ply(header: bytes, body: bytes) -> bytes | None:
    """Return a text file of vertices and triangles only in binary form, which parses forty times as fast, or None."""
    found = PLAIN_HEADER.fullmatch(header)
    if found is None:
        return None
    fields = [line.split()[1:] for line in found["fields"].splitlines()]
    names = [name for _, name in fields]
    if any(names.count(name) != 1 for name in (b"x", b"y", b"z")):
        return None
    axes = [names.index(name) for name in (b"x", b"y", b"z")]
    vertices, faces = int(found["vertices"]), int(found["faces"])
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", DeprecationWarning)  # of text that ends in something else than numbers
        values = np.fromstring(body, dtype=np.float64, sep=" ")
    if len(values) != vertices * len(fields) + 4 * faces:
        return None
    points = values[: vertices * len(fields)].reshape(vertices, len(fields))[:, axes]
    rows = values[vertices * len(fields) :].reshape(faces, 4)
    with np.errstate(invalid="ignore"):  # of NaN, which is no number of a corner
        corners = rows[:, 1:].astype(np.int32)
    if (rows[:, 0] != 3).any() or (corners != rows[:, 1:]).any():
        return None
    records = np.empty(faces, dtype=[("count", "u1"), ("corners", "<i4", 3)])
    records["count"], records["corners"] = 3, corners
    is_double = any(fields[axis][0] in (b"double", b"float64") for axis in axes)
    lines = ["ply", "format binary_little_endian 1.0", f"element vertex {vertices}"]
    lines += [f"property {'double' if is_double else 'float'} {name}" for name in "xyz"]
    lines += [f"element face {faces}", "property list uchar int vertex_indices", "end_header\n"]
    return "\n".join(lines).encode() + points.astype("<f8" if is_double else "<f4").tobytes() + records.tobytes()


def count_in(path: Path, word: bytes) -> int:
    """Read a count in a header; raises MeshFileError if it is not one."""
    if not re.fullmatch(rb"\+?\d{1,18}", word):
        said = word[:20].decode(errors="replace")
        raise MeshFileError(f"{path} has {said!r} in its header where a count belongs: it is damaged; export it again")
    return int(word)
