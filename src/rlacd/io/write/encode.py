"""Hulls as the bytes of a file: GLB, OBJ, PLY, STL.

Every encoder takes the hulls in the order of their names (``hull_000``, ``hull_001``, ...) and keeps each one a closed
convex hull *in the file*: the text formats and PLY hold float64 exactly, and for GLB and binary STL the hull is
recomputed after rounding to float32.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, TypeAlias

import numpy as np
import trimesh

from rlacd.io.write.glb import GltfFile, Placed
from rlacd.io.write.palette import hull_colors, linear_from_srgb
from rlacd.io.write.single_precision import Triangulated, placed_mesh, required_hull, rounded_hull
from rlacd.solid.arrays import FloatArray

if TYPE_CHECKING:
    from rlacd.extras.primitive import Primitive

GENERATOR = "rlacd"

Color: TypeAlias = np.ndarray[tuple[int, ...], np.dtype[np.uint8]]

VISUAL_COLOR: Color = np.array([180, 182, 186], dtype=np.uint8)
"""Colour of the input beside its hulls: grey, since its own colours are not kept."""


def hull_name(index: int) -> str:
    """``hull_000``, ``hull_001``, ..."""
    return f"hull_{index:03d}"


def encode_glb(
    hulls: Sequence[trimesh.Trimesh],
    names: Sequence[str] | None = None,
    visual: tuple[str, trimesh.Trimesh] | None = None,
    *,
    colored: bool = True,
) -> bytes:
    """Binary glTF 2.0 with a node, a mesh and, if `colored`, a material per hull, named `names`, after the `visual`.

    Positions in glTF are float32. A hull too far from the origin to keep its shape is stored about its own centre, with
    the translation in its node; all others are stored in place, for readers that ignore transforms.

    Raises
    ------
    OutputError
        A hull is too thin for its size for float32 even about its own centre.
    """
    file = GltfFile({"asset": {"version": "2.0", "generator": GENERATOR}, "scene": 0, "scenes": [{}]})
    if visual is not None:
        file.add(Placed(visual[0], *placed_mesh(visual[1]), linear_from_srgb(VISUAL_COLOR)), visual[0])
    names = names or [hull_name(index) for index in range(len(hulls))]
    for name, hull, color in zip(names, hulls, linear_from_srgb(hull_colors(len(hulls))), strict=True):
        file.add(Placed(name, *required_hull(hull, name, "as GLB"), color), name, colored=colored)
    return file.encoded()


def encode_obj(
    hulls: Sequence[trimesh.Trimesh],
    names: Sequence[str] | None = None,
    visual: tuple[str, trimesh.Trimesh] | None = None,
    *,
    colored: bool = True,
) -> bytes:
    """Wavefront OBJ with an object per hull, and every digit of the coordinates; if `colored`, colours of vertices.

    trimesh's writer prints a fixed number of decimals, which erases small meshes; here every number is the shortest
    text that reads back to the same float64. Hulls are named `names` and follow the `visual`, if there is one.
    """
    names = names or [hull_name(index) for index in range(len(hulls))]
    objects = list(zip(names, hulls, hull_colors(len(hulls)), strict=True))
    if visual is not None:
        objects.insert(0, (*visual, VISUAL_COLOR))
    lines = [f"# {GENERATOR}: {len(hulls)} convex hulls"]
    first = 1
    for name, mesh, color in objects:
        tint = "".join(f" {channel / 255.0:.3f}" for channel in color) if colored else ""
        lines.append(f"o {name}")
        lines += [f"v {x!r} {y!r} {z!r}{tint}" for x, y, z in mesh.vertices.tolist()]
        lines += [f"f {a} {b} {c}" for a, b, c in (mesh.faces + first).tolist()]
        first += len(mesh.vertices)
    return ("\n".join(lines) + "\n").encode()


def encode_plain_obj(mesh: Triangulated, texture: FloatArray | None = None) -> bytes:
    """One mesh as Wavefront OBJ that every reader accepts: no object, no colours, every digit.

    `texture` has coordinates in a picture for each vertex.
    """
    lines = [f"# {GENERATOR}", *(f"v {x!r} {y!r} {z!r}" for x, y, z in mesh.vertices.tolist())]
    if texture is not None:
        lines += [f"vt {u!r} {v!r}" for u, v in texture.tolist()]
    corner = "f {0} {1} {2}" if texture is None else "f {0}/{0} {1}/{1} {2}/{2}"
    lines += [corner.format(*face) for face in (mesh.faces + 1).tolist()]
    return ("\n".join(lines) + "\n").encode("ascii")


def encode_ply(hulls: Sequence[trimesh.Trimesh]) -> bytes:
    """Binary PLY in float64, coloured by vertex; the face property ``hull`` tells which hull a triangle belongs to.

    trimesh's writer has float32 only.
    """
    vertex = np.dtype([("xyz", "<f8", 3), ("rgb", "u1", 3)])
    face = np.dtype([("corners", "u1"), ("abc", "<i4", 3), ("hull", "<i4")])
    vertices = np.empty(sum(len(hull.vertices) for hull in hulls), dtype=vertex)
    faces = np.empty(sum(len(hull.faces) for hull in hulls), dtype=face)
    faces["corners"] = 3
    v = f = 0
    for index, (hull, color) in enumerate(zip(hulls, hull_colors(len(hulls)), strict=True)):
        here = slice(v, v + len(hull.vertices)), slice(f, f + len(hull.faces))
        vertices["xyz"][here[0]], vertices["rgb"][here[0]] = hull.vertices, color
        faces["abc"][here[1]], faces["hull"][here[1]] = hull.faces + v, index
        v, f = here[0].stop, here[1].stop
    header = [
        "ply",
        "format binary_little_endian 1.0",
        f"comment {GENERATOR}: {len(hulls)} convex hulls",
        f"element vertex {len(vertices)}",
        *(f"property double {axis}" for axis in "xyz"),
        *(f"property uchar {channel}" for channel in ("red", "green", "blue")),
        f"element face {len(faces)}",
        "property list uchar int vertex_indices",
        "property int hull",
        "end_header",
    ]
    return ("\n".join(header) + "\n").encode("ascii") + vertices.tobytes() + faces.tobytes()


def encode_stl(hulls: Sequence[trimesh.Trimesh]) -> bytes:
    """STL: binary for one hull, which every reader accepts; text with a ``solid`` per hull for several.

    Binary STL supports neither several solids nor float64, so text is also used for a single hull that float32 cannot
    represent.
    """
    if len(hulls) == 1 and (rounded := rounded_hull(hulls[0])) is not None:
        return bytes(trimesh.Trimesh(*rounded, process=False).export(file_type="stl"))
    solids = []
    for index, hull in enumerate(hulls):
        named = trimesh.Trimesh(hull.vertices, hull.faces, process=False, metadata={"name": hull_name(index)})
        solids.append(named.export(file_type="stl_ascii"))
    return "".join(solids).encode("ascii")


ENCODERS: dict[str, Callable[[Sequence[trimesh.Trimesh]], bytes]] = {
    "glb": encode_glb,
    "obj": encode_obj,
    "ply": encode_ply,
    "stl": encode_stl,
}


_PREFIXES = {"box": "UBX", "sphere": "USP", "capsule": "UCP"}

ENGINE_NAMES: dict[str, Callable[[str, int, Primitive | None], str]] = {
    "unreal": lambda name, index, shape: f"{_PREFIXES.get(shape.kind if shape else '', 'UCX')}_{name}_{index:02d}",
    "godot": lambda name, index, primitive: f"{name}_{index:03d}-convcolonly",
}
"""Names of hulls. Unreal: ``UCX_<name>_00``, ``UCX_<name>_01``, ... are the hulls of the node or mesh ``<name>``; boxes
begin with ``UBX``, spheres with ``USP``, capsules with ``UCP``. Godot: nodes ending in ``-convcolonly`` become convex
shapes of a static body and are not drawn."""
