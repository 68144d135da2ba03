"""Reading untrusted files: regular files only, and none that would not fit into memory.

What a file holds is told from its first bytes.
"""

from __future__ import annotations

import errno
import os
import re
import stat
from pathlib import Path

from rlacd.errors import MeshFileError

LARGEST_FILE = 2**30
"""Bytes of the largest file that is read. A binary STL of this length has 21 million triangles."""

UPLOAD = "rlacd-view-"
"""What the name of a folder begins with that holds nothing but a file that was uploaded to the viewer."""

# Opening a pipe would wait for a writer; Windows has no such files, and would translate line ends.
_FLAGS = os.O_RDONLY | getattr(os, "O_NONBLOCK", 0) | getattr(os, "O_BINARY", 0)


def read_file(path: str | os.PathLike[str], most: int = LARGEST_FILE) -> bytes:
    """Read the content of a file as of opening it, even if it grows meanwhile.

    Parameters
    ----------
    path : path-like
        Links are followed.
    most : int
        Bytes of the largest file that is read.

    Raises
    ------
    OSError
        The file cannot be opened, is no regular one (pipes and devices may never end), or is too large; ``strerror``
        says which.
    """
    _check(os.stat(path), path, most)  # opening a device may have side effects
    handle = os.open(path, _FLAGS)
    try:
        opened = os.fstat(handle)  # the name may refer to another file by now
        _check(opened, path, most)
    except OSError:
        os.close(handle)
        raise
    with os.fdopen(handle, "rb") as file:
        return file.read(opened.st_size)


def missing(path: Path | str) -> MeshFileError:
    """The error for a file that does not exist; a path may be an address, of which `Path` keeps one slash."""
    address = re.fullmatch(r"((?:https?|ftp|s3|gs):)/+(.*)", str(path), re.IGNORECASE | re.DOTALL)
    if address:
        named = "//".join(address.groups())
        return MeshFileError(f"{named} is an address, and nothing is fetched: download the file, and give its path")
    return MeshFileError(f"{path} does not exist: check the spelling and the folder")


def read_named(path: Path, most: int = LARGEST_FILE, name: str | None = None) -> bytes:
    """Read a file that a user or another file names, as `read_file` does; raises MeshFileError."""
    try:
        return read_file(path, most)
    except FileNotFoundError as error:
        raise missing(name or path) from error
    except IsADirectoryError as error:
        raise MeshFileError(f"{name or path} is a folder: give a file in it") from error
    except (OSError, ValueError) as error:
        reason = (getattr(error, "strerror", None) or str(error)).lower()
        raise MeshFileError(f"{name or path} cannot be opened ({reason}): check its name and permissions") from error


def _check(status: os.stat_result, path: str | os.PathLike[str], most: int) -> None:
    if stat.S_ISDIR(status.st_mode):
        raise IsADirectoryError(errno.EISDIR, os.strerror(errno.EISDIR), os.fspath(path))
    if not stat.S_ISREG(status.st_mode):
        raise OSError(errno.EINVAL, "it is a pipe or a device, not a regular file", os.fspath(path))
    if status.st_size > most:
        raise OSError(errno.EFBIG, f"it is larger than {most / 2**20:g} MB", os.fspath(path))


CONVERTERS = {
    "blend": "export it from Blender (File > Export > glTF 2.0)",
    **dict.fromkeys(("zip", "gz", "bz2", "xz", "zst", "7z", "rar", "tar", "tgz"), "unpack it, and give the mesh in it"),
    "xacro": "expand its macros with the tool xacro, and give the URDF",
    "urdf": "it describes a robot, which rlacd.rewrite_robot takes",
    "mjcf": "files for MuJoCo end in .xml, and rlacd.rewrite_robot takes them",
    "sdf": "robots are rewritten as .urdf and .xml (MJCF): give one of those, or a mesh",
}
"""What to do with files that people have and that are not read."""

NO_MESHES = {
    b"version https://git-lfs": "only names a file that Git LFS keeps: run  git lfs pull",
    b"<!doctype html": "is a web page: download the mesh itself",
    b"<html": "is a web page: download the mesh itself",
}
"""How files begin that people have in place of a mesh, and what to do."""

OFF_KEYWORD = re.compile(rb"((?:ST|[CN4n])*)OFF(?![A-Za-z])|off(?![A-Za-z])")

_OBJ_WORDS = {b"v", b"vn", b"vt", b"vp", b"f", b"l", b"p", b"g", b"o", b"s", b"mtllib", b"usemtl"}


MAGIC, JSON_CHUNK, BINARY_CHUNK = b"glTF", b"JSON", b"BIN\0"
"""How a binary glTF file begins, and what its chunks are called."""

_MARKS = {MAGIC: "glb", b"Kaydara FBX Binary": "fbx", b"ISO-10303-21;": "step", b"ply\n": "ply", b"ply\r": "ply"}


def format_of(content: bytes) -> str | None:
    """Guess the format of a file."""
    head = content[:4096].lstrip(b"\xef\xbb\xbf \t\r\n")
    for mark, name in _MARKS.items():
        if head.startswith(mark):
            return name
    if head.startswith(b"PK\x03\x04"):
        known = {"usdz": b".usd" in head, "zae": b".dae" in content, "3mf": b".model" in content}
        return next((name for name, held in known.items() if held), None)
    lines = [line.split() for line in head.splitlines() if line.strip() and not line.lstrip().startswith(b"#")]
    if lines and OFF_KEYWORD.match(lines[0][0]):
        return "off"
    if head.startswith(b"<") and b"COLLADA" in head:
        return "dae"
    if head.startswith(b"{") and b'"asset"' in content:
        return "gltf"
    if len(content) >= 84 and len(content) == 84 + 50 * int.from_bytes(content[80:84], "little"):
        return "stl"
    if head.startswith(b"solid") and b"facet" in head:
        return "stl"
    words = {line[0] for line in lines[:-1]}
    return "obj" if b"v" in words and words <= _OBJ_WORDS else None
