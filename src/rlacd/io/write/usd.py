"""USD: a rigid body whose hulls are guides with UsdPhysics' collision schemas; needs the extra ``usd``."""

from __future__ import annotations

import re
import unicodedata
from typing import TYPE_CHECKING, Any

import numpy as np

from rlacd.errors import import_extra
from rlacd.io.write.encode import hull_name
from rlacd.io.write.model import RigidBody
from rlacd.io.write.palette import hull_colors, linear_from_srgb
from rlacd.io.write.single_precision import Triangulated, placed_mesh, required_hull

if TYPE_CHECKING:
    from rlacd.extras.primitive import Primitive


def require_usd() -> None:
    """Raise MissingExtraError, with installation advice, unless USD can be imported."""
    for module in ("pxr", "pxr.UsdPhysics"):
        import_extra(module, "USD", "usd")


def encode_usd(model: RigidBody, ending: str) -> bytes:
    """Write a stage: the rigid body ``/<name>``, with ``visual`` (visible) and ``collision/hull_000``, ... (colliding).

    Parameters
    ----------
    model : RigidBody
        USD supports y or z as the up axis; a body whose x axis points up is rotated.
    ending : {"usda", "usd", "usdc"}
        Text for ``usda``, else binary.

    Raises
    ------
    MissingExtraError
        The extra ``usd`` is not installed.
    OutputError
        A hull is too thin for single precision.
    """
    require_usd()
    from pxr import Gf, Kind, Sdf, Usd, UsdGeom, UsdPhysics

    layer = Sdf.Layer.CreateAnonymous(f".{'usda' if ending == 'usda' else 'usdc'}")
    stage = Usd.Stage.Open(layer)
    UsdGeom.SetStageUpAxis(stage, UsdGeom.Tokens.y if model.up == "y" else UsdGeom.Tokens.z)
    UsdGeom.SetStageMetersPerUnit(stage, 1.0)
    UsdPhysics.SetStageKilogramsPerUnit(stage, 1.0)

    body = UsdGeom.Xform.Define(stage, f"/{identifier(model.name)}")
    stage.SetDefaultPrim(body.GetPrim())
    Usd.ModelAPI(body).SetKind(Kind.Tokens.component)
    body.GetPrim().SetDisplayName(model.name)
    if model.up == "x":
        body.AddOrientOp().Set(Gf.Quatf(0.5**0.5, Gf.Vec3f(0, -(0.5**0.5), 0)))
    UsdPhysics.RigidBodyAPI.Apply(body.GetPrim())
    _set_mass(UsdPhysics.MassAPI.Apply(body.GetPrim()), model)

    if model.visual is not None:
        visual, shift = placed_mesh(model.visual)
        _mesh(stage, body.GetPath().AppendChild("visual"), visual, shift)
    group = UsdGeom.Scope.Define(stage, body.GetPath().AppendChild("collision"))
    UsdGeom.Imageable(group).CreatePurposeAttr(UsdGeom.Tokens.guide)
    colors = hull_colors(len(model.hulls))
    for index, (hull, shape, color) in enumerate(zip(model.hulls, model.primitives, colors, strict=True)):
        path = group.GetPath().AppendChild(hull_name(index))
        if shape is not None:
            _collider(_primitive(stage, path, shape), color)
            continue
        mesh = _mesh(stage, path, *required_hull(hull, hull_name(index), "as USD"))
        _collider(mesh, color)
        UsdPhysics.MeshCollisionAPI.Apply(mesh.GetPrim()).CreateApproximationAttr(UsdPhysics.Tokens.convexHull)
    return stage_bytes(layer, ending)


def identifier(name: str) -> str:
    """Make a valid prim name of any name: letters of any script, digits and ``_``, no leading digit."""
    plain = re.sub(r"\W", "_", unicodedata.normalize("NFC", name))
    return plain if re.match(r"[^\W\d]", plain) else f"_{plain}"


