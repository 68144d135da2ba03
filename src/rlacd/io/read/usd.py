"""USD files (usd, usda, usdc, usdz), read by OpenUSD in a process of its own, which a damaged file may crash."""

from __future__ import annotations

from importlib.util import find_spec
from pathlib import Path
from typing import Any

import numpy as np
import trimesh

from rlacd.errors import MissingExtraError
from rlacd.io.read.apart import answer_of
from rlacd.io.read.contents import Contents
from rlacd.io.read.trimesh_scene import geometry_of
from rlacd.solid.input_mesh import Asset

SERVER = "rlacd.io.read.usd_stage:StageReader"


def read_usd(path: Path, _: bytes) -> Contents:
    """Read a stage: a node for each mesh.

    Invisible prims and those for other purposes than to be rendered (guides, proxies) are left out. Subdivision
    surfaces are read as their cages. A mesh has the colours and the surface of its material, without pictures.

    Raises
    ------
    MeshFileError
        It is damaged, refers to a file outside its folder or to none, or holds too much.
    MissingExtraError
        The extra ``usd`` is not installed.
    """
    if find_spec("pxr") is None:
        raise MissingExtraError("USD needs an extra: run  pip install 'rlacd[usd]'  and try again.")
    answer = answer_of(SERVER, path, "USD", {"path": str(path)}, {})
    scene = trimesh.Scene()
    for index, node in enumerate(answer.values["nodes"]):
        points = np.frombuffer(answer.blobs[f"{index}.points"]).reshape(-1, 3).copy()
        faces = np.frombuffer(answer.blobs[f"{index}.faces"], dtype=np.int64).reshape(-1, 3).copy()
        mesh = trimesh.Trimesh(points, faces, process=False)
        if node["look"]:
            mesh.visual = trimesh.visual.TextureVisuals(material=_material(node["look"]))
        transform = np.reshape(node["transform"], (4, 4))
        scene.add_geometry(mesh, node_name=node["name"], geom_name=node["name"], transform=transform)
    kept = len(scene.geometry) > 1 or any(one.visual.defined for one in scene.geometry.values())
    asset = Asset(scene, extension="usd") if kept else None
    return Contents(geometry_of(scene, path.name), (), answer.values["up"], answer.values["metres"], asset)


def _material(look: dict[str, list[float]]) -> Any:
    """A material of trimesh; UsdPreviewSurface gives colours as glTF does, in linear light."""
    opacity = look.get("opacity", [1.0])[0]
    return trimesh.visual.material.PBRMaterial(
        baseColorFactor=np.clip([*look.get("diffuseColor", [0.18] * 3), opacity], 0.0, 1.0),
        metallicFactor=float(np.clip(look.get("metallic", [0.0])[0], 0.0, 1.0)),
        roughnessFactor=float(np.clip(look.get("roughness", [0.5])[0], 0.0, 1.0)),
        emissiveFactor=np.clip(look.get("emissiveColor", [0.0] * 3), 0.0, 1.0),
        alphaMode="BLEND" if opacity < 1.0 else "OPAQUE",
    )
