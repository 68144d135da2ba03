"""Closed test solids with known answers, and an independent reference for distances."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt
import trimesh
from hypothesis import strategies as st
from manifold3d import CrossSection, Manifold, Mesh64

from fuzz.geometry import Polytope, distance_to_triangles
from rlacd import _native
from rlacd.solid.component import Component, Part, reunite

Floats = npt.NDArray[np.float64]
Ints = npt.NDArray[np.int32]


@dataclass(frozen=True)
class Closed:
    vertices: Floats
    faces: Ints
    tree: None = None
    exact: None = None

    @property
    def volume(self) -> float:
        return _native.mesh_volume(self.vertices, self.faces)

    @property
    def hull(self) -> Closed:
        indices, faces, rank = _native.convex_hull(self.vertices)
        assert rank == 3
        return Closed(np.ascontiguousarray(self.vertices[indices]), faces)

    @property
    def body(self) -> _native.ConvexBody:
        return _native.ConvexBody(self.vertices, self.faces)


def from_manifold(solid: Any) -> Closed:
    mesh = solid.to_mesh64()
    return Closed(
        np.ascontiguousarray(mesh.vert_properties[:, :3]), np.ascontiguousarray(mesh.tri_verts.astype(np.int32))
    )


def to_manifold(vertices: Floats, faces: Ints) -> Any:
    return Manifold(Mesh64(vertices.astype(np.float64), faces.astype(np.uint64)))


def box(lower: tuple[float, float, float], upper: tuple[float, float, float]) -> Any:
    size = tuple(b - a for a, b in zip(lower, upper, strict=True))
    return Manifold.cube(size).translate(lower)


def block(x: float, y: float, z: float, at: tuple[float, float, float] = (0, 0, 0)) -> Any:
    return Manifold.cube((x, y, z), True).translate(at)


def component_of(mesh: trimesh.Trimesh) -> Component:
    return Component((np.array(mesh.vertices, dtype=np.float64), np.array(mesh.faces, dtype=np.int32)))


def elbow(height: float = 2.0) -> trimesh.Trimesh:
    """An L of two beams that overlap at its corner."""
    beams = ([(0, 0, 0), (2, 0.4, 0.4)], [(0, 0, 0), (0.4, 0.4, height)])
    return trimesh.util.concatenate([trimesh.creation.box(bounds=bounds) for bounds in beams])


def table() -> trimesh.Trimesh:
    """A top of 2 x 1 on four legs at its corners."""
    legs = [Manifold.cube((0.1, 0.1, 1)).translate((x, y, 0)) for x in (0, 1.9) for y in (0, 0.9)]
    return trimesh_of(sum(legs, Manifold.cube((2, 1, 0.1)).translate((0, 0, 1))))


def is_closed(faces: Ints) -> bool:
    """Whether every edge is run through as often one way as the other."""
    edges = np.concatenate([faces[:, [0, 1]], faces[:, [1, 2]], faces[:, [2, 0]]])
    there, back = edges[np.lexsort(edges.T)], edges[:, ::-1][np.lexsort(edges[:, ::-1].T)]
    return np.array_equal(there, back)


def trimesh_of(solid: Any) -> trimesh.Trimesh:
    mesh = from_manifold(solid)
    return trimesh.Trimesh(mesh.vertices, mesh.faces, process=False)


def point_to_triangles(points: Floats, vertices: Floats, faces: Ints) -> Floats:
    """Distances [N] by brute force."""
    return distance_to_triangles(np.asarray(points), np.asarray(vertices)[faces])


def depth_in(hull: Any, points: Floats) -> Floats:
    """Distance [N] from points inside a convex polytope to its surface."""
    return -Polytope(hull.vertices, hull.faces).height(points)


def dense(mesh: Closed, count: int = 20_000) -> Floats:
    points, _ = _native.sample_surface(mesh.vertices, mesh.faces, count, 7)
    return np.vstack([points, mesh.vertices[np.unique(mesh.faces)]])


def arc(start: float, end: float) -> Component:
    """A stretch (in degrees) of a bent bar of square section: radius 1, thickness 0.1."""
    steps = np.radians(np.linspace(start, end, 1 + round(end - start)))
    rim = [(math.cos(a), math.sin(a)) for a in steps]
    outline = [*rim, *((0.9 * x, 0.9 * y) for x, y in reversed(rim))]
    return Component(Manifold.extrude(CrossSection([outline]), 0.1))


def bent_bar() -> list[Component]:
    """Stretches of 26, 16 and 26 degrees; 36 degrees is as much as one hull may span."""
    return together([arc(0, 26), arc(26, 42), arc(42, 68)])


@st.composite
def stacks(draw: st.DrawFn) -> list[Component]:
    """Two to five boxes on top of each other."""
    size = st.tuples(st.floats(0.2, 1), st.floats(0.2, 1), st.floats(0.05, 0.6))
    stack, floor = [], 0.0
    for x, y, z in draw(st.lists(size, min_size=2, max_size=5)):
        stack.append(Component(box((-x / 2, -y / 2, floor), (x / 2, y / 2, floor + z))))
        floor += z
    return together(stack)


def strangers(components: Sequence[Component]) -> list[Component]:
    """The same components, without what they were cut from."""
    return [Component((component.vertices, component.faces)) for component in components]


def together(components: Sequence[Component]) -> list[Component]:
    """The same components, as pieces of their union."""
    solid = reunite(strangers(components))
    assert solid is not None
    return [Component((component.vertices, component.faces), whole=solid) for component in components]


def own_volume(parts: Sequence[Part]) -> float:
    """Without what a part has in common with others."""
    return sum(member.volume for part in parts for member in part.members)


def depth_outside(points: np.ndarray, parts: Sequence[Part]) -> float:
    """How far the outermost of some points is from the nearest hull."""
    distance = np.full(len(points), np.inf)
    for part in parts:
        surface = _native.Surface(part.hull.vertices, part.hull.faces)
        away = np.where(surface.winding(points, 2.0, 1) > 0.5, 0.0, surface.distance(points, 1))
        distance = np.minimum(distance, away)
    return float(distance.max())
