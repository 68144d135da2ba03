"""Resolving the file references of a robot description: relative paths, ``package://`` and ``file://``.

A description is untrusted. It may refer only to files in its own package (the nearest folder above it with a
``package.xml``, else the parent of its folder, since most keep meshes in ``../meshes``), in the packages it refers to,
and in the folders the user allows. Links are followed: ROS workspaces consist of them. One that was uploaded to the
viewer is alone in its folder, and refers to nothing above that.
"""

from __future__ import annotations

import os
from collections.abc import Iterator, Sequence
from contextlib import suppress
from pathlib import Path
from urllib.parse import unquote, urlsplit

from rlacd.errors import MeshFileError, OptionError
from rlacd.io.read.open_file import UPLOAD, read_file
from rlacd.io.read.xml import parse_xml
from rlacd.io.robots.spans import LARGEST_DESCRIPTION

PACKAGE_SCHEMES = ("package", "model")


class References:
    """Finds the files that a robot description refers to.

    Parameters
    ----------
    robot : Path
        The description.
    package_dirs : sequence of str
        ``NAME=PATH`` says where a package is; ``PATH`` alone is a folder that may be read and may hold packages.

    Raises
    ------
    OptionError
        A folder does not exist.
    """

    def __init__(self, robot: Path, package_dirs: Sequence[str] = ()) -> None:
        self._robot = Path(os.path.abspath(robot))
        self._named: dict[str, Path] = {}
        self._allowed: list[Path] = []
        for given in package_dirs:
            name, equals, folder = str(given).rpartition("=")
            place = Path(os.path.abspath(folder))
            if not place.is_dir():
                raise OptionError(f"the package folder {folder} does not exist; give NAME=FOLDER or FOLDER.")
            self._allowed.append(place)
            if equals:
                self._named[name] = place
        self._above = [*self._robot.parents]
        if self._robot.parent.name.startswith(UPLOAD):
            self._above = [self._robot.parent]
        package = (folder for folder in self._above if (folder / "package.xml").is_file())
        self.root = next(package, self._above[:2][-1])
        self._allowed.append(self.root)

    def find(self, reference: str, folder: Path) -> Path:
        """Return the file that `reference` means in a description whose relative paths start at `folder`.

        Raises
        ------
        MeshFileError
            There is no such file or package, or it lies outside what the description may refer to.
        """
        package = self.package_of(reference)
        base, rest = package or folder, reference.replace("\\", "/")
        if "://" in reference:
            parts = urlsplit(reference)
            rest = unquote(parts.path).lstrip("/") if package else unquote(parts.netloc + parts.path)
            if package is None and parts.scheme != "file":
                raise MeshFileError(f"{self._robot} refers to {reference}, which is not on this disk: download it.")
        if "\0" in rest:
            raise MeshFileError(f"{self._robot} refers to {reference!r}, which is not a file name.")
        place = Path(os.path.abspath(base / rest))
        if not any(place.is_relative_to(allowed) for allowed in ([package] if package else self._allowed)):
            said = f"{self._robot} refers to {reference}, outside of {package or self.root}"
            raise MeshFileError(f"{said}: give --package-dir with a folder that holds it if you trust the file.")
        if not place.is_file():
            raise MeshFileError(f"{self._robot} refers to {reference}, but {place} does not exist.")
        return place

    def package_of(self, reference: str) -> Path | None:
        """Return the folder of the package in ``package://NAME/...``; None for any other reference.

        Raises
        ------
        MeshFileError
            It is not found.
        """
        if "://" not in reference or urlsplit(reference).scheme not in PACKAGE_SCHEMES:
            return None
        name = reference.split("://", 1)[1].split("/", 1)[0]
        if not name:
            raise MeshFileError(
                f"{self._robot} refers to {reference}, which names no package: package://NAME/FILE does."
            )
        if name in self._named:
            return self._named[name]
        if name.strip(". ") and not set(name) & {"\\", "\0"}:
            for folder in self._candidates(name):
                if folder.is_dir():
                    return folder
        raise MeshFileError(
            f"{self._robot} needs the package {name}, which was not found: give --package-dir {name}=FOLDER."
        )

    def _candidates(self, name: str) -> Iterator[Path]:
        """Candidate folders of a package, likeliest first: above the file, beside those folders, in ROS paths."""
        for folder in self._above:
            if folder.name == name or _package_name(folder) == name:
                yield folder
            elif (folder / name / "package.xml").is_file() or folder.is_relative_to(self.root):
                yield folder / name  # some treat any folder beside the file as a package
        yield from (folder / name for folder in self._allowed[:-1])
        for path in _paths("AMENT_PREFIX_PATH"):
            yield path / "share" / name
        for path in _paths("ROS_PACKAGE_PATH"):
            yield path if path.name == name else path / name


def seen_from(folder: Path, path: Path) -> str:
    """The name of a file relative to a folder; absolute where links or drives make that another file."""
    there, name = os.path.abspath(folder), os.path.abspath(path)
    with suppress(ValueError):  # another drive
        relative = os.path.relpath(name, there)
        if os.path.realpath(os.path.join(there, relative)) == os.path.realpath(name):
            name = relative
    return Path(name).as_posix()


def _package_name(folder: Path) -> str | None:
    place = folder / "package.xml"
    try:
        package = parse_xml(place, read_file(place, LARGEST_DESCRIPTION))
    except Exception:  # parsers may raise anything; a file that cannot be read names no package
        return None
    return str(package.xpath("string(/package/name)")).strip()


def _paths(variable: str) -> list[Path]:
    return [Path(part) for part in os.environ.get(variable, "").split(os.pathsep) if part]
