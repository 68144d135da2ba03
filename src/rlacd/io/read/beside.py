"""Files beside a mesh that it refers to: only those of its own folder, or below it."""

from __future__ import annotations

import contextlib
import json
import re
from collections.abc import Mapping
from pathlib import Path
from urllib.parse import unquote

from rlacd.io.read.open_file import LARGEST_FILE, read_file, read_named

DATA = frozenset({".bin"})
"""To read triangles: no colours, and no images, whose decoders are the riskier part of any loader."""

IMAGES = frozenset({".png", ".jpg", ".jpeg", ".webp", ".ktx2", ".dds"})
"""Copied, never decoded."""

PICTURES = frozenset({".mtl", ".png", ".jpg", ".jpeg", ".bmp", ".tga", ".tif", ".tiff", ".gif", ".webp"})
"""Materials, and pictures that are decoded: read only for files that keep them."""


class FolderFiles:
    """Serves files of one folder only.

    A name that leads out of the folder, by ``..``, an absolute path or a link, counts as missing; so does a file whose
    name ends in none of `endings`.
    """

    def __init__(self, folder: Path, endings: frozenset[str] = DATA) -> None:
        self._folder = folder.resolve()
        self._endings = endings
        self._read: dict[Path, bytes] = {}

    def get(self, name: str, unquoted: bool = True) -> bytes:
        """Return the content of a file in the folder, cached, since a file may be named any number of times.

        The name may be written like that of an address, if it is to be `unquoted`, or as in Windows.

        Raises
        ------
        FileNotFoundError
            There is no such file, or it may not be read.
        """
        for spelled in dict.fromkeys((name, unquote(name) if unquoted else name, name.replace("\\", "/"))):
            try:
                path = (self._folder / spelled.strip()).resolve()
                if path.suffix.lower() not in self._endings or not path.is_relative_to(self._folder):
                    continue
                if path not in self._read:
                    self._read[path] = read_file(path, LARGEST_FILE - sum(map(len, self._read.values())))
            except (OSError, ValueError, RuntimeError):  # a name with a NUL, circular links
                continue
            return self._read[path]
        endings = " or ".join(sorted(self._endings))
        raise FileNotFoundError(f"{name!r:.200}, which has to be in its folder or below it, and to end in {endings}")


def mesh_files(path: Path, name: str | None = None) -> dict[str, bytes]:
    """Read all files that make up a mesh, by name relative to its folder; the mesh file itself comes first.

    Parameters
    ----------
    path : Path
        The mesh file.
    name : str, optional
        Its name in messages.

    Raises
    ------
    MeshFileError
        The mesh file cannot be opened.
    """
    content = read_named(path, name=name)
    return {path.name: content, **_beside(path, content)}


def lay_out(files: Mapping[str, bytes], folder: Path) -> Path:
    """Write the files read by `mesh_files` to a folder, except names that lead outside; returns the mesh file."""
    for name, content in files.items():
        target = folder / name
        if target.resolve().is_relative_to(folder.resolve()):
            target.parent.mkdir(parents=True, exist_ok=True)
            target.write_bytes(content)
    return folder / next(iter(files))


def _beside(path: Path, content: bytes) -> dict[str, bytes]:
    """Files beside a mesh that it names: buffers and images of glTF, materials and pictures of OBJ and COLLADA."""
    match path.suffix.lower():
        case ".gltf":
            return _found(path, _of_gltf(content), DATA | IMAGES)
        case ".obj":
            materials = _found(path, _values(_MTLLIB, content), PICTURES)
            pictures = [name for data in materials.values() for name in _values(MAP, data)]
            return {**materials, **_found(path, pictures, PICTURES)}
        case ".dae":
            return _found(path, _values(_INIT_FROM, content), PICTURES)
        case _:
            return {}


_MTLLIB = re.compile(rb"^mtllib[ \t]+(.+)$", re.MULTILINE)
MAP = re.compile(
    rb"^[ \t]*map_Kd[ \t]+(?:-\w+[ \t]+(?:(?:[-+.\d]+|on|off|\w)[ \t]+)*)*(.+)$", re.MULTILINE | re.IGNORECASE
)
"""The picture of a material in an MTL file, behind options."""

_INIT_FROM = re.compile(rb"<init_from>([^<]{1,1000})</init_from>")


def _values(pattern: re.Pattern[bytes], content: bytes) -> list[str]:
    return [value.decode(errors="replace").strip() for value in pattern.findall(content)]


def _of_gltf(content: bytes) -> list[str]:
    """The files that buffers and images name; the loader reports what is missing."""
    try:
        header = json.loads(content)
        named = [*header.get("buffers", []), *header.get("images", [])]
        uris = [str(one["uri"]) for one in named if "uri" in one]
    except (ValueError, KeyError, TypeError, AttributeError, RecursionError):
        return []
    return [uri for uri in uris if not uri.startswith("data:")]


def _found(path: Path, uris: list[str], endings: frozenset[str]) -> dict[str, bytes]:
    """Those that are in the folder of the mesh, or below it."""
    files = FolderFiles(path.parent, endings)
    found: dict[str, bytes] = {}
    for name in sorted({spelled for uri in uris for spelled in (uri, unquote(uri))}):
        with contextlib.suppress(FileNotFoundError):
            data = files.get(name, unquoted=False)
            if len(data) + sum(len(known) for known in found.values()) <= LARGEST_FILE:  # one file may have many names
                found[name] = data
    return found
