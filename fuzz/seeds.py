"""Valid files of every format, which `fuzz.mutations` damages: real ones, and small meshes written in each."""

from __future__ import annotations

import csv
import re
import uuid
from collections.abc import Iterator
from dataclasses import replace
from importlib.util import find_spec
from itertools import chain, count
from pathlib import Path
from tempfile import TemporaryDirectory
from unittest import mock

import numpy as np
import trimesh

from fuzz.fbx import PIVOTED, Model, fbx
from fuzz.mutations import Seed, repacked
from fuzz.networks import q_network

LARGEST_SEED = 60_000

SMALL_MESHES = 12

CASES = Path(__file__).parents[1] / "tests" / "cases"
GMSH = CASES / "gmsh"

URDF = (
    '<?xml version="1.0"?>\n<robot name="r">\n<link name="a">\n<collision name="c">\n<origin xyz="0 0 1"/>\n'
    '<geometry><mesh filename="box.stl" scale="1 2 -1"/></geometry>\n</collision>\n</link>\n<link name="b"/>\n'
    '<joint name="j" type="fixed">\n<parent link="a"/>\n<child link="b"/>\n</joint>\n</robot>\n'
)
MJCF = (
    '<mujoco model="m">\n<compiler meshdir="."/>\n<include file="parts.xml"/>\n<worldbody>\n'
    '<body name="x" childclass="c">\n<geom name="g" mesh="b" mass="2"/>\n<geom type="box" size="1 1 1"/>\n</body>\n'
    "</worldbody>\n</mujoco>\n"
)
MJCF_PARTS = (
    '<mujoco>\n<default>\n<default class="c">\n<geom type="mesh" group="3"/>\n</default>\n</default>\n<asset>\n'
    '<mesh name="b" file="box.msh" scale="1 1 2"/>\n</asset>\n<worldbody>\n<geom mesh="b" type="mesh"/>\n'
    "</worldbody>\n</mujoco>\n"
)

OFF_LETTERS = {"N": " 0 0 1", "C": " 255 128 0 255", "ST": " 0.5 0.25"}
"""Numbers that each letter before ``OFF`` adds to a vertex's line, in this order."""


def seeds_from(meshes: Path | None) -> dict[str, list[Seed]]:
    """Valid files by format: those of the folder of real meshes, or of a few simple shapes."""
    return seeds_of_shapes() if meshes is None else seeds_of(meshes)


def seeds_of_shapes() -> dict[str, list[Seed]]:
    """Files of simple shapes, by format."""
    bodies = [trimesh.creation.box((2, 0.4, 0.4)), trimesh.creation.cylinder(0.3, 1, sections=5)]
    found: dict[str, list[Seed]] = {}
    for mesh in (*bodies, trimesh.util.concatenate(bodies)):
        for kind, seed in written(mesh):
            found.setdefault(kind, []).append(seed)
    return found


