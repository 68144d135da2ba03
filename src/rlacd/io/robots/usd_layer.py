"""Colliding meshes of a USD stage, and the layer that puts hulls in their place; runs in a process of its own."""

from __future__ import annotations

import os
import re
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from rlacd.errors import MeshFileError
from rlacd.io.read.apart import Answered, served
from rlacd.io.read.usd_stage import check_files, prim_geometry
from rlacd.io.write.usd import mesh_prim, stage_bytes
from rlacd.pool import Blobs, Values

OF_THE_MESH = re.compile(
    r"(Mass|RigidBody|MeshCollision|ConvexHull|ConvexDecomposition|SDFMesh|TriangleMesh|SkelBinding)"
)
"""Schemas that say how a mesh itself collides and moves; the others go to its hulls too."""

OF_COLLISIONS = re.compile(r"(physics|physx\w*|newton|mjc):|material:binding:physics$|material:binding$")
"""Properties that go from a mesh to its hulls."""

OF_BODIES = re.compile(
    r"physics:(approximation|mass|density|rigid|velocity|angular|kinematic|start|diagonal|principal|center|simulation)"
)
"""Those of them that are of a rigid body, or of the mesh itself."""

TO_COLLIDERS = re.compile(r"collection:.*:(in|ex)cludes$|physics:filteredPairs$|physxContactReport:reportPairs$")
"""Relationships that name colliders, any number of them: they name the hulls too."""

ROUND = 1e-5
"""Share of a scale up to which another is the same: stages say many in single precision."""

TO_FRAMES = re.compile(r"physics:body[01]$")
"""Relationships that name where something is, which a mesh still says."""


@served
def rewrite(values: Values, blobs: Blobs) -> Answered:
    """List the colliding meshes; if ``counts`` are given, write the layer with so many hulls for each, and those of the
    one in ``leads`` for the others: over the stage as ``sublayer``, or all in one."""
    from pxr import Sdf, Usd, UsdGeom, UsdPhysics

    path = Path(values["path"])
    check_files(path)
    original = Sdf.Layer.FindOrOpen(str(path))
    layer = Sdf.Layer.CreateAnonymous(".usda")
    for key in original.pseudoRoot.ListInfoKeys():  # of a stage, only its topmost layer says up axis, unit, ...
        if key not in ("subLayers", "subLayerOffsets"):
            layer.pseudoRoot.SetInfo(key, original.pseudoRoot.GetInfo(key))
    layer.subLayerPaths = [original.realPath]
    stage = Usd.Stage.Open(layer)
    colliders, others, warnings = _colliders(path, stage)
    if "counts" in values:
        for body in {body.GetPath(): body for prim in colliders if (body := _body(prim))}.values():
            _fix_mass(path, body, values["masses"])
        hulls: dict[Any, list[Any]] = {}
        for index, (prim, count, lead) in enumerate(zip(colliders, values["counts"], values["leads"], strict=True)):
            shapes = [(blobs[f"{index}.{k}.points"], blobs[f"{index}.{k}.faces"]) for k in range(count)]
            hulls[prim.GetPath()] = _hulls(stage, prim, shapes) if lead == index else hulls[colliders[lead].GetPath()]
            UsdPhysics.CollisionAPI(prim).CreateCollisionEnabledAttr(False)
        left = _retarget(stage, hulls)
        _filter(stage, values["filtered"], hulls)
        files: list[str] = []
        if values["sublayer"] is None:
            layer, files = _flat(stage, path.absolute().parent)
        else:
            layer.subLayerPaths = [f"./{values['sublayer']}"]
        return {"warnings": left, "files": files}, {"layer": stage_bytes(layer, values["ending"])}
    nodes: list[Values] = []
    arrays: dict[str, bytes] = {}
    contacts = _Contacts(stage)
    for index, prim in enumerate(colliders):
        points, faces = prim_geometry(path, prim)
        said = {"path": str(prim.GetPath()), "scale": _scale(prim), "kind": contacts.kind(prim)}
        nodes.append({**said, **_place(prim)})
        arrays |= {f"{index}.points": points.tobytes(), f"{index}.faces": faces.tobytes()}
    whole = {"metres": float(UsdGeom.GetStageMetersPerUnit(stage)), "up": str(UsdGeom.GetStageUpAxis(stage)).lower()}
    kept = [{"path": str(prim.GetPath()), **_primitive(prim), **_place(prim)} for prim in others]
    return {"nodes": nodes, "kept": kept, "warnings": warnings, "joints": _joints(stage), **whole}, arrays


