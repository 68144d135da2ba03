"""The meshes of a folder, the names of their results, and the hash of everything a mesh is read from."""

from __future__ import annotations

import contextlib
import hashlib
import json
import os
import re
from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from fnmatch import fnmatchcase
from pathlib import Path, PurePosixPath

from rlacd.errors import MeshFileError
from rlacd.io.read import READERS
from rlacd.io.read.beside import mesh_files
from rlacd.io.write.encode import GENERATOR
from rlacd.io.write.folder import listed_hulls

ENDINGS = tuple(f".{ending}" for ending in READERS)
"""File endings that count as meshes, in upper or lower case."""

ROBOTS = (".urdf", ".xml")
"""File endings of robots; an ``.xml`` is one only if it is MJCF."""

MANIFEST, TIMINGS = "manifest.jsonl", "timings.jsonl"
"""Files that a batch writes beside its results."""

EVERYTHING = "**"

HULLS = "_hulls"
"""Suffix that `rlacd decompose` gives a mesh's name for its hulls."""

_MARKS = f'"generator":"{GENERATOR}"', f"# {GENERATOR}", f"comment {GENERATOR}"
"""Marks within the first bytes of GLB, OBJ and PLY files that rlacd wrote."""

_MARK_BYTES = 128


@dataclass(frozen=True)
class Asset:
    """A mesh file."""

    name: str
    """Path relative to the folder of assets, with slashes."""
    path: Path
    """The file."""
    place: str
    """Name of its result, relative to the folder of results, without an ending."""
    around: Mapping[str, Sequence[str]] = field(default_factory=dict, compare=False, repr=False)
    """All files of the folder of assets, by the last part of their names."""

    def files(self) -> dict[str, bytes]:
        """Read every file the mesh depends on, by name relative to its folder; the mesh file comes first.

        For a robot these are all files of the batch's folder that have the name of one it refers to.

        Raises
        ------
        MeshFileError
            The mesh file cannot be opened.
        """
        files = mesh_files(self.path, self.name)
        if not self.is_robot:
            return files
        root = self.path.parents[self.name.count("/")]
        wanted, read = _names_in(files[self.path.name]), {self.name}
        while found := sorted({name for word in wanted for name in self.around.get(word, ())} - read):
            for name in filter(lambda name: (root / name).is_file(), found):
                content = mesh_files(root / name, name)
                files |= {f"{name}:{beside}": data for beside, data in content.items()}
                wanted |= _names_in(next(iter(content.values()))) if name.lower().endswith(ROBOTS) else set()
            read.update(found)
        return files

    def is_of(self, shard: tuple[int, int]) -> bool:
        """Whether it is of this one, from 1, of so many parts of the meshes, whichever other meshes there are."""
        return int(_digest(self.name), 16) % shard[1] == shard[0] - 1

    @property
    def is_robot(self) -> bool:
        """Whether it is a robot, whose collision meshes are replaced."""
        return self.path.suffix.lower() in ROBOTS


_REFERENCE = re.compile(rb"""\bfile(?:name)?\s*=\s*["'](?:[^"'<>]*[/\\\\])?([^"'<>/\\\\]+)["']""")


def _names_in(robot: bytes) -> set[str]:
    """The names, without folders, of all files that a robot refers to."""
    return {name.decode(errors="replace") for name in _REFERENCE.findall(robot)}


def content_hash(files: dict[str, bytes]) -> str:
    """SHA-256 of all contents and of all names but the first, which only tells the mesh's format."""
    digest = hashlib.sha256()
    for number, (name, content) in enumerate(files.items()):
        label = name if number else PurePosixPath(name).suffix.lower()
        digest.update(f"{len(content)} {json.dumps(label)}\n".encode())
        digest.update(content)
    return digest.hexdigest()


def find_assets(
    folder: Path, glob: str = EVERYTHING, leave_out: Path | None = None, ending: str = ".glb"
) -> list[Asset]:
    """List the meshes and robots of a folder of any depth, sorted by name.

    Parameters
    ----------
    folder : Path
        Folder to search. Hidden files and folders, links to folders, and files written by rlacd are skipped; links to
        files are followed.
    glob : str
        Pattern that selects meshes; see `matches`.
    leave_out : Path, optional
        A folder inside `folder` to skip, such as the folder of results.
    ending : str
        Ending of a mesh's result; empty for a folder.

    Raises
    ------
    MeshFileError
        `folder` does not exist or is not a folder, or a folder in it cannot be read.
    """
    return [asset for asset in scan(folder, leave_out, ending)[0] if matches(asset.name, glob)]


