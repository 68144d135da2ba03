"""The meshes of a folder, the names of their results, and the hash of everything a mesh is read from."""

from __future__ import annotations

import hashlib
import json
import os
from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from fnmatch import fnmatchcase
from pathlib import Path, PurePosixPath

from rlacd.errors import MeshFileError
from rlacd.io.read.companions import mesh_files
from rlacd.io.write.encode import GENERATOR
from rlacd.io.write.folder import listed_hulls

ENDINGS = (".obj", ".stl", ".ply", ".off", ".glb", ".gltf", ".vrm", ".dae", ".3mf", ".usd", ".usda", ".usdc", ".usdz")
"""File endings that count as meshes, in upper or lower case."""

EVERYTHING = "**"

HULLS = "_hulls"
"""What `rlacd decompose` appends to a mesh's name to name its hulls."""

# How files written by rlacd begin, within the first bytes.
_MARKS = {
    ".glb": f'"generator":"{GENERATOR}"'.encode(),
    ".obj": f"# {GENERATOR}".encode(),
    ".ply": f"comment {GENERATOR}".encode(),
}
_HEAD = 128


@dataclass(frozen=True)
class Asset:
    """A mesh file.

    Attributes
    ----------
    name
        Path relative to the folder of assets, with slashes.
    path
        The file.
    place
        Name of its result, relative to the folder of results, without an ending.
    """

    name: str
    path: Path
    place: str

    def files(self) -> dict[str, bytes]:
        """Read every file the mesh depends on, by name relative to its folder; the mesh file comes first.

        Raises
        ------
        MeshFileError
            The mesh file cannot be opened.
        """
        return mesh_files(self.path, self.name)


def content_hash(files: dict[str, bytes]) -> str:
    """SHA-256 of all contents and of all names but the first, which only tells the mesh's format."""
    digest = hashlib.sha256()
    for number, (name, content) in enumerate(files.items()):
        label = name if number else PurePosixPath(name).suffix.lower()
        digest.update(f"{len(content)} {json.dumps(label)}\n".encode())
        digest.update(content)
    return digest.hexdigest()


def find_assets(folder: Path, glob: str = EVERYTHING, leave_out: Path | None = None) -> list[Asset]:
    """List the meshes of a folder of any depth, sorted by name.

    Parameters
    ----------
    folder : Path
        Folder to search. Hidden files and folders, links to folders, and files written by rlacd are skipped; links to
        files are followed.
    glob : str
        Pattern to select meshes: matched against the name if it holds a slash, else against its last part. ``*``
        matches slashes too.
    leave_out : Path, optional
        A folder inside `folder` to skip, such as the folder of results.

    Raises
    ------
    MeshFileError
        `folder` does not exist or is not a folder, or a folder in it cannot be read.
    """
    if not folder.is_dir():
        raise MeshFileError(f"{folder} is not a folder; give the folder that holds the meshes.")
    # Names of results depend on all meshes of the folder, not only on the selected ones, so that a mesh's result has
    # the same name in every run.
    names = sorted(_names(folder, None if leave_out is None else leave_out.resolve()))
    places = _places(names)
    return [Asset(name, folder / name, places[name]) for name in names if _matches(name, glob)]


def _names(folder: Path, leave_out: Path | None) -> Iterator[str]:
    for at, folders, files in os.walk(folder, onerror=_refuse):
        here = Path(at)
        folders[:] = [f for f in folders if not f.startswith(".") and (here / f).resolve() != leave_out]
        hulls = _written_hulls(here, files)
        for file in files:
            if file.startswith(".") or PurePosixPath(file).suffix.lower() not in ENDINGS or file in hulls:
                continue
            if not _is_written(here / file):
                yield (here / file).relative_to(folder).as_posix()


def _written_hulls(folder: Path, files: Sequence[str]) -> set[str]:
    """Find what `rlacd decompose` wrote beside meshes: ``chair_hulls.glb`` for ``chair.obj``, and files it listed."""
    meshes = {PurePosixPath(file).stem for file in files if PurePosixPath(file).suffix.lower() in ENDINGS}
    beside = {
        file for file in files if (stem := PurePosixPath(file).stem).endswith(HULLS) and stem[: -len(HULLS)] in meshes
    }
    listings = [file for file in files if file.endswith(f"{HULLS}.json")]
    return beside.union(*(listed_hulls(folder / name, name.removesuffix(f"{HULLS}.json")) for name in listings))


def _is_written(path: Path) -> bool:
    """Whether a file says that rlacd wrote it: hulls, balls, and meshes of models, under any name."""
    mark = _MARKS.get(path.suffix.lower())
    if mark is None or not path.is_file():
        return False
    try:
        with path.open("rb") as file:
            return mark in file.read(_HEAD)
    except OSError:  # reported when the mesh is read
        return False


def _refuse(error: OSError) -> None:
    raise MeshFileError(f"{error.filename} cannot be read ({error.strerror}); check its permissions.") from error


def _matches(name: str, glob: str) -> bool:
    if glob == EVERYTHING:
        return True
    pattern = glob.removeprefix("**/")  # subfolders are always searched
    return fnmatchcase(name if "/" in pattern else PurePosixPath(name).name, pattern)


def _places(names: Sequence[str]) -> dict[str, str]:
    """Name results: without the mesh's ending, or with it where two names would clash (``a.obj`` and ``a.stl``).

    Names that differ only in case clash too, because some file systems ignore case.
    """
    places = {name: str(PurePosixPath(name).with_suffix("")) for name in names}
    while True:
        count = Counter(place.casefold() for place in places.values())
        shared = [name for name in names if count[places[name].casefold()] > 1]
        fuller = {name: name if places[name] != name else f"{name}-{_digest(name)}" for name in shared}
        if not shared:
            return places
        places |= fuller


def _digest(name: str) -> str:
    return hashlib.sha256(os.fsencode(name)).hexdigest()[:8]