def _colliders(path: Path, stage: Any) -> tuple[list[Any], list[Any], list[str]]:
    """The meshes and the other shapes that collide; instances that hold meshes become prims of their own, as instances
    cannot be edited."""
    from pxr import Usd, UsdGeom, UsdPhysics

    opened = 0
    while True:
        prims = Usd.PrimRange(stage.GetPseudoRoot(), Usd.TraverseInstanceProxies(Usd.PrimDefaultPredicate))
        found = [prim for prim in prims if prim.HasAPI(UsdPhysics.CollisionAPI)]
        proxy = next((prim for prim in found if prim.IsInstanceProxy() and prim.IsA(UsdGeom.Mesh)), None)
        if proxy is None:
            break
        while not proxy.IsInstance() or proxy.IsInstanceProxy():
            proxy = proxy.GetParent()
        proxy.SetInstanceable(False)
        opened += 1
    warnings = [f"{opened} instances with colliding meshes are no longer instances."] if opened else []
    on = [prim for prim in found if UsdPhysics.CollisionAPI(prim).GetCollisionEnabledAttr().Get() is not False]
    groups = [prim for prim in on if not prim.IsA(UsdGeom.Gprim)]
    if groups:
        warnings.append(f"{len(groups)} prims collide and are no shapes, as {groups[0].GetPath()}: left unchanged.")
    if any(prim.IsA(UsdGeom.PointInstancer) for prim in stage.Traverse()):
        raise MeshFileError(f"{path} has a point instancer, which is not rewritten: convert its instances first")
    shapes = [prim for prim in on if prim.IsA(UsdGeom.Gprim)]
    meshes = [prim for prim in shapes if prim.IsA(UsdGeom.Mesh)]
    return meshes, [prim for prim in shapes if not prim.IsA(UsdGeom.Mesh)], warnings


def _primitive(prim: Any) -> Values:
    """The kind and sizes of a primitive that bodies are compared with, along its axes on the stage, and how these are
    turned to them; of other shapes an empty kind."""
    from pxr import Usd, UsdGeom

    def of(name: str) -> float:
        return float(prim.GetAttribute(name).Get(Usd.TimeCode.EarliestTime()))

    rows = np.array(UsdGeom.XformCache(Usd.TimeCode.EarliestTime()).GetLocalToWorldTransform(prim))[:3, :3]
    scale, kind, sizes, turn = np.linalg.norm(rows, axis=1), str(prim.GetTypeName()).lower(), list[float](), np.eye(4)
    spread = np.abs(rows @ rows.T - np.diag(scale**2)).max()
    if np.isfinite(rows).all() and scale.min() > 0 and spread <= ROUND * scale.min() ** 2:  # not sheared
        is_even = bool(np.ptp(scale) <= ROUND * scale.max())
        if kind == "cube":
            kind, sizes = "box", (of("size") / 2 * scale).tolist()
        elif kind == "sphere":
            kind, sizes = ("sphere" if is_even else "ellipsoid"), (of("radius") * scale).tolist()
        elif kind in ("capsule", "cylinder", "cone"):
            about = "XYZ".index(str(prim.GetAttribute("axis").Get()))
            turn[:3, :3] = np.roll(np.eye(3), 2 - about, axis=1)  # z to the axis
            around = np.delete(scale, about)
            if is_even or (kind != "capsule" and np.ptp(around) <= ROUND * around.max()):
                sizes = [of("radius") * float(around.max()), of("height") / 2 * float(scale[about])]
    return {"kind": kind if sizes else "", "sizes": sizes, "turn": turn.ravel().tolist()}


def _scale(prim: Any) -> list[float]:
    """How long a unit along each axis of a prim is on the stage."""
    from pxr import Usd, UsdGeom

    cache = UsdGeom.XformCache(Usd.TimeCode.EarliestTime())
    rows = np.array(cache.GetLocalToWorldTransform(prim))[:3, :3]
    lengths = np.linalg.norm(rows, axis=1)
    if not (np.isfinite(lengths) & (lengths > 0)).all():
        raise MeshFileError(f"{prim.GetPath()} is scaled to nothing, or to infinity: correct its scale")
    return [float(f"{length:.9g}") for length in lengths]


def _place(prim: Any) -> Values:
    """Where a mesh and its body stand."""
    from pxr import Usd, UsdGeom

    cache, body = UsdGeom.XformCache(Usd.TimeCode.EarliestTime()), _body(prim)
    pose, of_body = (np.array(cache.GetLocalToWorldTransform(each)).T for each in (prim, body or prim))
    places = {"pose": pose.ravel().tolist(), "body_pose": of_body.ravel().tolist()}
    return {**places, "body": str(body.GetPath()) if body else None}


