"""USD stages: every mesh that collides gets convex hulls, in a layer over the original, which stays as it is."""

from __future__ import annotations

import os
from collections.abc import Hashable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import trimesh

from rlacd.decompose_mesh import decompose
from rlacd.decomposition import Decomposition
from rlacd.io.read.apart import answer_of
from rlacd.io.robots.bodies import Body, Collider, PlacedMesh, Surface
from rlacd.io.robots.plan import colliders
from rlacd.io.write.single_precision import required_hull
from rlacd.io.write.usd import require_usd
from rlacd.options.output import Axis
from rlacd.solid.arrays import FloatArray, Int64Array
from rlacd.solid.poses import inverse, product, rounded

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
        For each its ``path``, its ``scale`` [3] and ``pose`` (4 rows of 4) on the stage, the path of the rigid ``body``
        it belongs to, if any, and its ``body_pose``; ``kind``, equal for those that may become one solid, or None.
    blobs
        ``INDEX.points`` and ``INDEX.faces`` of each.
    warnings
        What of the stage is not rewritten, or changes with it.
    metres
        Its unit of length.
    up
        The axis that points up.
    """

    source: Path
    nodes: list[Mapping[str, Any]]
    blobs: Mapping[str, bytes]
    warnings: list[str]
    metres: float
    up: Axis


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
    said = (answer.values[name] for name in ("warnings", "metres", "up"))
    return Colliders(stage, answer.values["nodes"], answer.blobs, *said)


def colliders_of(mesh: Path) -> Colliders | None:
    """Find them as `read_colliders` does; None if the file is no stage, or nothing of it collides."""
    found = read_colliders(mesh) if mesh.suffix.lower() in ENDINGS else None
    return found if found is not None and found.nodes else None


def bodies_of(stage: Colliders, *, apart: bool) -> tuple[list[Body], dict[Collider, list[int]]]:
    """Sort the meshes by the rigid bodies they belong to, and by what may become one solid.

    Those that no body carries stay apart, each a body of its own.

    Returns
    -------
    tuple of (list of Body, dict)
        The bodies, and the places in ``stage.nodes`` of the meshes of each collider.
    """
    of_body: dict[str, list[int]] = {}
    for index, node in enumerate(stage.nodes):
        of_body.setdefault(node["body"] or node["path"], []).append(index)
    arrays: dict[tuple[bytes, bytes], tuple[FloatArray, Int64Array]] = {}
    bodies: list[Body] = []
    prims: dict[Collider, list[int]] = {}
    for name, places in of_body.items():
        first = stage.nodes[places[0]]
        pose = _rigid(first["body_pose"]) if first["body"] else np.eye(4)
        uses: list[tuple[Hashable | None, PlacedMesh, int]] = []
        for index in places:
            node, both = stage.nodes[index], (stage.blobs[f"{index}.points"], stage.blobs[f"{index}.faces"])
            points, faces = np.frombuffer(both[0]).reshape(-1, 3), np.frombuffer(both[1], np.int64).reshape(-1, 3)
            surface = Surface(Path(node["path"]), *arrays.setdefault(both, (points, faces)))
            placed = product(inverse(pose), _rigid(node["pose"]))
            mesh = PlacedMesh(surface, np.array(node["scale"]), placed, np.eye(4))
            uses.append((None if apart or not node["body"] else node["kind"], mesh, index))
        joined = colliders(name, uses)
        bodies.append(Body(name, pose, [*joined], not first["body"]))
        prims |= joined
    return bodies, prims


def _rigid(rows: Sequence[float]) -> FloatArray:
    """The pose of a frame, given by 16 numbers in rows, without its scale."""
    pose = np.array(rows).reshape(4, 4)
    pose[:3, :3] /= np.sqrt((pose[:3, :3] ** 2).sum(axis=0))
    return rounded(pose)


def encode_layer(
    stage: Colliders,
    place: Path,
    prims: Mapping[Collider, Sequence[int]],
    results: Mapping[Collider, Decomposition],
    *,
    flat: bool,
) -> tuple[bytes, list[str], list[str]]:
    """Put hulls in the place of each collider's first mesh; its others no longer collide either.

    Parameters
    ----------
    stage : Colliders
    place : Path
        Where the layer will be.
    prims : dict
        The places in ``stage.nodes`` of the meshes of each collider.
    results : dict
        Its hulls.
    flat : bool
        Whether to write the whole stage as one layer, instead of one over the original; it names pictures and other
        files as before, relative to the folder of the original.

    Returns
    -------
    tuple of (bytes, list of str, list of str)
        The layer, warnings, and the other files that `flat` names.
    """
    hulls: dict[str, bytes] = {}
    counts, leads, masses = [0] * len(stage.nodes), [0] * len(stage.nodes), {}
    for collider, places in prims.items():
        first, result = places[0], results[collider]
        counts[first] = len(result)
        for number, hull in enumerate(result.hulls):
            mesh, shift = required_hull(hull, stage.nodes[first]["path"], "as USD")
            points = (mesh.vertices + shift) / np.array(stage.nodes[first]["scale"])
            hulls[f"{first}.{number}.points"] = points.astype("<f4").tobytes()
            hulls[f"{first}.{number}.faces"] = np.asarray(mesh.faces, dtype="<i4").tobytes()
        for index, placed in zip(places, collider.meshes, strict=True):
            leads[index] = first
            masses[stage.nodes[index]["path"]] = result.report["mass"] if len(places) == 1 else _mass(placed)
    sublayer = None if flat else Path(os.path.relpath(stage.source, place.absolute().parent)).as_posix()
    asked = {"path": str(stage.source), "sublayer": sublayer, "ending": place.suffix.lower().lstrip(".")}
    how = {"masses": masses, "counts": counts, "leads": leads}
    answer = answer_of(SERVER, stage.source, "USD", {**asked, **how}, hulls)
    return answer.blobs["layer"], [*stage.warnings, *answer.values["warnings"]], answer.values["files"]


def _mass(mesh: PlacedMesh) -> Any:
    """The mass of one mesh of several that became a solid; None if it is closed, and needs no repair."""
    if trimesh.Trimesh(mesh.points, mesh.faces, process=False).is_volume:
        return None
    return decompose((mesh.points, mesh.faces), max_hulls=1, quality="fast").report["mass"]
