"""Exact input and output files, read and written without the package's own code."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from fuzz.geometry import Floats, Ints


def write_mesh(path: Path, vertices: Floats, faces: Ints) -> Path:
    """Write a binary PLY with coordinates in full precision."""
    header = (
        "ply\nformat binary_little_endian 1.0\n"
        f"element vertex {len(vertices)}\n" + "".join(f"property double {axis}\n" for axis in "xyz") + ""
        f"element face {len(faces)}\nproperty list uchar int vertex_indices\nend_header\n"
    )
    rows = np.empty(len(faces), dtype=[("count", "u1"), ("corners", "<i4", 3)])
    rows["count"], rows["corners"] = 3, faces
    path.write_bytes(header.encode() + np.ascontiguousarray(vertices, dtype="<f8").tobytes() + rows.tobytes())
    return path


def read_hulls(content: bytes, ending: str) -> list[tuple[Floats, Ints]]:
    """Read the hulls of an .obj (one object each) or a .ply (a number on each face)."""
    vertices, faces, owner = _read_obj(content) if ending == "obj" else _read_ply(content)
    hulls = []
    for hull in range(int(owner.max(initial=-1)) + 1):
        own = faces[owner == hull]
        used, corner = np.unique(own, return_inverse=True)
        hulls.append((vertices[used], corner.reshape(-1, 3)))
    return hulls


def _read_obj(content: bytes) -> tuple[Floats, Ints, Ints]:
    vertices: list[list[float]] = []
    faces: list[list[int]] = []
    owner: list[int] = []
    hull = -1
    for line in content.decode().splitlines():
        kind, *words = line.split() or [""]
        if kind == "o":
            hull += 1
        elif kind == "v":
            vertices.append([float(word) for word in words[:3]])
        elif kind == "f":
            faces.append([int(word) - 1 for word in words])
            owner.append(hull)
    return np.array(vertices), np.array(faces), np.array(owner)


def _read_ply(content: bytes) -> tuple[Floats, Ints, Ints]:
    header, _, body = content.partition(b"end_header\n")
    counts = [int(line.split()[2]) for line in header.splitlines() if line.startswith(b"element")]
    point = np.dtype([("xyz", "<f8", 3), ("colour", "u1", 3)])
    face = np.dtype([("count", "u1"), ("corners", "<i4", 3), ("hull", "<i4")])
    points = np.frombuffer(body, point, counts[0])
    rows = np.frombuffer(body[counts[0] * point.itemsize :], face, counts[1])
    assert (rows["count"] == 3).all()
    return points["xyz"].copy(), rows["corners"].astype(np.int64), rows["hull"].astype(np.int64)