class _Contacts:
    """What a stage says about the contacts of its meshes."""

    def __init__(self, stage: Any) -> None:
        from pxr import UsdPhysics

        prims = [*stage.Traverse()]
        links = [link for prim in prims for link in prim.GetAuthoredRelationships()]
        self._naming = [link for link in links if TO_COLLIDERS.match(link.GetName())]
        groups = [UsdPhysics.CollisionGroup(prim) for prim in prims if prim.IsA(UsdPhysics.CollisionGroup)]
        self._groups = [group.GetCollidersCollectionAPI().ComputeMembershipQuery() for group in groups]

    def kind(self, prim: Any) -> str | None:
        """Equal for meshes that may become one solid; None for one that is sheared, which stays apart."""
        from pxr import Usd, UsdGeom, UsdShade

        rows = np.array(UsdGeom.XformCache(Usd.TimeCode.EarliestTime()).GetLocalToWorldTransform(prim))[:3, :3]
        axes = rows / np.linalg.norm(rows, axis=1, keepdims=True)
        if not np.allclose((axes[:, None] * axes).sum(axis=2), np.eye(3), atol=1e-6):
            return None
        path = prim.GetPath()
        material, _ = UsdShade.MaterialBindingAPI(prim).ComputeBoundMaterial("physics")
        said = [*_schemas(prim), *(f"{each.GetName()} {_value(each)}" for each in _settings(prim))]
        said += [str(link.GetPath()) for link in self._naming if path in link.GetTargets()]
        said += [str(group.IsPathIncluded(path)) for group in self._groups]
        return " ".join([str(material.GetPath()) if material else "", *said])


def _value(each: Any) -> Any:
    return each.GetTargets() if hasattr(each, "GetTargets") else each.Get()


def _schemas(prim: Any) -> list[str]:
    """Schemas that go from a mesh to its hulls."""
    return [name for name in prim.GetAppliedSchemas() if not OF_THE_MESH.search(name)]


def _settings(prim: Any) -> list[Any]:
    """Properties that go from a mesh to its hulls."""
    authored = {each.GetName(): each for each in prim.GetAuthoredProperties()}
    return [authored[name] for name in authored if OF_COLLISIONS.match(name) and not OF_BODIES.match(name)]


def _body(prim: Any) -> Any:
    """The rigid body that a prim belongs to, if any."""
    from pxr import UsdPhysics

    while prim and not prim.HasAPI(UsdPhysics.RigidBodyAPI):
        prim = prim.GetParent()
    return prim


def _fix_mass(path: Path, body: Any, masses: Mapping[str, Any]) -> None:
    """State the mass, centre and inertia of a body, as they follow from its shapes before hulls are among them.

    Meshes that become hulls have `masses`: those of their reports, along their axes on the stage.
    """
    from pxr import Gf, Usd, UsdGeom, UsdPhysics

    cache, scale = UsdGeom.XformCache(Usd.TimeCode.EarliestTime()), np.array(_scale(body))

    def of(prim: Any) -> Any:
        mass = masses.get(str(prim.GetPath())) or _mass(*prim_geometry(path, prim), _scale(prim))
        to_body = np.array(cache.ComputeRelativeTransform(prim, body)[0]) * [*scale, 1]
        turn, inertia = to_body[:3, :3] / np.array(_scale(prim))[:, None], np.array(mass["inertia_abs"])
        bigger = abs(np.linalg.det(turn))
        spread = bigger * turn.T @ (np.eye(3) * np.trace(inertia) / 2 - inertia) @ turn  # the second moments
        said = UsdPhysics.RigidBodyAPI.MassInformation()
        said.volume = bigger * mass["volume_abs"]
        said.centerOfMass = Gf.Vec3f(*(mass["centre_abs"] @ turn + to_body[3, :3]).tolist())
        said.inertia = Gf.Matrix3f(*(np.eye(3) * np.trace(spread) - spread).ravel().tolist())
        said.localPos, said.localRot = Gf.Vec3f(0), Gf.Quatf(1)
        return said

    mass, inertia, centre, axes = UsdPhysics.RigidBodyAPI(body).ComputeMassProperties(of)
    api = UsdPhysics.MassAPI.Apply(body)
    api.CreateMassAttr(mass)
    api.CreateCenterOfMassAttr(Gf.Vec3f(*(np.array(centre) / scale).tolist()))
    api.CreateDiagonalInertiaAttr(inertia)
    api.CreatePrincipalAxesAttr(axes)


