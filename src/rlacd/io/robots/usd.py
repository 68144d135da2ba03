"""USD stages: every mesh that collides gets convex hulls, in a layer over the original, which stays as it is."""

from __future__ import annotations

import os
from collections.abc import Hashable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
import trimesh

from rlacd.clear import LinkPair, Motion, Primitive, Solids, at_rest
from rlacd.decompose_mesh import decompose
from rlacd.io.read.apart import answer_of
from rlacd.io.robots.robot import Body, Collider, MeshFile, PlacedMesh, Results, Robot, Written, colliders
from rlacd.io.write import write_file
from rlacd.io.write.encode import hull_name
from rlacd.io.write.single_precision import required_hull
from rlacd.io.write.usd import require_usd
from rlacd.options.robots import RobotOptions
from rlacd.plain_json import as_plain
from rlacd.solid.arrays import FloatArray, Int64Array
from rlacd.solid.poses import inverse, product, rounded

SERVER = "rlacd.io.robots.usd_layer:rewrite"


@dataclass(frozen=True, eq=False)
class Stage(Robot):
    """A USD stage, by the schemas of UsdPhysics.

    A node is a mesh that collides: its ``path``, its ``scale`` [3] and ``pose`` (4 rows of 4) on the stage, the path of
    the rigid ``body`` it belongs to, if any, and its ``body_pose``; ``kind``, equal for what may become one solid.
    """

    nodes: Sequence[Mapping[str, Any]]
    prims: Mapping[Collider, Sequence[int]]  # which nodes are its meshes
    joints: Sequence[tuple[str, str]]  # the bodies that each connects
    solids: Sequence[Solids]  # of each body

    def motion(self, samples: int, seed: int) -> Motion:
        """See `Robot`; a stage is looked at as it stands."""
        names, fixed = [body.name for body in self.bodies], [body.name for body in self.bodies if body.is_world]
        places = [sorted(map(names.index, ends)) for ends in self.joints if {*ends} <= {*names}]
        rest = at_rest(names, fixed, [body.pose for body in self.bodies], [(one, other) for one, other in places])
        return replace(rest, solids=tuple(self.solids))

    def write(
        self, place: Path, results: Results, pairs: Sequence[LinkPair] | None, asked: RobotOptions, *, whole: bool
    ) -> Written:
        """See `Robot`; all of a stage names pictures and other files relative to the folder of the original."""
        hulls: dict[str, bytes] = {}
        counts, leads, masses = [0] * len(self.nodes), [0] * len(self.nodes), {}
        for collider, places in self.prims.items():
            first, result = places[0], results[collider]
            counts[first] = len(result)
            for number, hull in enumerate(result.hulls):
                mesh, shift = required_hull(hull, self.nodes[first]["path"], "as USD")
                points = (mesh.vertices + shift) / np.array(self.nodes[first]["scale"])
                hulls[f"{first}.{number}.points"] = points.astype("<f4").tobytes()
                hulls[f"{first}.{number}.faces"] = np.asarray(mesh.faces, dtype="<i4").tobytes()
            for index, placed in zip(places, collider.meshes, strict=True):
                leads[index] = first
                masses[self.nodes[index]["path"]] = as_plain(result.report.mass if len(places) == 1 else _mass(placed))
        sublayer = None if whole else Path(os.path.relpath(self.source, place.absolute().parent)).as_posix()
        given = {"path": str(self.source), "sublayer": sublayer, "ending": place.suffix.lower().lstrip(".")}
        filtered = [(pair.first, pair.second) for pair in pairs or () if pair.kind in asked.exclude]
        how = {"masses": masses, "counts": counts, "leads": leads, "filtered": filtered}
        answer = answer_of(SERVER, self.source, "USD", {**given, **how}, hulls)
        write_file(place, answer.blobs["layer"])
        names = {collider: [*map(hull_name, range(len(result)))] for collider, result in results.items()}
        lost = _left_behind(answer.values["files"], self.source.parent, place.absolute().parent)
        return Written(place, names, [*answer.values["warnings"], *lost])


