"""What has to be the same bits on every machine: digests of the hulls of shapes made without any library's help.

    python -m tests.bits [MESH...] > bits.txt

The nightly workflow prints them on every system and compares the files. The shapes are quotients of small integers,
because the sines of two systems' libraries differ in the last bit.
"""

from __future__ import annotations

import hashlib
import random
import sys
from collections.abc import Callable, Iterator
from typing import Any

import numpy as np
import numpy.typing as npt

import rlacd

Shape = tuple[npt.NDArray[np.float64], npt.NDArray[np.int64]]
BOX = [[0, 2, 1], [1, 2, 3], [4, 5, 6], [5, 7, 6], [0, 1, 4], [1, 5, 4]]
BOX += [[2, 6, 3], [3, 6, 7], [0, 4, 2], [2, 4, 6], [1, 3, 5], [3, 7, 5]]
"""Triangles of a box whose corner i is at its upper end along x, y, z where bit 0, 1, 2 of i is set."""
POLICIES = ("learned", "rl-acd", "greedy-max-excess", "navacd", "random-10")
TURN = np.array([[2, -1, 2], [2, 2, -1], [-1, 2, 2]]) / 3
"""A rotation of rational entries."""


def turned(vertices: npt.ArrayLike) -> npt.NDArray[np.float64]:
    """Points [N, 3] turned, without a matrix product, which no two libraries round alike."""
    x, y, z = np.asarray(vertices, dtype=np.float64).T[:, :, None]
    return np.ascontiguousarray(x * TURN[0] + y * TURN[1] + z * TURN[2])


def chair() -> Shape:
    """Boxes that overlap: four legs, a seat, a back with a slot."""
    legs = [((x, y, 0), (x + 2, y + 2, 21)) for x in (0, 18) for y in (0, 18)]
    back = [((0, 18, 20), (3, 20, 46)), ((17, 18, 20), (20, 20, 46)), ((0, 18, 32), (20, 20, 46))]
    corners, faces = [], []
    for low, high in [*legs, ((0, 0, 20), (20, 20, 23)), *back]:
        faces += [[8 * (len(corners) // 8) + i for i in face] for face in BOX]
        corners += [[(low, high)[i & 1][0], (low, high)[i >> 1 & 1][1], (low, high)[i >> 2][2]] for i in range(8)]
    return turned(np.array(corners) / 46), np.array(faces)


def circle(n: int) -> list[tuple[float, float]]:
    """Points of the unit circle by its rational parametrisation, `n` in each quarter."""
    half = [((n * n - k * k) / (n * n + k * k), 2 * n * k / (n * n + k * k)) for k in range(-n, n)]
    return half + [(-x, -y) for x, y in half]


def ring() -> Shape:
    """A torus around z."""
    around, across = circle(7), circle(3)
    points = [[c * (3 + a), s * (3 + a), b] for c, s in around for a, b in across]
    n, m = len(around), len(across)
    quads = [(i * m + j, (i + 1) % n * m + j, i * m + (j + 1) % m) for i in range(n) for j in range(m)]
    others = [
        ((i + 1) % n * m + j, (i + 1) % n * m + (j + 1) % m, i * m + (j + 1) % m) for i in range(n) for j in range(m)
    ]
    return turned(np.array(points) / 4), np.array(quads + others)


def hills(side: int = 9, seed: int = 5) -> Shape:
    """A plate whose upper side is a random landscape."""
    draw = random.Random(seed)
    top = [[x, y, draw.randrange(4, 24) / 4] for x in range(side) for y in range(side)]
    n = side * side
    faces = []
    for x in range(side - 1):
        for y in range(side - 1):
            a, b, c, d = x * side + y, (x + 1) * side + y, (x + 1) * side + y + 1, x * side + y + 1
            faces += [[a, b, c], [a, c, d], [n + c, n + b, n + a], [n + d, n + c, n + a]]
    edge = [x * side for x in range(side)] + [(side - 1) * side + y for y in range(1, side)]
    edge += [x * side + side - 1 for x in range(side - 2, -1, -1)] + list(range(side - 2, 0, -1))
    for a, b in zip(edge, edge[1:] + edge[:1], strict=True):
        faces += [[a, n + a, b], [b, n + a, n + b]]
    return turned(np.array(top + [[x, y, 0] for x, y, _ in top]) / side), np.array(faces)


def torn() -> Shape:
    """The torus with holes."""
    vertices, faces = ring()
    return vertices, np.array([face for i, face in enumerate(faces) if i % 9])


FAST: dict[str, Any] = {"quality": "fast"}
CASES: dict[str, tuple[Callable[[], Shape], dict[str, Any]]] = {
    "chair": (chair, {}),
    "chair, overlapping": (chair, {**FAST, "overlap": 0.01}),
    "chair, primitives": (chair, {**FAST, "primitives": True}),
    "chair, not merged": (chair, {**FAST, "merge": False}),
    "chair, few": (chair, {**FAST, "max_hulls": 5}),
    "ring": (ring, {}),
    "ring, best": (ring, {"quality": "best", "search_steps": 20}),
    "ring, passages": (ring, {**FAST, "criterion": rlacd.NavigableSpace(radius=0.2)}),
    "ring, kept open": (ring, {**FAST, "keep_open": 0.9}),
    "ring, round": (ring, {**FAST, "primitives": ["sphere", "capsule", "cylinder"], "threshold": 0.3}),
    "ring, limited": (ring, {**FAST, "max_vertices": 12}),
    "hills": (hills, FAST),
    "hills, volume": (hills, {**FAST, "criterion": "volume"}),
    "hills, distance in full": (hills, {**FAST, "criterion": "distance", "detail": "full"}),
    "torn": (torn, FAST),
    "torn, thin": (torn, {**FAST, "openings": "thin"}),
    "torn, solid": (torn, {**FAST, "openings": "solid", "resolution": 60, "gap": 0.06}),
    **{f"hills, {policy}": (hills, {**FAST, "policy": policy}) for policy in POLICIES},
}


def digest(hulls: list[Any]) -> str:
    """Of all vertices and faces, in their order."""
    sha = hashlib.sha256()
    for hull in hulls:
        sha.update(np.ascontiguousarray(hull.vertices, dtype="<f8").tobytes())
        sha.update(np.ascontiguousarray(hull.faces, dtype="<i8").tobytes())
    return sha.hexdigest()[:16]


def lines(meshes: list[str]) -> Iterator[str]:
    """One for each case and mesh: its name, the number of hulls, their digest."""
    for name, (shape, options) in CASES.items():
        hulls = rlacd.decompose(shape(), **options).hulls
        yield f"{digest(hulls)} {len(hulls):4} {name}"
    for path in meshes:
        hulls = rlacd.decompose(path).hulls
        yield f"{digest(hulls)} {len(hulls):4} {path}"


if __name__ == "__main__":
    for line in lines(sys.argv[1:]):
        print(line, flush=True)
