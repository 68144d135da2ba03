"""USD stages: every mesh that collides gets convex hulls, in a layer over the original, which stays as it is."""

from __future__ import annotations

import os
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import trimesh

from rlacd.decomposition import Decomposition
from rlacd.io.read.apart import answer_of
from rlacd.io.write.single_precision import required_hull
from rlacd.io.write.usd import require_usd

ENDINGS = (".usd", ".usda", ".usdc")
"""Of stages that are rewritten."""

SERVER = "rlacd.io.robots.usd_layer:rewrite"


@dataclass(frozen=True, eq=False)
class Colliders:
    """The meshes of a stage that collide, by the schemas of UsdPhysics.

    Attributes
    ----------
    source
        The stage.
    nodes
        For each its ``path``, and its ``scale`` [3] on the stage.
    blobs
        ``INDEX.points`` and ``INDEX.faces`` of each.
    warnings
        What of the stage is not rewritten, or changes with it.
    """

    source: Path
    nodes: list[Mapping[str, Any]]
    blobs: Mapping[str, bytes]
    warnings: list[str]


def read_colliders(stage: Path) -> Colliders:
    """Find the meshes of a stage that collide.

    Raises
    ------
    MeshFileError
        It cannot be read.
    MissingExtraError
        The extra ``usd`` is not installed.
    """
    require_usd()
    answer = answer_of(SERVER, stage, "USD", {"path": str(stage)}, {})
    return Colliders(stage, answer.values["nodes"], answer.blobs, answer.values["warnings"])


def colliders_of(mesh: Path) -> Colliders | None:
    """Find them as `read_colliders` does; None if the file is no stage, or nothing of it collides."""
    found = read_colliders(mesh) if mesh.suffix.lower() in ENDINGS else None
    return found if found is not None and found.nodes else None


def encode_layer(
    stage: Colliders, place: Path, decomposed: Callable[[trimesh.Trimesh], Decomposition], *, flat: bool
) -> tuple[bytes, dict[str, Decomposition], list[str], list[str]]:
    """Decompose the meshes that collide, each once at its scale.

    Parameters
    ----------
    stage : Colliders
    place : Path
        Where the layer will be.
    decomposed : callable
        Decomposes a mesh, in the stage's unit.
    flat : bool
        Whether to write the whole stage as one layer, instead of one over the original; it names pictures and other
        files as before, relative to the folder of the original.

    Returns
    -------
    tuple of (bytes, dict, list of str, list of str)
        The layer, the result of each prim, warnings, and the other files that `flat` names.
    """
    blobs, warnings = stage.blobs, list(stage.warnings)
    results: dict[tuple[bytes, bytes, tuple[float, ...]], Decomposition] = {}
    hulls: dict[str, bytes] = {}
    done: dict[str, Decomposition] = {}
    for index, node in enumerate(stage.nodes):
        points, faces, scale = blobs[f"{index}.points"], blobs[f"{index}.faces"], np.array(node["scale"])
        key = points, faces, tuple(node["scale"])
        if key not in results:
            corners = np.frombuffer(points).reshape(-1, 3) * scale
            triangles = np.frombuffer(faces, dtype=np.int64).reshape(-1, 3)
            results[key] = decomposed(trimesh.Trimesh(corners, triangles, process=False))
            warnings += [f"{node['path']}: {warning}" for warning in results[key].report["warnings"]]
        for number, hull in enumerate(results[key].hulls):
            mesh, shift = required_hull(hull, node["path"], "as USD")
            hulls[f"{index}.{number}.points"] = ((mesh.vertices + shift) / scale).astype("<f4").tobytes()
            hulls[f"{index}.{number}.faces"] = np.asarray(mesh.faces, dtype="<i4").tobytes()
        done[node["path"]] = results[key]
    sublayer = None if flat else Path(os.path.relpath(stage.source, place.absolute().parent)).as_posix()
    masses = {path: result.report.get("mass") for path, result in done.items()}
    asked = {"path": str(stage.source), "sublayer": sublayer, "ending": place.suffix.lower().lstrip(".")}
    how = {"masses": masses, "counts": [*map(len, done.values())]}
    answer = answer_of(SERVER, stage.source, "USD", {**asked, **how}, hulls)
    return answer.blobs["layer"], done, warnings + answer.values["warnings"], answer.values["files"]