def read_stage(source: Path, *, apart: bool = False) -> Stage:
    """Find the meshes and primitives of a stage that collide.

    They are sorted by the rigid bodies they belong to, and not `apart` by what may become one solid; those that no body
    carries stay apart, each a body of its own.

    Raises
    ------
    MeshFileError
        It cannot be read.
    MissingExtraError
        The extra ``usd`` is not installed.
    """
    require_usd()
    answer = answer_of(SERVER, source, "USD", {"path": str(source)}, {})
    nodes, of_body = answer.values["nodes"], dict[str, list[int]]()
    for index, node in enumerate(nodes):
        of_body.setdefault(node["body"] or node["path"], []).append(index)
    kept = dict[str, list[Any]]()
    for node in answer.values["kept"]:
        kept.setdefault(node["body"] or node["path"], []).append(node)
    arrays: dict[tuple[bytes, bytes], tuple[FloatArray, Int64Array]] = {}
    bodies: list[Body] = []
    prims: dict[Collider, list[int]] = {}
    solids: list[Solids] = []
    for name in {**of_body, **kept}:
        places, others = of_body.get(name, []), kept.get(name, [])
        first = nodes[places[0]] if places else others[0]
        pose = _rigid(first["body_pose"]) if first["body"] else np.eye(4)
        uses: list[tuple[Hashable | None, PlacedMesh, int]] = []
        for index in places:
            node, both = nodes[index], (answer.blobs[f"{index}.points"], answer.blobs[f"{index}.faces"])
            points, faces = np.frombuffer(both[0]).reshape(-1, 3), np.frombuffer(both[1], np.int64).reshape(-1, 3)
            file = MeshFile(Path(node["path"]), *arrays.setdefault(both, (points, faces)))
            placed = product(inverse(pose), _rigid(node["pose"]))
            mesh = PlacedMesh(file, np.array(node["scale"]), placed, np.eye(4))
            uses.append((None if apart or not node["body"] else node["kind"], mesh, index))
        joined = colliders(name, uses)
        found = [own for node in others if (own := _primitive(node, pose)) is not None]
        if not joined and not found:  # a plane
            continue
        bodies.append(Body(name, pose, [*joined], not first["body"], found))
        solids.append(Solids(found, len(places), len(others) - len(found)))
        prims |= joined
    warnings, metres, up = (answer.values[name] for name in ("warnings", "metres", "up"))
    return Stage(source, bodies, warnings, metres, up, nodes, prims, answer.values["joints"], solids)


def _left_behind(files: Sequence[str], source: Path, folder: Path) -> list[str]:
    """Warn about other files that are named relative to a folder which the result does not lie in."""
    if not files or os.path.realpath(folder) == os.path.realpath(source):
        return []
    many = len(files) > 1
    said = f"{len(files)} other files, such as {files[0]}, are" if many else f"{files[0]} is"
    lost = f"will not be found from {folder}: write the result beside the input, or copy {'them' if many else 'it'} too"
    return [f"{said} referred to relative to {source} and {lost}."]


def _primitive(node: Mapping[str, Any], pose: FloatArray) -> Primitive | None:
    """A primitive in the frame of its body; None for another shape."""
    place = product(inverse(pose), product(_rigid(node["pose"]), np.array(node["turn"]).reshape(4, 4)))
    return Primitive.read(node["kind"], node["sizes"], place)


def _rigid(rows: Sequence[float]) -> FloatArray:
    """The pose of a frame, given by 16 numbers in rows, without its scale."""
    pose = np.array(rows).reshape(4, 4)
    pose[:3, :3] /= np.sqrt((pose[:3, :3] ** 2).sum(axis=0))
    return rounded(pose)


def _mass(mesh: PlacedMesh) -> Any:
    """The mass of one mesh of several that became a solid; None if it is closed, and needs no repair."""
    if trimesh.Trimesh(mesh.points, mesh.faces, process=False).is_volume:
        return None
    return decompose((mesh.points, mesh.faces), max_hulls=1, quality="fast").report.mass
