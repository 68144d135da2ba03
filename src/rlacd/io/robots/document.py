"""Robots that are XML files, URDF and MJCF: meshes read once, hulls in a folder beside the file, bytes kept."""

from __future__ import annotations

import os
from abc import abstractmethod
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

from rlacd.clear import LinkPair, Motion, Solids
from rlacd.errors import MeshFileError
from rlacd.io.read.load import load_mesh
from rlacd.io.read.open_file import read_named
from rlacd.io.robots.references import References
from rlacd.io.robots.robot import Collider, MeshFile, Results, Robot, Written
from rlacd.io.robots.spans import LARGEST_DESCRIPTION, Edit, Element, edited, parse
from rlacd.io.write import file_stem, write_file
from rlacd.io.write.encode import encode_plain_obj
from rlacd.io.write.folder import check_names, write_folder
from rlacd.io.write.target import mesh_folder
from rlacd.options.robots import RobotOptions

HullFiles = Mapping[Collider, Sequence[str]]
"""The names of the files of each collider's hulls."""


@dataclass
class Files:
    """The files that a description refers to, each read once."""

    references: References
    said: list[tuple[Path, str]] = field(default_factory=list)  # a file, and a sentence about it
    _known: dict[Path, MeshFile] = field(default_factory=dict)

    def mesh(self, reference: str, folder: Path) -> MeshFile:
        """Read a mesh file, in the unit that a COLLADA file states: ROS, Gazebo and Bullet apply it.

        Whether such a file whose y axis points up is turned differs between them, so that is a warning.
        """
        path = self.references.find(reference, folder)
        if path not in self._known:
            mesh, unit = load_mesh(path), 1.0
            self.said += [(path, warning) for warning in mesh.warnings]
            if path.suffix.lower() == ".dae":
                unit = mesh.metres or 1.0
                if mesh.up != "z":
                    turned = f"{mesh.up.upper()}_UP is declared, and some programs rotate such a file when they read it"
                    self.said.append((path, f"{turned}; hulls keep its coordinates."))
            self._known[path] = MeshFile(path, mesh.vertices * unit, mesh.faces)
        return self._known[path]


@dataclass(frozen=True, eq=False)
class Document(Robot):
    """A robot whose file is XML."""

    root: Element
    references: References
    seen: Sequence[Element] = field(default=(), kw_only=True)  # primitives that are shown, and are to collide too
    bare: frozenset[str] = field(default=frozenset(), kw_only=True)  # bodies that collide as what they show

    kind = ""

    @property
    def is_alone(self) -> bool:
        """See `Robot`; bodies with primitives only count too."""
        links = (each for each in self.root.walk() if each.tag in ("link", "body"))
        count = sum(any(link.named("collision", "geom", "frame")) for link in links)
        return not self.bodies or max(count, len(self.bodies)) < 2

    def elsewhere(self, place: Path) -> Path | None:
        """The folder of a result that is not that of the file: names of files are then as seen from there."""
        folder = place.absolute().parent
        return None if os.path.realpath(folder) == os.path.realpath(self.root.file.folder) else folder

    @abstractmethod
    def edits(
        self, place: Path, folder: Path, hulls: HullFiles, copies: Mapping[Path, str], said: list[str]
    ) -> list[Edit]:
        """The edits of the file and of those it includes, for a result at `place` with its hulls in a folder.

        `copies` of meshes that the consumer cannot read are named by their paths; what is to be said is added.
        """

    def with_seen(self, motion: Motion) -> Motion:
        """A motion that was read without what bodies are to collide as, with it."""
        if not self.bare:
            return motion
        own = [
            Solids(body.primitives, sum(len(collider.meshes) for collider in body.colliders))
            if body.name in self.bare
            else solids
            for body, solids in zip(self.bodies, motion.solids, strict=False)
        ]
        return replace(motion, solids=(*own, *motion.solids[len(own) :]))

    def copied(self, stem: str) -> dict[MeshFile, str]:
        """Names for copies of the meshes that consumers cannot read."""
        return {}

    def paired(self, pairs: Sequence[LinkPair], asked: RobotOptions, said: list[str]) -> list[Edit]:
        """Write what pairs of links do where that is asked; in the file itself by edits."""
        return []

    def write(
        self, place: Path, results: Results, pairs: Sequence[LinkPair] | None, asked: RobotOptions, *, whole: bool
    ) -> Written:
        """See `Robot`."""
        folder, stem, said = mesh_folder(place, self.kind), file_stem(place.stem), list[str]()
        last = place if self.home is None else self.home / place.name
        files, names = _hull_files(stem, results)
        copies = self.copied(stem)
        files |= {name: encode_plain_obj(mesh) for mesh, name in copies.items()}
        named = {mesh.path: name for mesh, name in copies.items()}
        edits = self.edits(last, mesh_folder(last, self.kind), names, named, said)
        if pairs is not None:
            edits += self.paired(pairs, asked, said)
        data = edited(self.root, edits)
        check_names(folder, stem, list(files))
        write_folder(folder, stem, files, then=lambda: write_file(place, data))
        return Written(folder, names, said)


def opened(source: Path, tag: str) -> Element:
    """The root of a robot file.

    Raises
    ------
    MeshFileError
        It cannot be read, or is of another kind.
    """
    root = parse(source, read_named(source, LARGEST_DESCRIPTION))
    if root.tag != tag:
        kind = {"robot": "URDF", "mujoco": "MJCF"}[tag]
        raise MeshFileError(f"{source} is not {kind}: it starts with <{root.tag}>, not <{tag}>.")
    return root


def _hull_files(stem: str, results: Results) -> tuple[dict[str, bytes], dict[Collider, list[str]]]:
    """The files of all hulls, and the names of each collider's; what is the same is written once."""
    files: dict[str, bytes] = {}
    names: dict[Collider, list[str]] = {}
    done: dict[Any, list[str]] = {}
    taken: set[str] = set()
    for collider, result in results.items():
        key = id(result), collider.meshes[0].key
        if key not in done:
            name = unused_stem(collider.name, taken)
            done[key] = [f"{stem}_{name}_{i:03d}.obj" for i in range(len(result))]
            files |= {at: encode_plain_obj(collider.in_file(h)) for at, h in zip(done[key], result, strict=True)}
        names[collider] = done[key]
    return files, names


def unused_stem(name: str, taken: set[str]) -> str:
    """A name for files; one that would collide on any file system gets a number."""
    plain = stem = file_stem(name)
    number = 1
    while stem.lower() in taken:
        number += 1
        stem = f"{plain}_{number}"
    taken.add(stem.lower())
    return stem