def scan(folder: Path, leave_out: Path | None, ending: str) -> tuple[list[Asset], dict[str, str]]:
    """As `find_assets`, and what the other files are, by name: their ending, or that rlacd wrote them."""
    if not folder.is_dir():
        raise MeshFileError(f"{folder} is not a folder; give the folder that holds the meshes.")
    skipped = None if leave_out is None else leave_out.resolve()
    names, others = [], dict[str, str]()
    around: dict[str, list[str]] = {}
    for at, folders, files in os.walk(folder, onerror=_refuse):
        here = Path(at)
        folders[:] = [f for f in folders if not f.startswith(".") and (here / f).resolve() != skipped]
        hulls = _written_hulls(here, files)
        for file in (file for file in files if not file.startswith(".")):
            path, kind = here / file, PurePosixPath(file).suffix.lower()
            name = path.relative_to(folder).as_posix()
            around.setdefault(file, []).append(name)
            if not (kind in (*ENDINGS, ".urdf") or (kind == ".xml" and _root(path) == "mujoco")):
                others[name] = kind or "no ending"
            elif file in hulls or _is_written(path):
                others[name] = "written by rlacd"
            else:
                names.append(name)
    # Results are named among all meshes of the folder, not only the selected ones: the same in every run.
    places = sorted(_places(names, ending).items())
    return [Asset(name, folder / name, place, around) for name, place in places], others


_COMMENT, _TAG = re.compile(rb"<!--.*?-->", re.DOTALL), re.compile(rb"<([A-Za-z_][\w.:-]*)")


def _root(path: Path) -> str:
    """The name of an XML file's root element; empty if none begins within its first 64 kB."""
    with contextlib.suppress(OSError), path.open("rb") as file:
        text = file.read(2**16).replace(b"\0", b"")  # also of UTF-16, which reading the robot refuses
        found = _TAG.search(_COMMENT.sub(b"", text))
        return found[1].decode() if found else ""
    return ""


def _written_hulls(folder: Path, files: Sequence[str]) -> set[str]:
    """Find what `rlacd decompose` wrote beside meshes: ``chair_hulls.glb`` for ``chair.obj``, and files it listed."""
    meshes = {PurePosixPath(file).stem for file in files if PurePosixPath(file).suffix.lower() in ENDINGS}
    beside = {
        file for file in files if (stem := PurePosixPath(file).stem).endswith(HULLS) and stem[: -len(HULLS)] in meshes
    }
    listings = [file for file in files if file.endswith(f"{HULLS}.json")]
    return beside.union(*(listed_hulls(folder / name, name.removesuffix(f"{HULLS}.json")) for name in listings))


def _is_written(path: Path) -> bool:
    """Whether a file says that rlacd wrote it: hulls, balls, models and their meshes, under any name."""
    if path.suffix.lower() in ROBOTS:  # the hulls of models and rewritten robots are listed in a folder beside them
        kind = "mjcf" if path.suffix.lower() == ".xml" else "urdf"
        return any(path.with_name(f"{path.stem}_{kind}").glob(f"*{HULLS}.json"))
    if path.is_file():  # what cannot be opened is reported when the mesh is read
        with contextlib.suppress(OSError), path.open("rb") as file:
            head = file.read(_MARK_BYTES).decode("latin-1")
            return any(mark in head for mark in _MARKS)
    return False


def _refuse(error: OSError) -> None:
    raise MeshFileError(f"{error.filename} cannot be read ({error.strerror}); check its permissions.") from error


def matches(name: str, glob: str) -> bool:
    """Whether a pattern fits the name if it holds a slash, else its last part; ``*`` matches slashes too."""
    pattern = glob.removeprefix("**/")  # subfolders are always searched
    return glob == EVERYTHING or fnmatchcase(name if "/" in pattern else PurePosixPath(name).name, pattern)


def _places(names: Iterable[str], ending: str) -> dict[str, str]:
    """Name results: without the mesh's ending, or with it where two names would clash (``a.obj`` and ``a.stl``).

    A result clashes too with a folder that another one lies in (``a.obj``, and ``b.obj`` in the folder ``a.glb``).
    Names that differ only in case clash, because some file systems ignore case. What the batch itself writes is avoided
    by an underscore in front.
    """
    places = {name: _free(str(PurePosixPath(name).with_suffix(""))) for name in names}
    while True:
        results = {name: (place + result_ending(name, ending)).casefold() for name, place in places.items()}
        count = Counter(results.values())
        folders = {str(parent).casefold() for place in places.values() for parent in PurePosixPath(place).parents}
        fuller = {
            name: _free(name) if places[name] != _free(name) else f"{name}-{_digest(name)[:8]}"
            for name, result in results.items()
            if count[result] > 1 or (result in folders and result_ending(name, ending))
        }
        if fuller.items() <= places.items():  # what still clashes is reported where it is written
            return places
        places |= fuller


def _digest(name: str) -> str:
    return hashlib.sha256(os.fsencode(name)).hexdigest()


def result_ending(name: str, ending: str) -> str:
    """Ending of an asset's result: robots keep theirs."""
    own = PurePosixPath(name).suffix.lower()
    return own if own in ROBOTS else ending


def _free(place: str) -> str:
    return f"_{place}" if place.partition("/")[0].casefold() in (MANIFEST, TIMINGS) else place
