"""The content of all files that a mesh is read from: what is sent along with it, and what its hash covers."""

from __future__ import annotations

import json
from collections.abc import Mapping
from pathlib import Path
from urllib.parse import unquote

from rlacd.errors import MeshFileError
from rlacd.io.read.beside import DATA, IMAGES
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
    return {path.name: content, **_buffers(path, content)}


def lay_out(files: Mapping[str, bytes], folder: Path) -> Path:
    """Write the files read by `mesh_files` to a folder, except names that lead outside; returns the mesh file."""
    for name, content in files.items():
        target = folder / name
        if target.resolve().is_relative_to(folder.resolve()):
            target.parent.mkdir(parents=True, exist_ok=True)
            target.write_bytes(content)
    return folder / next(iter(files))


def _buffers(path: Path, content: bytes) -> dict[str, bytes]:
    """Files beside a glTF file that its buffers and images name; the loader reports missing buffers."""
    if path.suffix.lower() != ".gltf":
        return {}
    try:
        header = json.loads(content)
        named = [*header.get("buffers", []), *header.get("images", [])]
        uris = [str(one["uri"]) for one in named if "uri" in one]
    except (ValueError, KeyError, TypeError, AttributeError, RecursionError):
        return {}
    found: dict[str, bytes] = {}
    for name in sorted({spelled for uri in uris if not uri.startswith("data:") for spelled in (uri, unquote(uri))}):
        try:
            buffer = (path.parent / name).resolve()
            if buffer.is_relative_to(path.parent.resolve()) and buffer.suffix.lower() in DATA | IMAGES:
                found[name] = read_file(buffer, LARGEST - sum(map(len, found.values())))
        except (OSError, ValueError, RuntimeError):
            continue
    return found
