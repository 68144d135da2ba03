"""Random shapes full of degeneracies, each a function of its seed alone.

A shape combines primitives on a coarse grid, so that faces, edges and vertices coincide, by boolean operations or as a
plain heap; then it is damaged in the ways triangle files usually are. `Shape.steps` lists what was done.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from typing import TypeAlias

import manifold3d
import numpy as np
import numpy.typing as npt

from fuzz.primitives import PRIMITIVES

Floats: TypeAlias = npt.NDArray[np.float64]
Ints: TypeAlias = npt.NDArray[np.int64]
Random: TypeAlias = np.random.Generator

NEARLY = (0.0, 1e-15, 1e-12, 1e-9, 1e-6, 1e-4)
"""Distance between features meant to coincide, for primitives with sides of 1 to 4."""


HOLLOW = 0.1
"""Share of the shapes that have closed cavities."""


@dataclass(frozen=True)
class Shape:
    """Triangles and how they were made.

    Attributes
    ----------
    vertices : float64 [V, 3]
    faces : int64 [F, 3]
    steps
        The operations, in words.
    is_closed
        Whether the surface bounds a solid exactly: nothing was damaged.
    axes : float64 [H, 2, 3]
        From end to end of the holes in a plate, all equal, and nothing else is a passage; empty if that is unknown.
    hole : float
        Radius of the largest ball that passes them.
    """

    vertices: Floats
    faces: Ints
    steps: tuple[str, ...] = field(default=())
    is_closed: bool = False
    axes: Floats = field(default_factory=lambda: np.empty((0, 2, 3)))
    hole: float = 0.0

    def after(self, step: str, vertices: Floats, faces: Ints, is_closed: bool = False) -> Shape:
        return Shape(vertices, faces, (*self.steps, step), is_closed and self.is_closed)


def make_shape(seed: int) -> Shape:
    """Make the shape of a seed."""
    random = np.random.default_rng([seed, 1])
    if np.random.default_rng([seed, 3]).random() < PLATES:
        return placed(perforated(random), random)
    compose = pick(random, COMPOSITIONS)
    shape = hollow(random) if np.random.default_rng([seed, 5]).random() < HOLLOW else compose(random)
    for _ in range(int(random.choice(4, p=[0.5, 0.25, 0.15, 0.1]))):
        shape = pick(random, FAULTS)(shape, random)
    return placed(shape, random)


def pick(random: Random, choices: dict[str, Callable[..., Shape]]) -> Callable[..., Shape]:
    return choices[str(random.choice(list(choices)))]


# --- combining primitives ---------------------------------------------------------------------------------------------


def piece(random: Random, spread: float = 4) -> Shape:
    """A primitive of integer size at an integer position, sometimes rotated, exactly or nearly."""
    name = str(random.choice(list(PRIMITIVES)))
    vertices, faces = PRIMITIVES[name](random)
    vertices = (vertices - vertices.min(axis=0)) * random.integers(1, 5, 3)
    how = random.choice(["straight", "quarter", "free", "nearly"], p=[0.5, 0.2, 0.2, 0.1])
    if how == "quarter":
        vertices = vertices[:, random.permutation(3)]
        faces = faces if signed_volume(vertices, faces) > 0 else faces[:, ::-1]
    elif how != "straight":
        vertices = vertices @ rotation(random, 1.0 if how == "free" else float(random.choice(NEARLY))).T
    place = random.integers(0, int(spread) + 1, 3) + random.choice(NEARLY, 3) * random.choice([0, 1])
    return Shape(vertices + place, faces, (f"{name} {how}",), True)


def heap(random: Random) -> Shape:
    """Primitives that cross, contain or touch each other."""
    pieces = [piece(random) for _ in range(random.integers(1, 6))]
    return replace(concatenated(pieces), is_closed=len(pieces) == 1)


def carved(random: Random) -> Shape:
    """Unions and differences of primitives: one closed surface."""
    first = piece(random, 1)
    solid = as_manifold(first)
    if solid.is_empty():
        return replace(first, is_closed=False)
    steps = []
    for _ in range(random.integers(1, 7)):
        other = piece(random, 3)
        operation = str(random.choice(["add", "add", "subtract", "intersect"], p=[0.4, 0.2, 0.35, 0.05]))
        kind = {"add": manifold3d.OpType.Add, "subtract": manifold3d.OpType.Subtract}
        result = manifold3d.Manifold.batch_boolean(
            [solid, as_manifold(other)], kind.get(operation, manifold3d.OpType.Intersect)
        )
        if not result.is_empty():
            solid = result
            steps.append(f"{operation} {other.steps[0]}")
    return from_manifold(solid, ("carved", *steps))


def row(random: Random) -> Shape:
    """Copies in a row: stairs, combs, fences; neighbours touch, overlap slightly or leave a slit."""
    one = piece(random, 0)
    size = np.ptp(one.vertices, axis=0)
    gap = float(random.choice([0.0, *NEARLY, -0.1, 0.1, 0.5]))
    step = np.where(random.random(3) < 0.5, size + gap, 0.0)
    return concatenated([replace(one, vertices=one.vertices + i * step) for i in range(random.integers(2, 9))])


def shells(random: Random) -> Shape:
    """Nested copies of a surface; inner ones may be flipped."""
    one = piece(random, 0)
    center = one.vertices.mean(axis=0)
    inner = []
    for i in range(random.integers(1, 5)):
        share = 1 - float(random.choice([0.0, 1e-9, 1e-6, 1e-3, 0.02, 0.2])) * (i + 1)
        turned = one.faces[:, ::-1] if random.random() < 0.5 else one.faces
        inner.append(replace(one, vertices=center + share * (one.vertices - center), faces=turned))
    return concatenated([one, *inner])


def hollow(random: Random) -> Shape:
    """A box with closed cavities in some of its octants, and in some of these a body that stands free."""
    found = [Shape(*PRIMITIVES["box"](random), ("hollow box",), True)]
    for octant in random.permutation(8)[: random.integers(1, 4)]:
        middle = 0.25 * np.array([octant // 4, octant // 2 % 2, octant % 2]) * 2 - 0.25
        one = Shape(*PRIMITIVES[str(random.choice(list(PRIMITIVES)))](random), ("cavity",))
        size = float(random.choice([0.02, 0.2, 0.45]))
        within = size * (one.vertices - (one.vertices.min(axis=0) + one.vertices.max(axis=0)) / 2)
        within /= np.ptp(one.vertices, axis=0).max()
        found.append(replace(one, vertices=within + middle, faces=one.faces[:, ::-1]))
        if random.random() < 0.3:
            solid = PRIMITIVES["box"](random)
            around = manifold3d.Manifold(manifold3d.Mesh64(within + middle, one.faces.astype(np.uint64)))
            inner = manifold3d.Manifold.cube([0.1 * size] * 3, True).translate(middle)
            if (inner ^ around).volume() > 0.999 * inner.volume():
                found.append(Shape(0.1 * size * solid[0] + middle, solid[1], ("with a body in it",)))
    joined = concatenated(found)
    return replace(joined, vertices=joined.vertices * random.integers(1, 4, 3), is_closed=True)


def sheets(random: Random) -> Shape:
    """Open surfaces: waves, folded strips."""
    found = []
    for _ in range(random.integers(1, 4)):
        n, m = random.integers(2, 6, 2)
        x, y = np.meshgrid(np.linspace(0, 3, n), np.linspace(0, 3, m), indexing="ij")
        z = random.choice([0.0, 0.3, 1.0]) * np.sin(random.uniform(0, 4) * x + random.uniform(0, 4) * y)
        vertices = np.stack([x, y, z], axis=-1).reshape(-1, 3) @ rotation(random, 1.0).T
        i, j = (grid.ravel() for grid in np.meshgrid(np.arange(n - 1), np.arange(m - 1), indexing="ij"))
        a, b = i * m + j, (i + 1) * m + j
        faces = np.concatenate([np.stack([a, b, a + 1], axis=1), np.stack([a + 1, b, b + 1], axis=1)])
        found.append(Shape(vertices, faces, (f"sheet {n} x {m}",)))
    return concatenated(found)


def triangles(random: Random) -> Shape:
    """Random triangles, often on few points, so that they share vertices, cross and repeat."""
    points = int(random.choice([3, 4, 6, 12]))
    vertices = random.choice([random.normal(size=(points, 3)), random.integers(0, 3, (points, 3)).astype(float)])
    faces = random.integers(0, points, (int(random.choice([1, 2, 4, 8])), 3))
    return Shape(vertices, faces, (f"{len(faces)} triangles among {points} points",))


def perforated(random: Random) -> Shape:
    """A plate with equal holes: round ones, triangles, squares or slots, in rows."""
    sides, thickness = int(random.choice([3, 4, 4, 8])), float(random.choice([0.02, 0.2, 1.0, 3.0]))
    count = random.integers(1, 4, 2)
    radius = float(random.uniform(0.1, 0.42))
    long = float(random.choice([0.0, 0.0, 0.7]))
    hole = manifold3d.Manifold.cylinder(2 * thickness, radius, radius, sides, True).rotate((0, 0, 180 / sides))
    hole = manifold3d.Manifold.batch_hull([hole.translate((0, y, 0)) for y in (-long, long)])
    places = np.array([(x + 0.5, 3 * y + 1.5, 0) for x in range(count[0]) for y in range(count[1])])
    plate = manifold3d.Manifold.cube((int(count[0]), 3 * int(count[1]), thickness)).translate((0, 0, -thickness / 2))
    solid = plate - manifold3d.Manifold.compose([hole.translate(place.tolist()) for place in places])
    shape = from_manifold(solid, (f"plate {thickness:g} thick, {len(places)} holes of {sides} sides, {long:g} long",))
    ends = places[:, None] + np.array([[0, 0, -thickness / 2], [0, 0, thickness / 2]])
    return replace(shape, axes=ends, hole=radius * float(np.cos(np.pi / sides)))


PLATES = 0.05
"""Share of the shapes that are perforated plates."""

COMPOSITIONS: dict[str, Callable[..., Shape]] = {
    "carved": carved,
    "carved again": carved,
    "heap": heap,
    "heap again": heap,
    "row": row,
    "shells": shells,
    "sheets": sheets,
    "triangles": triangles,
}


# --- damage typical of files ------------------------------------------------------------------------------------------


def jittered(shape: Shape, random: Random) -> Shape:
    size = float(random.choice(NEARLY[1:])) * 3
    return shape.after(
        f"jitter {size:g}", shape.vertices + size * random.normal(size=shape.vertices.shape), shape.faces
    )


def torn(shape: Shape, random: Random) -> Shape:
    """Give every triangle its own vertices, which nearly coincide."""
    size = float(random.choice(NEARLY))
    corners = shape.vertices[shape.faces].reshape(-1, 3)
    return shape.after(
        f"torn by {size:g}", corners + size * random.normal(size=corners.shape), np.arange(len(corners)).reshape(-1, 3)
    )


def doubled(shape: Shape, random: Random) -> Shape:
    """Repeat the whole surface, nearly in the same place."""
    shift = float(random.choice(NEARLY)) * random.normal(size=3)
    faces = shape.faces[:, ::-1] if random.random() < 0.3 else shape.faces
    return shape.after(
        f"doubled, {np.abs(shift).max():.1g} apart",
        np.concatenate([shape.vertices, shape.vertices + shift]),
        np.concatenate([shape.faces, faces + len(shape.vertices)]),
    )


def with_some_flipped(shape: Shape, random: Random) -> Shape:
    share = float(random.choice([0.05, 0.5, 1.0]))
    some = random.random(len(shape.faces)) < share
    return shape.after(
        f"{share:.0%} flipped", shape.vertices, np.where(some[:, None], shape.faces[:, ::-1], shape.faces)
    )


def with_some_dropped(shape: Shape, random: Random) -> Shape:
    share = float(random.choice([0.02, 0.1, 0.5]))
    kept = random.random(len(shape.faces)) >= share
    kept[0] = True
    return shape.after(f"{share:.0%} dropped", shape.vertices, shape.faces[kept])


def with_some_repeated(shape: Shape, random: Random) -> Shape:
    some = shape.faces[random.random(len(shape.faces)) < 0.2]
    some = np.array([np.roll(face, random.integers(3)) for face in some], dtype=np.int64).reshape(-1, 3)
    return shape.after(
        "faces repeated", shape.vertices, np.concatenate([shape.faces, some, some[::2, ::-1], shape.faces[:1]])
    )


def with_fins(shape: Shape, random: Random) -> Shape:
    """Add triangles that stick out of edges."""
    edges = shape.faces[random.integers(len(shape.faces), size=random.integers(1, 5))][:, :2]
    tips = shape.vertices[edges].mean(axis=1) + random.normal(size=(len(edges), 3))
    corner = len(shape.vertices) + np.arange(len(edges))
    return shape.after(
        f"{len(edges)} fins",
        np.concatenate([shape.vertices, tips]),
        np.concatenate([shape.faces, np.column_stack([edges, corner])]),
    )


def with_needles(shape: Shape, random: Random) -> Shape:
    """Split faces at a point on or nearly on an edge that the neighbour does not share."""
    some = random.permutation(len(shape.faces))[: random.integers(1, 6)]
    a, b, c = shape.faces[some].T
    along = random.choice([0.5, 1e-12, 1e-9, 1e-6, 1 / 3], (len(some), 1))
    off = random.choice(NEARLY, (len(some), 1))
    points = shape.vertices
    middle = (1 - along) * points[a] + along * points[b]
    middle += off * (points[c] - middle)
    m = len(points) + np.arange(len(some))
    pieces = [np.stack(corners, axis=1) for corners in ((a, m, c), (m, b, c), (a, b, m))]
    pieces = pieces if random.random() < 0.5 else pieces[:2]  # with the third it stays closed
    return shape.after(
        f"{len(some)} needles",
        np.concatenate([points, middle]),
        np.concatenate([np.delete(shape.faces, some, axis=0), *pieces]),
    )


def with_faces_of_no_area(shape: Shape, random: Random) -> Shape:
    some = shape.faces[random.integers(len(shape.faces), size=5)]
    return shape.after(
        "faces of no area", shape.vertices, np.concatenate([shape.faces, some[:, [0, 0, 1]], some[:2][:, [2, 2, 2]]])
    )


def rounded(shape: Shape, random: Random) -> Shape:
    """Round coordinates to a grid, like single precision or few decimals."""
    steps = float(random.choice([2.0, 64.0, 1000.0]))
    if random.random() < 0.4:
        return shape.after("float32", shape.vertices.astype(np.float32).astype(np.float64), shape.faces)
    return shape.after(f"rounded to 1/{steps:g}", np.round(shape.vertices * steps) / steps, shape.faces)


def flattened(shape: Shape, random: Random) -> Shape:
    factor = float(random.choice([0.0, 1e-16, 1e-12, 1e-9, 1e-6, 1e-3, 1e-2]))
    scales = np.ones(3)
    scales[random.permutation(3)[: random.integers(1, 3)]] = factor
    return shape.after(f"flattened by {factor:g}", shape.vertices * scales, shape.faces, factor >= 1e-3)


def stretched(shape: Shape, random: Random) -> Shape:
    factor = float(random.choice([10.0, 100.0, 1e4, 1e6]))
    return shape.after(f"stretched by {factor:g}", shape.vertices * [1, factor, 1], shape.faces, factor <= 100)


def with_stray_points(shape: Shape, random: Random) -> Shape:
    """Add distant points that no face uses, and sometimes one face that does."""
    far = float(random.choice([10.0, 1e3, 1e6]))
    vertices = np.concatenate([shape.vertices, far * random.normal(size=(3, 3))])
    if random.random() < 0.7:
        return shape.after("stray points", vertices, shape.faces, True)
    face = [[0, len(vertices) - 1, len(vertices) - 2]]
    return shape.after(f"a face {far:g} away", vertices, np.concatenate([shape.faces, face]))


def with_numbers_that_are_none(shape: Shape, random: Random) -> Shape:
    vertices = shape.vertices.copy()
    some = random.integers(len(vertices), size=random.integers(1, 4))
    vertices[some, random.integers(3)] = random.choice([np.nan, np.inf, -np.inf])
    return shape.after("not finite", vertices, shape.faces)


FAULTS: dict[str, Callable[..., Shape]] = {
    function.__name__: function
    for function in (
        jittered,
        torn,
        doubled,
        with_some_flipped,
        with_some_dropped,
        with_some_repeated,
        with_fins,
        with_needles,
        with_faces_of_no_area,
        rounded,
        flattened,
        stretched,
        with_stray_points,
        with_numbers_that_are_none,
    )
}


def placed(shape: Shape, random: Random) -> Shape:
    """Rotate, scale and move the whole shape."""
    vertices, ends = shape.vertices, shape.axes.reshape(-1, 3)
    turn = float(random.choice([0.0, 0.0, 1.0, 1e-9]))
    if turn:
        with np.errstate(invalid="ignore"):
            turned = rotation(random, turn).T
            vertices, ends = vertices @ turned, ends @ turned
    scale = float(random.choice([1, 1, 1, 1e-3, 1e3, 1e-12, 1e12, 1e-30, 1e30]))
    offset = float(random.choice([0, 0, 0, 0, 1e3, 1e6, 1e8]))
    steps = tuple(
        f"{what} {x:g}" for what, x in (("turn", turn), ("scale", scale), ("offset", offset)) if x not in (0, 1)
    )
    closed = shape.is_closed and offset < 1e6  # far away, distinct vertices become equal
    away = offset * scale * random.normal(size=3)
    axes = (ends * scale + away).reshape(-1, 2, 3)[: len(ends) if closed else 0]
    return Shape(vertices * scale + away, shape.faces, (*shape.steps, *steps), closed, axes, shape.hole * scale)


# --- helpers ----------------------------------------------------------------------------------------------------------


def rotation(random: Random, angle: float) -> Floats:
    """A rotation matrix [3, 3] about a random axis, by up to `angle` radians."""
    x, y, z = random.normal(size=3)
    length = float(np.sqrt(x * x + y * y + z * z))
    cross = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]]) / length
    turn = angle * random.uniform(-1, 1)
    return np.asarray(np.eye(3) + np.sin(turn) * cross + (1 - np.cos(turn)) * cross @ cross)


def signed_volume(vertices: Floats, faces: Ints) -> float:
    a, b, c = (vertices[faces[:, k]] - vertices[0] for k in range(3))
    return float(np.einsum("ij,ij->i", np.cross(a, b), c).sum() / 6)


def concatenated(shapes: list[Shape]) -> Shape:
    first = np.cumsum([0, *(len(shape.vertices) for shape in shapes)])
    return Shape(
        np.concatenate([shape.vertices for shape in shapes]),
        np.concatenate([shape.faces + start for shape, start in zip(shapes, first, strict=False)]),
        sum((shape.steps for shape in shapes), ()),
    )


def as_manifold(shape: Shape) -> manifold3d.Manifold:
    return manifold3d.Manifold(manifold3d.Mesh64(np.ascontiguousarray(shape.vertices), shape.faces.astype(np.uint64)))


def from_manifold(solid: manifold3d.Manifold, steps: tuple[str, ...]) -> Shape:
    mesh = solid.to_mesh64()
    vertices = np.array(mesh.vert_properties[:, :3], dtype=np.float64)
    return Shape(vertices, np.array(mesh.tri_verts, dtype=np.int64), steps, True)
