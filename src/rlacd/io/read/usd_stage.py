"""The meshes and primitives of a USD stage that are rendered, where they stand; imported only by a process of its own.

A stage may name other files. They are read only from the folder of the file or below it, and named if they are missing.
"""

from __future__ import annotations

import itertools
from collections import Counter
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import trimesh
from pxr import Sdf, Usd, UsdGeom, UsdShade

from rlacd.errors import MeshFileError
from rlacd.io.read.apart import Answered, ToldNodes, served
from rlacd.io.read.contents import HIDDEN, Triangles, counts_of, damaged
from rlacd.io.read.open_file import read_file
from rlacd.io.read.polygons import triangles_of
from rlacd.pool import Blobs, Values
from rlacd.solid.arrays import FloatArray

PRIMITIVES: dict[str, Callable[[Callable[[str], float]], trimesh.Trimesh]] = {
    "Cube": lambda of: trimesh.creation.box((of("size"),) * 3),
    "Sphere": lambda of: trimesh.creation.icosphere(3, of("radius")),
    "Cylinder": lambda of: trimesh.creation.cylinder(of("radius"), of("height")),
    "Capsule": lambda of: trimesh.creation.capsule(of("height"), of("radius")),
    "Cone": lambda of: trimesh.creation.cone(of("radius"), of("height")),
}
"""The primitives that are read, by their attributes; USD centres each."""

_TO_AXIS = {"X": (0, 1, 0, np.pi / 2), "Y": (1, 0, 0, -np.pi / 2), "Z": (1, 0, 0, 0.0)}
"""How to turn z to an axis: about x, y, z by an angle."""


_LOOK = {"diffuseColor": 3, "emissiveColor": 3, "opacity": 1, "metallic": 1, "roughness": 1}
"""The inputs of a UsdPreviewSurface that are read where they are no pictures, and their numbers."""


@served
def read_stage(values: Values, blobs: Blobs) -> Answered:
    """Read the stage at `values`' path: ``INDEX.points`` and ``INDEX.faces`` of every node, and its description."""
    path = Path(values["path"])
    check_files(path)
    stage = Usd.Stage.Open(str(path))
    cache = UsdGeom.XformCache(Usd.TimeCode.EarliestTime())
    nodes, left_out = ToldNodes(path), Counter[str]()
    prims = iter(Usd.PrimRange(stage.GetPseudoRoot(), Usd.TraverseInstanceProxies(Usd.PrimDefaultPredicate)))
    for prim in prims:
        if prim.IsA(UsdGeom.PointInstancer):
            raise MeshFileError(f"{path} has a point instancer, which is not read: convert its instances to meshes")
        if (why := _left_out(prim)) is not None:
            left_out[why] += 1
            if why == HIDDEN:
                prims.PruneChildren()
            continue
        if not prim.IsA(UsdGeom.Mesh) and str(prim.GetTypeName()) not in PRIMITIVES:
            left_out["shapes other than meshes and plain primitives were left out"] += prim.IsA(UsdGeom.Gprim)
            continue
        to_world = np.array(cache.GetLocalToWorldTransform(prim), dtype=np.float64).T
        names = prim.GetName(), str(prim.GetPath())
        nodes.add(names, to_world, _look(prim), Triangles(*prim_geometry(path, prim)))
    up, metres = str(UsdGeom.GetStageUpAxis(stage)).lower(), float(UsdGeom.GetStageMetersPerUnit(stage))
    return {"nodes": nodes.values, "up": up, "metres": metres, "warnings": counts_of(left_out)}, nodes.blobs


def _look(prim: Any) -> dict[str, list[float]] | None:
    """The colours and surface of a prim, as UsdPreviewSurface names them; None if it says nothing."""
    material, _ = UsdShade.MaterialBindingAPI(prim).ComputeBoundMaterial()
    shader = material.ComputeSurfaceSource()[0] if material else None
    if shader and shader.GetShaderId() == "UsdPreviewSurface":
        read = {name: _numbers(shader.GetInput(name), count) for name, count in _LOOK.items()}
        return {name: value for name, value in read.items() if value is not None}
    tints = UsdGeom.Gprim(prim).GetDisplayColorAttr().Get()
    return {"diffuseColor": list(map(float, tints[0]))} if tints and len(tints) == 1 else None


def _numbers(value: Any, count: int) -> list[float] | None:
    """The numbers of an input of a shader; None if it has none, or a picture."""
    attributes = UsdShade.Utils.GetValueProducingAttributes(value) if value else []
    if not attributes or UsdShade.Shader(attributes[0].GetPrim()).GetShaderId() == "UsdUVTexture":
        return None
    found = attributes[0].Get()
    numbers = np.ravel(np.asarray(found if found is not None else [], dtype=np.float64))
    return numbers.tolist() if len(numbers) == count and np.isfinite(numbers).all() else None


