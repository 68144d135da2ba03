"""The solids of a training: a folder of meshes, split into training and held-out ones, each repaired once."""

from __future__ import annotations

import dataclasses
import hashlib
import json
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from types import MappingProxyType
from typing import Any

import numpy as np
from manifold3d import Manifold, Mesh64
from numpy.typing import NDArray

from rlacd.errors import RlacdError, TrainingError
from rlacd.io.read import READERS
from rlacd.io.read.load import load_mesh
from rlacd.io.write.atomic import write_file
from rlacd.learn.checkpoint import packed, unpacked
from rlacd.repair.repair import repair
from rlacd.solid.component import Component
from rlacd.solid.frame import Frame

ENDINGS = frozenset(f".{ending}" for ending in READERS)

TURNS = (0.0, 45.0, 90.0, 180.0)
"""Degrees about one axis: the paper's augmentation."""


@dataclass(frozen=True)
class MeshList:
    """The meshes of a folder, by their paths in it, and how many files were skipped."""

    training: tuple[str, ...]
    validation: tuple[str, ...]
    unreadable: int
    too_large: int


def list_meshes(folder: Path, max_faces: int, validation: int, held_out: str, seed: int) -> MeshList:
    """Find the meshes below a folder; `validation` of them, at most half, are chosen by the seed and held out.

    With a folder in it, `held_out`, those are chosen there, and its other meshes are not learned from either.

    Raises
    ------
    TrainingError
        No meshes are left for training, or none are in `held_out`.
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
    drawn = [names[i] for i in np.random.default_rng(seed).permutation(len(names))]
    inside = [name for name in drawn if name.startswith(f"{held_out.rstrip('/')}/")] if held_out else drawn
    chosen = inside[: validation if held_out else min(validation, len(names) // 2)]
    training = sorted({*names} - {*(inside if held_out else chosen)})
    left_out = f"{unreadable} cannot be read, {too_large} have more than {max_faces} triangles"
    for kind, found in (("meshes to learn on", training), (f"meshes in {held_out} to hold out", inside)):
        if not found:
            raise TrainingError(f"{folder} holds no {kind} ({left_out}); give another folder.")
    return MeshList(tuple(training), tuple(sorted(chosen)), unreadable, too_large)


def list_once(meshes: Path, run: Path, *how: Any) -> MeshList:
    """`list_meshes` at the start of a run; resumed runs read that list, so that new files change nothing.

    Raises
    ------
    TrainingError
        There is no such folder, nothing in it to train on, or not what the run began with.
    """
    kept = run / "meshes.json"
    if not meshes.is_dir():
        raise TrainingError(f"there is no folder {meshes}; give one that holds meshes.")
    if kept.exists():
        listed = json.loads(kept.read_text(encoding="utf-8"))
        names = listed.pop("training"), listed.pop("validation")
        missing = [name for name in (*names[0], *names[1]) if not (meshes / name).is_file()]
        if missing:
            raise TrainingError(f"{meshes} lacks {missing[0]}, which the run began with; give the same folder.")
        return MeshList(tuple(names[0]), tuple(names[1]), **listed)
    found = list_meshes(meshes, *how)
    run.mkdir(parents=True, exist_ok=True)
    kept.write_text(json.dumps(dataclasses.asdict(found), indent=1), encoding="utf-8")
    return found


def turned(content: bytes, axis: int, degrees: float) -> Component | None:
    """Turn the solid of `Solids.packed` about a coordinate axis, in its frame; None if it could not be repaired."""
    arrays = unpacked(content)
    if not len(arrays["faces"]):
        return None
    solid = Manifold(Mesh64(arrays["vertices"], arrays["faces"]))
    if degrees:
        solid = solid.rotate([degrees if i == axis else 0.0 for i in range(3)])
        frame = Frame.of(np.asarray(solid.bounding_box(), dtype=np.float64).reshape(2, 3))
        solid = solid.translate([float(-x) for x in frame.center]).scale([frame.scale] * 3)
    return Component(solid)


NOTHING: Mapping[str, NDArray[Any]] = MappingProxyType(
    {"vertices": np.empty((0, 3)), "faces": np.empty((0, 3), np.uint64)}
)
"""Arrays of no solid."""


class Solids:
    """Solids of a folder's meshes by name, each repaired once; the folder `cache` is this class's own.

    `say` is told of a file that cannot be read, which is tried again the next time.
    """

    def __init__(self, folder: Path, cache: Path, say: Callable[[str], None] = print) -> None:
        self._folder, self._cache, self._say = folder, cache, say

    def get(self, name: str) -> Component | None:
        """Get a solid in its frame; None if it cannot be repaired."""
        return turned(self.packed(name), 0, 0.0)

    def packed(self, name: str) -> bytes:
        """Get the arrays of a solid, for `turned` on any machine; empty ones if it cannot be read or repaired."""
        place = self._cache / f"{hashlib.sha256(name.encode()).hexdigest()[:24]}.npz"
        if place.exists():
            return place.read_bytes()
        try:
            mesh = load_mesh(self._folder / name)
        except RlacdError as error:
            self._say(f"{name} is left out this time: {error}")
            return packed(NOTHING)
        try:
            solid = repair(mesh, threads=1)
            Component(solid.shape)
            arrays: Mapping[str, NDArray[Any]] = {"vertices": solid.vertices, "faces": solid.faces.astype(np.uint64)}
        except (RlacdError, ValueError):  # flat or empty: nothing to cut
            arrays = NOTHING
        content = packed(arrays)
        write_file(place, content)
        return content
