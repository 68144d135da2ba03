"""USD stages: every mesh that collides gets convex hulls, in a layer over the original, which stays as it is."""

from __future__ import annotations

import os
from collections.abc import Callable, Mapping
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

SERVER = "rlacd.io.robots.usd_layer:StageRewriter"


def collides(stage: Path) -> bool:
    """Tell whether a mesh of the stage collides, by the schemas of UsdPhysics.

    Raises
    ------
    MeshFileError
        It cannot be read.
    MissingExtraError
        The extra ``usd`` is not installed.
    """
    return bool(_colliders(stage)[0])


def rewrite_stage(
    source: Path, place: Path, decomposed: Callable[[trimesh.Trimesh], Decomposition]
) -> tuple[bytes, dict[str, tuple[Decomposition, int]], list[str]]:
    """Decompose the meshes that collide, each once at its scale.

    Parameters
    ----------
    source, place : Path
        The stage, and where the layer will be.
    decomposed : callable
        Decomposes a mesh, in the stage's unit.

    Returns
    -------
    tuple of (bytes, dict, list of str)
        The layer, the result and the number of hulls of each prim, and warnings.
    """
    nodes, blobs, warnings = _colliders(source)
    results: dict[tuple[bytes, bytes, tuple[float, ...]], Decomposition] = {}
    hulls: dict[str, bytes] = {}
    done: dict[str, tuple[Decomposition, int]] = {}
    for index, node in enumerate(nodes):
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
        done[node["path"]] = results[key], len(results[key])
    asked = {
        "path": str(source),
        "sublayer": Path(os.path.relpath(source, place.absolute().parent)).as_posix(),
        "ending": place.suffix.lower().lstrip("."),
        "counts": [count for _, count in done.values()],
    }
    return answer_of(SERVER, source, "USD", asked, hulls).blobs["layer"], done, warnings


def _colliders(source: Path) -> tuple[list[Mapping[str, Any]], Mapping[str, bytes], list[str]]:
    require_usd()
    answer = answer_of(SERVER, source, "USD", {"path": str(source)}, {})
    return answer.values["nodes"], answer.blobs, answer.values["warnings"]