def _mesh(stage: Any, path: Any, mesh: Triangulated, shift: np.ndarray[Any, Any]) -> Any:
    from pxr import Gf

    prim = mesh_prim(stage, path, np.asarray(mesh.vertices, dtype=np.float32), np.asarray(mesh.faces, dtype=np.int32))
    if shift.any():
        prim.AddTranslateOp().Set(Gf.Vec3d(*shift.tolist()))
    return prim


def mesh_prim(stage: Any, path: Any, points: np.ndarray[Any, Any], faces: np.ndarray[Any, Any]) -> Any:
    """Define a mesh of triangles, of points in single precision."""
    from pxr import UsdGeom, Vt

    prim = UsdGeom.Mesh.Define(stage, path)
    prim.CreatePointsAttr(Vt.Vec3fArray.FromNumpy(np.ascontiguousarray(points)))
    prim.CreateFaceVertexCountsAttr(Vt.IntArray.FromNumpy(np.full(len(faces), 3, dtype=np.int32)))
    prim.CreateFaceVertexIndicesAttr(Vt.IntArray.FromNumpy(np.ascontiguousarray(faces).ravel()))
    prim.CreateSubdivisionSchemeAttr(UsdGeom.Tokens.none)
    prim.CreateExtentAttr(Vt.Vec3fArray.FromNumpy(np.stack([points.min(axis=0), points.max(axis=0)])))
    return prim


def _primitive(stage: Any, path: Any, shape: Primitive) -> Any:
    from pxr import Gf, UsdGeom

    kind = {"box": UsdGeom.Cube, "sphere": UsdGeom.Sphere, "capsule": UsdGeom.Capsule, "cylinder": UsdGeom.Cylinder}
    prim = kind[shape.kind].Define(stage, path)
    w, x, y, z = shape.quaternion
    prim.AddTranslateOp().Set(Gf.Vec3d(*shape.centre.tolist()))
    prim.AddOrientOp(UsdGeom.XformOp.PrecisionDouble).Set(Gf.Quatd(w, x, y, z))
    if shape.kind == "box":
        prim.CreateSizeAttr(1.0)
        prim.AddScaleOp(UsdGeom.XformOp.PrecisionDouble).Set(Gf.Vec3d(*shape.size))
    else:
        prim.CreateRadiusAttr(shape.size[0])
    if shape.kind in ("capsule", "cylinder"):
        prim.CreateAxisAttr(UsdGeom.Tokens.z)
        prim.CreateHeightAttr(shape.size[1])
    prim.CreateExtentAttr(UsdGeom.Boundable.ComputeExtentFromPlugins(prim, 0.0))
    return prim


def _collider(prim: Any, color: Any) -> None:
    from pxr import Gf, UsdGeom, UsdPhysics

    prim.CreatePurposeAttr(UsdGeom.Tokens.guide)
    prim.CreateDisplayColorAttr([Gf.Vec3f(*linear_from_srgb(color).tolist())])
    UsdPhysics.CollisionAPI.Apply(prim.GetPrim())


def _set_mass(api: Any, model: RigidBody) -> None:
    from pxr import Gf

    moments, axes = np.linalg.eigh(model.mass.inertia_abs)
    axes[:, 2] *= np.sign(np.linalg.det(axes))  # a rotation, not a mirror
    turn = Gf.Matrix3d(*axes.T.ravel().tolist()).ExtractRotation().GetQuat()  # Gf multiplies rows from the left
    api.CreateMassAttr(model.mass.volume_abs)
    api.CreateCenterOfMassAttr(Gf.Vec3f(*model.mass.centre_abs.tolist()))
    api.CreateDiagonalInertiaAttr(Gf.Vec3f(*moments.tolist()))
    api.CreatePrincipalAxesAttr(Gf.Quatf(turn))


def stage_bytes(layer: Any, ending: str) -> bytes:
    """The bytes of a layer as a file: text for ``usda``, else binary."""
    import tempfile
    from pathlib import Path

    if ending == "usda":
        return str(layer.ExportToString()).encode()
    with tempfile.TemporaryDirectory(prefix="rlacd-") as folder:  # the binary form can only be written to a file
        path = Path(folder) / f"stage.{ending}"
        layer.Export(str(path))
        return path.read_bytes()
