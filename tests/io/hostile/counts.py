"""Counts that a header promises, and text that costs more than its length."""

from __future__ import annotations

import struct

import numpy as np

from tests.io.hostile.registry import BOX, harmless, refused

PLY = "ply\nformat {kind} 1.0\n{elements}end_header\n"
XYZ = "property float x\nproperty float y\nproperty float z\n"
LIST = "property list {count} int vertex_indices\n"


def ply(elements: str, body: bytes = b"\1" * 1000, kind: str = "binary_little_endian") -> bytes:
    return PLY.format(kind=kind, elements=elements).encode() + body


refused("a trillion vertices.ply", "declares|again")(
    lambda: ply(f"element vertex {10**12}\n{XYZ}element face 1\n{LIST.format(count='uchar')}")
)


@refused("thirty thousand lists.ply", "again")
def _() -> bytes:
    lists = "".join(f"property list uchar int a{i}\n" for i in range(30_000))
    return ply(f"element vertex 3\n{XYZ}element face 1\n{lists}", bytes(40_000))


refused("a trillion vertices in text.ply", "declares")(
    lambda: ply(f"element vertex {10**12}\n{XYZ}", b"0 0 0\n1 0 0\n0 1 0\n", "ascii")
)


@refused("counts that add up by a negative one.ply", "where a count belongs|negative")
def _() -> bytes:
    elements = f"element vertex {10**9}\n{XYZ}element face {-(10**9) + 50}\nproperty float a\n" + XYZ.replace("x", "b")
    return ply(elements.replace("property float b\n", "property int b\n"))


@refused("a face of two billion corners.ply", "again|declares")
def _() -> bytes:
    body = np.zeros(9, "<f4").tobytes() + struct.pack("<i", 2 * 10**9) + b"\0" * 100
    return ply(f"element vertex 3\n{XYZ}element face 1\n{LIST.format(count='int')}", body)


refused("faces without corners, a billion of them.ply", "declares|again")(
    lambda: ply(f"element vertex 3\n{XYZ}element face {10**9}\n{LIST.format(count='uchar')}", b"\0" * 5000)
)
refused("ten million empty lines of FORMAT  ASCII.ply", "declares|again")(
    lambda: ply(f"element vertex {10**7}\n{XYZ}", b"\n" * 10**7, " ASCII")
)
refused("four billion triangles.stl", "declares 4294967295 triangles")(lambda: b"\0" * 80 + b"\xff" * 4 + b"\0" * 500)
refused("a comment of ten million characters, and nothing else.off", "counts|empty")(lambda: b"#" * 10**7)
refused("a face of vertex 10^12.obj", "vertex|again")(lambda: f"v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 {10**12}\n".encode())
refused("a face of a vertex with a million digits.obj", "vertex|again|digits")(
    lambda: b"v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 " + b"9" * 10**6 + b"\nf 1 2 3 1\n"
)
refused("only numbers that are too large.obj", "NaN or infinite")(
    lambda: b"v 1e999999 0 0\nv 1 -1e999999 0\nv 0 nan 1e999999\nf 1 2 3\n"
)


@harmless("a hundred thousand bodies of one name.stl")
def _() -> bytes:
    corners = "".join(
        f"facet normal 0 0 0\nouter loop\n{''.join(f'vertex {x} {y} {z}' + chr(10) for x, y, z in triangle)}endloop\n"
        "endfacet\nendsolid a\nsolid a\n"
        for triangle in BOX.triangles
    )
    return b"solid a\n" + b"endsolid a\nsolid a\n" * 100_000 + corners.encode() + b"endsolid a\n"


@harmless("ten thousand bodies that end and begin in one line.stl")
def _() -> bytes:
    corners = "".join(
        "".join(f"vertex {x} {y} {z}\n" for x, y, z in triangle) + "endsolid solid a\n" for triangle in BOX.triangles
    )
    return ("solid a\n" + corners * 1000 + "endsolid\n").encode()


@harmless("a hundred thousand materials.obj")
def _() -> bytes:
    vertices = "".join(f"v {x} {y} {z}\n" for x, y, z in BOX.vertices)
    faces = ["f {} {} {}\n".format(*(face + 1)) for face in BOX.faces]
    used = "".join(f"usemtl m{i}\n{faces[i % 12]}" for i in range(100_000))
    return (vertices + "vn 0 0 1\n" * 50_000 + "v 0 0 0\n" * 50_000 + used).encode()


@harmless("references out of the folder.obj")
def _() -> bytes:
    vertices = "".join(f"v {x} {y} {z}\n" for x, y, z in BOX.vertices)
    faces = "".join("f {} {} {}\n".format(*(face + 1)) for face in BOX.faces)
    libraries = "".join(f"mtllib {name}\n" for name in ("../../../../etc/passwd", "/dev/zero", "file:///dev/zero"))
    return (libraries + vertices + "usemtl evil\n" + faces).encode()


refused("ten million zeros.xyz", "again|empty")(lambda: b"\0" * 10**7 + b"x")
