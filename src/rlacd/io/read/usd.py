"""USD files (usd, usda, usdc, usdz), read by OpenUSD: the meshes and primitives that are rendered, where they stand.

A stage may name other files. They are read only from the folder of the file or below it, and named if they are missing.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import trimesh

from rlacd.errors import MeshFileError, MissingExtraError
from rlacd.io.read.limits import MOST_PLACES, MOST_TRIANGLES
from rlacd.io.read.open_file import read_file
from rlacd.solid.arrays import FloatArray

USD = ("usd", "usda", "usdc", "usdz")

UP, METRES = "up", "metres"
"""Keys of the scene's metadata."""

_TO_AXIS = {"X": (0, 1, 0, np.pi / 2), "Y": (1, 0, 0, -np.pi / 2), "Z": (1, 0, 0, 0.0)}
"""How to turn z to an axis: about x, y, z by an angle."""


def usd_scene(path: Path) -> trimesh.Scene:
    """Read a stage as a scene with a node for each mesh, whose metadata holds `UP` and `METRES`.

    Invisible prims and those for other purposes than to be rendered (guides, proxies) are left out. Subdivision
    surfaces are read as their cages.

    Raises
    ------
    MeshFileError
        It is damaged, refers to a file outside its folder or to none, or holds too much.
    MissingExtraError
        The extra ``usd`` is not installed.
    """
    try:
        from pxr import Tf, Usd, UsdGeom
    except ImportError as error:
        raise MissingExtraError("USD needs an extra: run  pip install 'rlacd[usd]'  and try again.") from error
    try:
        _check_files(path)
        stage = Usd.Stage.Open(str(path))
        scene = trimesh.Scene()
        cache = UsdGeom.XformCache(Usd.TimeCode.EarliestTime())
        count = 0
        for prim in Usd.PrimRange(stage.GetPseudoRoot(), Usd.TraverseInstanceProxies(Usd.PrimDefaultPredicate)):
            if len(scene.geometry) > MOST_PLACES:
                raise MeshFileError(f"{path} places more than {MOST_PLACES} meshes: join them first")
            if prim.IsA(UsdGeom.PointInstancer):
                raise MeshFileError(f"{path} has a point instancer, which is not read: make its instances real first")
            mesh = _mesh(path, prim)
            if mesh is None:
                continue
            count += len(mesh.faces)
            if count > MOST_TRIANGLES:
                raise MeshFileError(f"{path} places more than {MOST_TRIANGLES} triangles: simplify it first")
            name = prim.GetName() if prim.GetName() not in scene.geometry else str(prim.GetPath())
            to_world = np.array(cache.GetLocalToWorldTransform(prim), dtype=np.float64).T
            scene.add_geometry(mesh, node_name=name, geom_name=name, transform=to_world)
        scene.metadata[UP] = str(UsdGeom.GetStageUpAxis(stage)).lower()
        scene.metadata[METRES] = float(UsdGeom.GetStageMetersPerUnit(stage))
    except Tf.ErrorException as error:
        raise MeshFileError(f"{path} cannot be read as USD: it is damaged or cut off; export it again") from error
    return scene


def _check_files(path: Path) -> None:
    """Refuse a file that names others outside its folder, or missing ones, before any of them is composed."""
    from pxr import Sdf

    folder = path.parent.resolve()
    known, waiting = set(), [str(path)]
    while waiting:
        layer = Sdf.Layer.FindOrOpen(waiting.pop())
        if layer is None:
            raise MeshFileError(f"{path} cannot be read as USD: it is damaged or cut off; export it again")
        for named in layer.GetCompositionAssetDependencies():
            found = layer.ComputeAbsolutePath(named)
            if found in known:
                continue
            known.add(found)
            file = Path(found.split("[", 1)[0])
            if not file.resolve().is_relative_to(folder):
                raise MeshFileError(f"{path} refers to {named!r:.200}, outside its folder, which is not read")
            try:
                read_file(file)
            except (OSError, ValueError) as error:
                raise MeshFileError(f"{path} refers to {named!r:.200}, which cannot be opened") from error
            waiting.append(found)


def _mesh(path: Path, prim: Any) -> trimesh.Trimesh | None:
    """The triangles of a prim that is rendered, in its own coordinates; None if it has none."""
    from pxr import UsdGeom

    shown = UsdGeom.Imageable(prim)
    if not prim.IsA(UsdGeom.Gprim) or shown.ComputeVisibility() == UsdGeom.Tokens.invisible:
        return None
    if shown.ComputePurpose() not in (UsdGeom.Tokens.default_, UsdGeom.Tokens.render):
        return None
    if not prim.IsA(UsdGeom.Mesh):
        return _primitive(prim)
    mesh = UsdGeom.Mesh(prim)
    points, counts, corners = (
        np.asarray(_value(attribute) or (), dtype=kind)
        for attribute, kind in (
            (mesh.GetPointsAttr(), np.float64),
            (mesh.GetFaceVertexCountsAttr(), np.int64),
            (mesh.GetFaceVertexIndicesAttr(), np.int64),
        )
    )
    if (counts < 0).any() or counts.sum() != len(corners):
        raise MeshFileError(f"{path} has faces at {prim.GetPath()} that do not add up: export it again")
    if len(corners) and (corners.min() < 0 or corners.max() >= len(points)):
        raise MeshFileError(f"{path} has faces at {prim.GetPath()} with points that are not there: export it again")
    faces = _triangles(counts, corners)
    if mesh.GetOrientationAttr().Get() == UsdGeom.Tokens.leftHanded:
        faces = faces[:, ::-1]
    return trimesh.Trimesh(points.reshape(-1, 3), faces, process=False)


def _value(attribute: Any) -> Any:
    """The value of an attribute, at its first moment if it is animated."""
    from pxr import Usd

    return attribute.Get(Usd.TimeCode.EarliestTime())


def _triangles(counts: np.ndarray[Any, Any], corners: np.ndarray[Any, Any]) -> np.ndarray[Any, Any]:
    """Fans of triangles, ``[F, 3]``, for polygons with given numbers of corners."""
    pieces = np.maximum(counts - 2, 0)
    first = np.repeat(np.cumsum(counts) - counts, pieces)
    step = np.arange(len(first)) - np.repeat(np.cumsum(pieces) - pieces, pieces)
    return np.asarray(corners[np.stack([first, first + step + 1, first + step + 2], axis=1)])


def _primitive(prim: Any) -> trimesh.Trimesh | None:
    """A cube, sphere, cylinder, capsule or cone as a mesh; None for anything else."""
    kind = str(prim.GetTypeName())

    def number(name: str) -> float:
        return float(_value(prim.GetAttribute(name)))

    match kind:
        case "Cube":
            return trimesh.creation.box((number("size"),) * 3)
        case "Sphere":
            return trimesh.creation.icosphere(3, number("radius"))
        case "Cylinder":
            mesh = trimesh.creation.cylinder(number("radius"), number("height"))
        case "Capsule":
            mesh = trimesh.creation.capsule(number("height"), number("radius"))
            mesh.apply_translation((0, 0, -mesh.bounds.mean(axis=0)[2]))
        case "Cone":
            mesh = trimesh.creation.cone(number("radius"), number("height"))
            mesh.apply_translation((0, 0, -number("height") / 2))
        case _:
            return None
    return mesh.apply_transform(_turned(str(_value(prim.GetAttribute("axis")))))


def _turned(axis: str) -> FloatArray:
    """The rotation from z to an axis."""
    *about, angle = _TO_AXIS[axis]
    return np.asarray(trimesh.transformations.rotation_matrix(angle, about))
