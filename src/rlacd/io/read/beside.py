"""Files beside a mesh that it refers to: only those of its own folder."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any
from urllib.parse import unquote

from trimesh.resolvers import Resolver

from rlacd.io.read.open_file import LARGEST, read_file

DATA = frozenset({".bin"})
"""To read triangles: no colours, and no images, whose decoders are the riskier part of any loader."""

IMAGES = frozenset({".png", ".jpg", ".jpeg", ".webp", ".ktx2", ".dds"})
"""Copied, never decoded."""

PICTURES = frozenset({".mtl", ".png", ".jpg", ".jpeg", ".bmp", ".tga", ".tif", ".tiff", ".gif", ".webp"})
"""Materials, and pictures that are decoded: read only for files that keep them."""


class FolderFiles(Resolver):  # type: ignore[misc]
    """Serves files of one folder only.

    A name that leads out of the folder, by ``..``, an absolute path or a link, counts as missing; so does a file whose
    name ends in none of `endings`.
    """

    def __init__(self, folder: Path, endings: frozenset[str] = DATA) -> None:
        self._folder = folder.resolve()
        self._endings = endings
        self._read: dict[Path, bytes] = {}

    def get(self, name: str) -> bytes:
        """Return the content of a file in the folder, cached, since a file may be named any number of times.

        Raises
        ------
        FileNotFoundError
            There is no such file, or it may not be read.
        """
        for spelled in dict.fromkeys((name, unquote(name))):
            try:
                path = (self._folder / spelled.strip()).resolve()
                if path.suffix.lower() not in self._endings or not path.is_relative_to(self._folder):
                    continue
                if path not in self._read:
                    self._read[path] = read_file(path, LARGEST - sum(map(len, self._read.values())))
            except (OSError, ValueError, RuntimeError):  # a name with a NUL, circular links
                continue
            return self._read[path]
        raise FileNotFoundError(f"{name!r:.200} is not a data file beside the mesh")

    def write(self, name: str, data: Any) -> None:
        """Refuse: loading writes nothing."""
        raise PermissionError(name)

    def namespaced(self, namespace: str) -> FolderFiles:
        """Stay in the same folder."""
        raise FileNotFoundError(namespace)

    def keys(self) -> Iterator[str]:
        """List nothing: files are asked for by name."""
        return iter(())