def check_files(path: Path) -> None:
    """Refuse a file that names others outside its folder, or missing ones, before any of them is composed."""
    folder = path.parent.resolve()
    known, waiting = set(), [str(path)]
    while waiting:
        layer = Sdf.Layer.FindOrOpen(waiting.pop())
        if layer is None:
            raise damaged(path, "USD")
        for named in _named(path, layer):
            found = layer.ComputeAbsolutePath(named)
            if found in known:
                continue
            known.add(found)
            file = Path(found.split("[", 1)[0])
            if not file.resolve().is_relative_to(folder):
                raise MeshFileError(f"{path} refers to {named!r:.200}, outside its folder, which is not allowed")
            try:
                read_file(file)
            except (OSError, ValueError) as error:
                raise MeshFileError(f"{path} refers to {named!r:.200}, which cannot be opened") from error
            waiting.append(found)


def _named(path: Path, layer: Any) -> list[str]:
    """The files that a layer names and OpenUSD opens: sublayers, references, payloads, and clips of values."""
    found = [named for named in layer.GetCompositionAssetDependencies() if named]  # it may refer to its own prims
    paths: list[Any] = []
    layer.Traverse(Sdf.Path.absoluteRootPath, paths.append)
    prims = (layer.GetPrimAtPath(one) for one in paths if one.IsPrimPath() or one.IsPrimVariantSelectionPath())
    for clip in itertools.chain.from_iterable(prim.GetInfo("clips").values() for prim in prims if prim):
        if "templateAssetPath" in clip:
            raise MeshFileError(f"{path} has clips of values by a template, which are not read: flatten it first")
        found += [one.path for one in [*clip.get("assetPaths", ()), clip.get("manifestAssetPath")] if one]
    return found


def _left_out(prim: Any) -> str | None:
    """Why a prim is not shown; None if it is, or if it has nothing to show."""
    if not prim.IsA(UsdGeom.Imageable):
        return None
    imageable = UsdGeom.Imageable(prim)
    if imageable.ComputeVisibility(Usd.TimeCode.EarliestTime()) == UsdGeom.Tokens.invisible:
        return HIDDEN
    shown = imageable.ComputePurpose() in (UsdGeom.Tokens.default_, UsdGeom.Tokens.render)
    return "guides and proxies were left out" if prim.IsA(UsdGeom.Gprim) and not shown else None


def prim_geometry(path: Path, prim: Any) -> tuple[FloatArray, np.ndarray[Any, Any]]:
    """The points and triangles of a mesh or primitive, in its own coordinates."""
    return _primitive(prim) if str(prim.GetTypeName()) in PRIMITIVES else _mesh(path, prim)


def _mesh(path: Path, prim: Any) -> tuple[FloatArray, np.ndarray[Any, Any]]:
    """The points and triangles of a mesh, in its own coordinates."""
    mesh = UsdGeom.Mesh(prim)
    points = np.asarray(_value(mesh.GetPointsAttr()) or (), dtype=np.float64)
    counts = np.asarray(_value(mesh.GetFaceVertexCountsAttr()) or (), dtype=np.int64)
    corners = np.asarray(_value(mesh.GetFaceVertexIndicesAttr()) or (), dtype=np.int64)
    holes = np.asarray(_value(mesh.GetHoleIndicesAttr()) or (), dtype=np.int64)
    if (counts < 0).any() or counts.sum() != len(corners):
        raise MeshFileError(f"{path} has faces at {prim.GetPath()} that are inconsistent: export it again")
    if len(corners) and (corners.min() < 0 or corners.max() >= len(points)):
        raise MeshFileError(f"{path} has faces at {prim.GetPath()} that refer to missing points: export it again")
    if len(holes):
        if holes.min() < 0 or holes.max() >= len(counts):
            raise MeshFileError(f"{path} has holes at {prim.GetPath()} that are none of its faces: export it again")
        kept = np.ones(len(counts), dtype=bool)
        kept[holes] = False
        counts, corners = counts[kept], corners[np.repeat(kept, counts)]
    positions = points.reshape(-1, 3)
    faces = triangles_of(positions, counts, corners)
    if mesh.GetOrientationAttr().Get() == UsdGeom.Tokens.leftHanded:
        faces = faces[:, ::-1]
    return positions, faces


def _value(attribute: Any) -> Any:
    """The value of an attribute, at its first moment if it is animated."""
    return attribute.Get(Usd.TimeCode.EarliestTime())


def _primitive(prim: Any) -> tuple[FloatArray, np.ndarray[Any, Any]]:
    """A cube, sphere, cylinder, capsule or cone as points and triangles."""

    mesh = PRIMITIVES[str(prim.GetTypeName())](lambda name: float(_value(prim.GetAttribute(name))))
    mesh.apply_translation(-mesh.bounds.mean(axis=0))
    if axis := prim.GetAttribute("axis"):
        *about, angle = _TO_AXIS[str(_value(axis))]
        mesh.apply_transform(trimesh.transformations.rotation_matrix(angle, about))
    return np.array(mesh.vertices, dtype=np.float64), np.array(mesh.faces, dtype=np.int64)
