"""The solids of a training: a folder of meshes, split into training and held-out ones, each repaired once."""

from __future__ import annotations

import dataclasses
import hashlib
import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
from manifold3d import Manifold, Mesh64
from numpy.typing import NDArray

from rlacd.errors import MeshFileError, RlacdError, TrainingError
from rlacd.io.read.beside import lay_out, mesh_files
from rlacd.io.read.load import load_mesh
from rlacd.learn.files import packed, save_bytes, unpacked
from rlacd.repair.repair import repair
from rlacd.solid.arrays import FloatArray
from rlacd.solid.component import Component
from rlacd.solid.frame import Frame

ENDINGS = frozenset({".ply", ".obj", ".stl", ".off", ".glb", ".gltf", ".dae", ".3mf"})

TURNS = (0.0, 45.0, 90.0, 180.0)
"""Degrees about one axis: the paper's augmentation."""


@dataclass(frozen=True)
class MeshList:
    """The meshes of a folder.

    Attributes
    ----------
    training, validation : tuple of str
        Paths relative to the folder.
    unreadable, too_large : int
        Number of files skipped.
    """

    training: tuple[str, ...]
    validation: tuple[str, ...]
    unreadable: int
    too_large: int


def list_meshes(folder: Path, max_faces: int, validation: int, seed: int) -> MeshList:
    """Find the meshes below a folder; `validation` of them, chosen by the seed, are held out.

    Raises
    ------
    TrainingError
        No meshes are left for training.
    """
    names, unreadable, too_large = [], 0, 0
    for path in sorted(p for p in folder.rglob("*") if p.suffix.lower() in ENDINGS and p.is_file()):
        try:
            faces = len(load_mesh(path).faces)
        except RlacdError:
            unreadable += 1
            continue
        if faces > max_faces:
            too_large += 1
        else:
            names.append(path.relative_to(folder).as_posix())
    if len(names) <= validation:
        raise TrainingError(
            f"{folder} holds {len(names)} meshes to learn on ({unreadable} cannot be read, {too_large} have more than "
            f"{max_faces} triangles); more than {validation} are needed, since that many are held out for validation."
        )
    drawn = shuffled(names, seed)
    return MeshList(tuple(sorted(drawn[validation:])), tuple(sorted(drawn[:validation])), unreadable, too_large)


def list_once(meshes: Path, run: Path, max_faces: int, validation: int, seed: int) -> MeshList:
    """List the meshes at the start of a run; resumed runs read that list, so that new files change nothing.

    Raises
    ------
    TrainingError
        There is no such folder, or nothing in it to train on.
    """
    kept = run / "meshes.json"
    if kept.exists():
        listed = json.loads(kept.read_text(encoding="utf-8"))
        return MeshList(tuple(listed.pop("training")), tuple(listed.pop("validation")), **listed)
    if not meshes.is_dir():
        raise TrainingError(f"there is no folder {meshes}; give one that holds meshes.")
    found = list_meshes(meshes, max_faces, validation, seed)
    run.mkdir(parents=True, exist_ok=True)
    kept.write_text(json.dumps(dataclasses.asdict(found), indent=1), encoding="utf-8")
    return found


def shuffled(names: Sequence[str], seed: int) -> list[str]:
    """Shuffle names by the seed alone."""
    return [names[i] for i in np.random.default_rng(seed).permutation(len(names))]


NOTHING = np.empty((0, 3)), np.empty((0, 3), dtype=np.uint64)
"""Vertices and faces that stand for a failed repair."""

SOLID = "solid.npz"
"""Name of a repaired solid among the blobs of a request and of its answer."""


def repaired(path: Path) -> bytes:
    """Repair a mesh and pack it for `unpack_solid`."""
    try:
        solid = repair(load_mesh(path), threads=1)
        Component(solid.shape)
    except (RlacdError, ValueError):  # flat or empty: nothing to cut
        return pack_solid(*NOTHING)
    return pack_solid(solid.vertices, solid.faces.astype(np.uint64))


def pack_solid(vertices: FloatArray, faces: NDArray[np.uint64]) -> bytes:
    """Pack a solid for `unpack_solid`."""
    return packed({"vertices": vertices, "faces": faces})


def unpack_solid(content: bytes) -> Manifold | None:
    """Unpack a solid; None if it could not be repaired."""
    arrays = unpacked(content)
    return Manifold(Mesh64(arrays["vertices"], arrays["faces"])) if len(arrays["faces"]) else None


def take_solid(blobs: Mapping[str, bytes], staging: Path) -> tuple[Manifold | None, dict[str, bytes]]:
    """Return the solid of a request (see `Solids.files`), and the blobs for the answer: `SOLID` if it is new.

    Parameters
    ----------
    blobs : mapping of bytes
        The repaired solid, or the files of a mesh.
    staging : Path
        A folder for temporary files.
    """
    if SOLID in blobs:
        return unpack_solid(blobs[SOLID]), {}
    with TemporaryDirectory(dir=staging) as folder:
        solid = repaired(lay_out(blobs, Path(folder)))
    return unpack_solid(solid), {SOLID: solid}


def turned(solid: Manifold, axis: int, degrees: float) -> Component:
    """Turn a solid about a coordinate axis, and move it to its frame."""
    return Component(_framed(solid.rotate([degrees if i == axis else 0.0 for i in range(3)])) if degrees else solid)


class Solids:
    """Repaired solids by name, read from the cache folder, or repaired and stored there.

    Parameters
    ----------
    folder : Path
        Folder of the meshes.
    cache : Path, optional
        A folder used by this class only; several processes may share it. By default solids are kept in memory only.
    """

    def __init__(self, folder: Path, cache: Path | None = None) -> None:
        self._folder = folder
        self._cache = cache
        self._held: dict[str, Manifold | None] = {}
        if cache is not None:
            cache.mkdir(parents=True, exist_ok=True)

    def get(self, name: str, axis: int = 0, degrees: float = 0.0) -> Component | None:
        """Return a solid turned about a coordinate axis, in its frame; None if it cannot be repaired."""
        solid = self.manifold(name)
        return None if solid is None else turned(solid, axis, degrees)

    def manifold(self, name: str) -> Manifold | None:
        """Return a solid as in its file; None if it cannot be repaired."""
        if name not in self._held:
            kept = self._kept(name)
            if kept is None:
                kept = repaired(self._folder / name)
                self.keep(name, kept)
            self._held[name] = unpack_solid(kept)
        return self._held[name]

    def files(self, name: str) -> dict[str, bytes]:
        """Return what another machine needs to get the solid: the solid itself (`SOLID`), or the files of the mesh."""
        kept = self._kept(name)
        try:
            return mesh_files(self._folder / name) if kept is None else {SOLID: kept}
        except MeshFileError:
            return {SOLID: pack_solid(*NOTHING)}

    def keep(self, name: str, content: bytes) -> None:
        """Store the result of `repaired` in the cache."""
        if (place := self._place(name)) is not None:
            save_bytes(place, content)

    def _kept(self, name: str) -> bytes | None:
        place = self._place(name)
        return place.read_bytes() if place is not None and place.exists() else None

    def _place(self, name: str) -> Path | None:
        digest = hashlib.sha256(name.encode()).hexdigest()[:24]
        return None if self._cache is None else self._cache / f"{digest}.npz"


def _framed(solid: Manifold) -> Manifold:
    """Move and scale a solid so that its box is centred and its longest side is 2."""
    box = np.asarray(solid.bounding_box(), dtype=np.float64).reshape(2, 3)
    frame = Frame.of(box)
    return solid.translate([float(-x) for x in frame.center]).scale([frame.scale] * 3)