def _flat(stage: Any, folder: Path) -> tuple[Any, list[str]]:
    """All layers of the stage as one, and the files that it names, relative to a folder."""
    from pxr import UsdUtils

    layer, files = stage.Flatten(addSourceFileComment=False), []

    def relative(named: str) -> str:
        if not os.path.isabs(named):
            return named
        files.append(Path(os.path.relpath(named, folder)).as_posix())
        return f"./{files[-1]}"

    UsdUtils.ModifyAssetPaths(layer, relative)
    return layer, sorted(set(files))


def _retarget(stage: Any, hulls: Mapping[Any, list[Any]]) -> list[str]:
    """Let what names a mesh as a collider name its hulls too; returns warnings about what else names it."""
    left = []
    for prim in stage.Traverse():
        for link in prim.GetAuthoredRelationships():
            named = [path for path in link.GetTargets() if path in hulls]
            if named and TO_COLLIDERS.match(link.GetName()):
                for path in named:
                    for hull in hulls[path]:
                        link.AddTarget(hull)
            elif named and OF_COLLISIONS.match(link.GetName()) and not TO_FRAMES.match(link.GetName()):
                left.append(f"{link.GetPath()} names {named[0]}, which no longer collides: its hulls do.")
    return left


def _joints(stage: Any) -> list[tuple[str, str]]:
    """The rigid bodies that each joint connects."""
    from pxr import UsdPhysics

    pairs = []
    for prim in stage.Traverse():
        if prim.IsA(UsdPhysics.Joint):
            joint = UsdPhysics.Joint(prim)
            ends = [end for rel in (joint.GetBody0Rel(), joint.GetBody1Rel()) for end in rel.GetTargets()[:1]]
            bodies = [_body(end) for path in ends if (end := stage.GetPrimAtPath(path))]
            if len(bodies) == 2 and all(bodies) and bodies[0] != bodies[1]:
                pairs.append((str(bodies[0].GetPath()), str(bodies[1].GetPath())))
    return pairs


def _filter(stage: Any, pairs: Sequence[tuple[str, str]], hulls: Mapping[Any, list[Any]]) -> None:
    """Let pairs of bodies not collide; of meshes without a body, their hulls."""
    from pxr import UsdPhysics

    for pair in pairs:
        first, second = sorted(
            map(stage.GetPrimAtPath, pair), key=lambda prim: not prim.HasAPI(UsdPhysics.RigidBodyAPI)
        )
        is_body = second.HasAPI(UsdPhysics.RigidBodyAPI)
        named = [second.GetPath()] if is_body else hulls.get(second.GetPath(), [second.GetPath()])
        for path in named:
            UsdPhysics.FilteredPairsAPI.Apply(first).CreateFilteredPairsRel().AddTarget(path)


def _mass(points: Any, faces: Any, scale: list[float]) -> dict[str, Any]:
    import trimesh

    solid = trimesh.Trimesh(points * scale, faces, process=False)
    solid = solid if solid.is_volume else solid.convex_hull
    return {"volume_abs": solid.volume, "centre_abs": solid.center_mass, "inertia_abs": solid.moment_inertia}


def _hulls(stage: Any, prim: Any, hulls: list[tuple[bytes, bytes]]) -> list[Any]:
    """Put hulls beside a mesh, or below it if it is a rigid body; returns their paths."""
    from pxr import UsdGeom, UsdPhysics

    inside = prim.HasAPI(UsdPhysics.RigidBodyAPI)
    parent, name = (prim if inside else prim.GetParent()), f"{prim.GetName()}_hulls"
    while parent.GetChild(name):
        name += "_"
    group = UsdGeom.Xform.Define(stage, parent.GetPath().AppendChild(name))
    group.CreatePurposeAttr(UsdGeom.Tokens.guide)
    if not inside:
        moved = UsdGeom.Xformable(prim)
        group.AddTransformOp().Set(moved.GetLocalTransformation())
        group.SetResetXformStack(moved.GetResetXformStack())
    schemas, settings = _schemas(prim), _settings(prim)
    for number, (points, faces) in enumerate(hulls):
        corners, triangles = np.frombuffer(points, "<f4").reshape(-1, 3), np.frombuffer(faces, "<i4").reshape(-1, 3)
        hull = mesh_prim(stage, group.GetPath().AppendChild(f"hull_{number:03d}"), corners, triangles).GetPrim()
        UsdPhysics.CollisionAPI.Apply(hull)
        UsdPhysics.MeshCollisionAPI.Apply(hull).CreateApproximationAttr(UsdPhysics.Tokens.convexHull)
        for schema in schemas:
            hull.AddAppliedSchema(schema)
        for each in settings:
            each.FlattenTo(hull)
    return [hull.GetPath() for hull in group.GetPrim().GetChildren()]