def seeds_of(meshes: Path) -> dict[str, list[Seed]]:
    """Collect real files, and small real meshes written in every format, by format."""
    found: dict[str, list[Seed]] = {}
    for path in sorted((meshes / "raw").glob("*")):
        if path.stat().st_size < LARGEST_SEED:
            found.setdefault(path.suffix[1:], []).append(Seed(path.read_bytes()))
    with open(meshes / "index.csv", encoding="utf-8", newline="") as listing:
        small = [row["file"] for row in csv.DictReader(listing) if 8 < int(row["faces"]) < 150]
    for name in small[:: max(1, len(small) // SMALL_MESHES)][:SMALL_MESHES]:
        mesh = trimesh.load_mesh(meshes / name, process=False)
        for kind, seed in chain(written(mesh), written_by_extras(mesh)):
            found.setdefault(kind, []).append(seed)
    found["npz"] = [Seed(q_network())]
    return found


def written(mesh: trimesh.Trimesh) -> Iterator[tuple[str, Seed]]:
    """Write a mesh in every format."""
    mesh = trimesh.Trimesh(mesh.vertices, mesh.faces, process=False)
    scene = trimesh.Scene()
    scene.add_geometry(mesh, node_name="first", geom_name="mesh")
    scene.graph.update("second", "first", matrix=trimesh.transformations.translation_matrix([3, 0, 0]), geometry="mesh")
    yield "obj", Seed(mesh.export(file_type="obj").encode())
    yield from (("off", Seed(off_variant(mesh, letters))) for letters in ("", "N", "STCN"))
    yield "stl", Seed(mesh.export(file_type="stl"))
    yield "stl", Seed(mesh.export(file_type="stl_ascii").encode())
    yield "ply", Seed(mesh.export(file_type="ply"))
    yield "ply", Seed(mesh.export(file_type="ply", encoding="ascii"))
    with mock.patch("uuid.uuid4", side_effect=(uuid.UUID(int=i) for i in count())):  # reproducible names
        yield "dae", Seed(re.sub(rb"\d{4}-\d\d-\d\dT[^<]*", b"2000-01-01T00:00:00", mesh.export(file_type="dae")))
        yield "3mf", Seed(repacked({}, scene.export(file_type="3mf")))
    yield "glb", Seed(scene.export(file_type="glb"))
    yield "xyz", Seed("\n".join(" ".join(map(str, row)) for row in mesh.vertices.tolist()).encode())
    files = scene.export(file_type="gltf")
    yield "gltf", Seed(files.pop("model.gltf"), files)
    counts = np.array([len(mesh.vertices), 0, 0, len(mesh.faces)], "<i4").tobytes()
    msh = counts + mesh.vertices.astype("<f4").tobytes() + mesh.faces.astype("<i4").tobytes()
    yield "msh", Seed(msh)
    yield from (("msh", Seed(path.read_bytes())) for path in sorted(GMSH.glob("*.msh")))
    yield "urdf", Seed(URDF.encode(), {"box.stl": mesh.export(file_type="stl")})
    yield "xml", Seed(MJCF.encode(), {"parts.xml": MJCF_PARTS.encode(), "box.msh": msh})


def written_by_extras(mesh: trimesh.Trimesh) -> Iterator[tuple[str, Seed]]:
    """Write a mesh in the formats of the extras that are installed: Draco, FBX, USD; STEP and IGES files are others."""
    if find_spec("DracoPy"):
        yield "glb", Seed(trimesh.Scene(mesh).export(file_type="glb", extension_draco=True))
    if find_spec("ufbx"):
        model = Model("mesh", mesh.vertices, mesh.faces.tolist(), (1.0, 0.0, 0.0), properties=PIVOTED)
        yield from (("fbx", Seed(fbx([model, replace(model, below=0)], text=text))) for text in (False, True))
    if find_spec("cascadio"):
        yield "step", Seed((CASES / "stand.step").read_bytes())
        yield "igs", Seed((CASES / "ball_inch.igs").read_bytes())
    if not find_spec("pxr"):
        return
    from pxr import Sdf, Usd, UsdGeom, UsdUtils, Vt

    with TemporaryDirectory(prefix="rlacd-fuzz-") as scratch:
        for kind in ("usda", "usdc"):
            path = Path(scratch) / f"mesh.{kind}"
            stage = Usd.Stage.CreateNew(str(path))
            shape = UsdGeom.Mesh.Define(stage, "/top/mesh")
            shape.CreatePointsAttr(Vt.Vec3fArray.FromNumpy(mesh.vertices.astype(np.float32)))
            shape.CreateFaceVertexCountsAttr(Vt.IntArray([3] * len(mesh.faces)))
            shape.CreateFaceVertexIndicesAttr(Vt.IntArray(mesh.faces.ravel().tolist()))
            stage.Save()
            yield kind, Seed(path.read_bytes())
        packed = Path(scratch) / "mesh.usdz"
        UsdUtils.CreateNewUsdzPackage(Sdf.AssetPath(str(path)), str(packed))
        yield "usdz", Seed(packed.read_bytes())


def off_variant(mesh: trimesh.Trimesh, letters: str) -> bytes:
    """Write a mesh as an OFF file, with the vertex data that the letters before its keyword announce."""
    behind = "".join(text for letter, text in OFF_LETTERS.items() if letter in letters)
    lines = [f"{letters}OFF # {mesh.extents}", f"{len(mesh.vertices)} {len(mesh.faces)} 0"]
    lines += [f"{x} {y} {z}{behind}" for x, y, z in mesh.vertices.tolist()]
    lines += [f"3 {a} {b} {c}{' 255 0 0' * ('C' in letters)}" for a, b, c in mesh.faces.tolist()]
    return "\n".join(lines).encode()
