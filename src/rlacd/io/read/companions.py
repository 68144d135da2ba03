"""The content of all files that a mesh is read from: what is sent along with it, and what its hash covers."""

from __future__ import annotations

import json
import re
from collections.abc import Mapping
from pathlib import Path
from urllib.parse import unquote

from rlacd.errors import MeshFileError
from rlacd.io.read.beside import DATA, IMAGES, PICTURES
from rlacd.io.read.open_file import LARGEST, read_file


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
    try:
        content = read_file(path)
    except OSError as error:
        reason = (error.strerror or str(error)).lower()
        raise MeshFileError(f"{name or path} cannot be opened ({reason}): check its name and permissions") from error
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
            pictures = [name for data in materials.values() for name in _values(_MAP, data)]
            return {**materials, **_found(path, pictures, PICTURES)}
        case ".dae":
            return _found(path, _values(_INIT_FROM, content), PICTURES)
        case _:
            return {}


_MTLLIB = re.compile(rb"^mtllib[ \t]+(.+)$", re.MULTILINE)
_MAP = re.compile(rb"^[ \t]*map_Kd[ \t]+(.+)$", re.MULTILINE | re.IGNORECASE)
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
    found: dict[str, bytes] = {}
    for name in sorted({spelled for uri in uris for spelled in (uri, unquote(uri))}):
        try:
            file = (path.parent / name).resolve()
            if file.is_relative_to(path.parent.resolve()) and file.suffix.lower() in endings:
                found[name] = read_file(file, LARGEST - sum(map(len, found.values())))
        except (OSError, ValueError, RuntimeError):
            continue
    return found
