"""The meshes of a folder: which there are, what their results are called, and the hash of all a mesh is read from."""

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
from rlacd.io.write.folder import listed_hulls

ENDINGS = (".obj", ".stl", ".ply", ".off", ".glb", ".gltf", ".dae", ".3mf")
"""Of the files that count as meshes, whatever their case."""

EVERYTHING = "**"

HULLS = "_hulls"
"""What `rlacd decompose` adds to the name of a mesh for that of its hulls."""


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
        What its result is called, relative to the folder of results, without an ending.
    """

    name: str
    path: Path
    place: str

    def files(self) -> dict[str, bytes]:
        """Read everything the mesh is read from, by name relative to its folder; its own file comes first.

        Raises
        ------
        MeshFileError
            The mesh file cannot be opened.
        """
        return mesh_files(self.path, self.name)


def content_hash(files: dict[str, bytes]) -> str:
    """SHA-256 over contents and the names of all but the first, which says nothing about the mesh but its format."""
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
        Hidden files and folders in it are passed over, and so are links to folders and hulls that `rlacd decompose` has
        written there; links to files are followed.
    glob : str
        Which of them: compared with the name if it holds a slash, else with its last part. ``*`` takes slashes too.
    leave_out : Path, optional
        A folder in it that is passed over: the results may lie there.

    Raises
    ------
    MeshFileError
        `folder` is not there or no folder, or one in it cannot be looked into.
    """
    if not folder.is_dir():
        raise MeshFileError(f"{folder} is no folder; give the folder that holds the meshes.")
    # Results are named with an eye on all meshes, not only those asked for: what a mesh's result is called must not
    # depend on which others are done in the same run.
    names = sorted(_names(folder, None if leave_out is None else leave_out.resolve()))
    places = _places(names)
    return [Asset(name, folder / name, places[name]) for name in names if _matches(name, glob)]


def _names(folder: Path, leave_out: Path | None) -> Iterator[str]:
    for at, folders, files in os.walk(folder, onerror=_refuse):
        here = Path(at)
        folders[:] = [f for f in folders if not f.startswith(".") and (here / f).resolve() != leave_out]
        hulls = _written_hulls(here, files)
        for file in files:
            if not file.startswith(".") and PurePosixPath(file).suffix.lower() in ENDINGS and file not in hulls:
                yield (here / file).relative_to(folder).as_posix()


def _written_hulls(folder: Path, files: Sequence[str]) -> set[str]:
    """Files that `rlacd decompose` wrote beside meshes: ``chair_hulls.glb`` of ``chair.obj``, and those it listed."""
    meshes = {PurePosixPath(file).stem for file in files if PurePosixPath(file).suffix.lower() in ENDINGS}
    beside = {
        file for file in files if (stem := PurePosixPath(file).stem).endswith(HULLS) and stem[: -len(HULLS)] in meshes
    }
    listings = [file for file in files if file.endswith(f"{HULLS}.json")]
    return beside.union(*(listed_hulls(folder / name, name.removesuffix(f"{HULLS}.json")) for name in listings))


def _refuse(error: OSError) -> None:
    raise MeshFileError(f"{error.filename} cannot be looked into ({error.strerror}); check its permissions.") from error


def _matches(name: str, glob: str) -> bool:
    if glob == EVERYTHING:
        return True
    pattern = glob.removeprefix("**/")  # folders of any depth are looked through anyway
    return fnmatchcase(name if "/" in pattern else PurePosixPath(name).name, pattern)


def _places(names: Sequence[str]) -> dict[str, str]:
    """Name results: without the mesh's ending, or with it where two would be the same (``a.obj`` and ``a.stl``).

    Upper and lower case count as the same: there are disks on which they are.
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
