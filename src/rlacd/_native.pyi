"""C++ kernels of rlacd: points are float64 [N, 3], faces int32 [F, 3]; the GIL is released inside."""

from collections.abc import Callable, Sequence

import numpy as np
from numpy.typing import NDArray

from rlacd.solid.arrays import BoolArray, FloatArray, IntArray

Interval = tuple[float, float]
Greatest = tuple[float, float, tuple[float, float, float]]  # an interval, and where its lower end is reached
"""Certified lower and upper bound."""

class Stopped(BaseException): ...

class Stop:
    def begin(self, look: Callable[[], object]) -> None: ...
    def end(self) -> None: ...
    def arm(self, seconds: float) -> None: ...
    def trip(self) -> None: ...
    def trip_after(self, polls: int) -> None: ...
    def shield(self, on: bool) -> None: ...
    @property
    def is_tripped(self) -> bool: ...

def use_stop(stop: Stop | None) -> Stop | None: ...
def count_interrupts(code: int, grace: float) -> None: ...
def forget_interrupts() -> None: ...
def poll_stop() -> None: ...
def seconds_left() -> float: ...
def convex_hull(points: FloatArray) -> tuple[IntArray, IntArray, int]: ...
def holds_ball(vertices: FloatArray, faces: IntArray, radius: float) -> bool: ...
def outline(points: FloatArray) -> IntArray: ...
def joint_hull_volumes(groups: list[FloatArray], pairs: IntArray, threads: int = 0) -> FloatArray: ...
def mesh_volume(vertices: FloatArray, faces: IntArray) -> float: ...
def mesh_area(vertices: FloatArray, faces: IntArray) -> float: ...
def mesh_mass(vertices: FloatArray, faces: IntArray) -> tuple[float, FloatArray, FloatArray]: ...  # [3], [3, 3]
def principal_axes(vertices: FloatArray, faces: IntArray) -> FloatArray: ...  # [3, 3]
def sweep(
    vertices: FloatArray, faces: IntArray, directions: FloatArray, offsets: FloatArray, threads: int = 0
) -> FloatArray: ...
def find_least_excess(
    vertices: FloatArray,
    faces: IntArray,
    directions: FloatArray,
    offsets: FloatArray,
    exponent: float,
    tie: float,
    least_solid: float,
    slivers: Sequence[float],
    threads: int = 0,
) -> int: ...
def reflex_edges(
    vertices: FloatArray, faces: IntArray
) -> tuple[IntArray, IntArray, FloatArray, FloatArray]: ...  # [E, 2], [E, 2], [E, 6], [E]
def concave_edges(
    vertices: FloatArray, faces: IntArray, hull_vertices: FloatArray, hull_faces: IntArray, count: int
) -> tuple[IntArray, IntArray, FloatArray, FloatArray]: ...
def candidate_planes(
    vertices: FloatArray,
    faces: IntArray,
    hull_vertices: FloatArray,
    hull_faces: IntArray,
    per_axis: int,
    edges: int,
) -> tuple[FloatArray, FloatArray]: ...  # [K, 3], [K]
def near_pairs(boxes: FloatArray, is_new: BoolArray, reach: float, across: bool) -> IntArray: ...  # [P, 2]
def joint_hull(groups: list[FloatArray]) -> tuple[FloatArray, IntArray, float] | None: ...
def halve(
    vertices: FloatArray, faces: IntArray, hull: FloatArray, along_principal: bool, share: float, least: float
) -> tuple[Piece | None, Piece | None]: ...
def glue(
    vertices_a: FloatArray, faces_a: IntArray, vertices_b: FloatArray, faces_b: IntArray
) -> tuple[FloatArray, IntArray]: ...
def do_touch(vertices_a: FloatArray, faces_a: IntArray, vertices_b: FloatArray, faces_b: IntArray) -> bool: ...
def reunite(vertices: list[FloatArray], faces: list[IntArray], least: float) -> Piece | None: ...
def cut(
    vertices: FloatArray, faces: IntArray, x: float, y: float, z: float, offset: float, least: float
) -> tuple[Piece | None, Piece | None]: ...
def connected_pieces(vertices: FloatArray, faces: IntArray, least: float) -> list[Piece] | None: ...
def weld(vertices: FloatArray, faces: NDArray[np.int64]) -> tuple[FloatArray, IntArray, NDArray[np.bool_]]: ...
def first_in_place(points: FloatArray) -> NDArray[np.int64]: ...
def first_of_doubled(faces: NDArray[np.int64], count: int) -> NDArray[np.bool_]: ...
def edges(
    faces: NDArray[np.int64], count: int
) -> tuple[NDArray[np.int64], NDArray[np.int64], NDArray[np.int64]]: ...  # [3F], [E, 2], [E]
def wedges(
    vertices: FloatArray,
    faces: NDArray[np.int64],
    edge_of_halfedge: NDArray[np.int64],
    edges: int,
    trusted: NDArray[np.bool_] | None = None,
) -> tuple[NDArray[np.int64], NDArray[np.int64]]: ...  # [3F, 2], [3F, 2]
def least_bent(
    points: FloatArray, beside: FloatArray, taken: NDArray[np.bool_] | None = None, bend: float = 1.0
) -> IntArray: ...  # [N - 2, 3]
def mark_cells(
    vertices: FloatArray, faces: NDArray[np.int64], spacing: float, pitch: float, margin: int
) -> tuple[FloatArray, bytes, tuple[int, int, int]]: ...
def spread_points(
    vertices: FloatArray, faces: NDArray[np.int64], spacing: float
) -> tuple[FloatArray, IntArray]: ...  # [N, 3], [N]
def components(count: int, a: NDArray[np.int64], b: NDArray[np.int64]) -> tuple[int, NDArray[np.int64]]: ...
def long_normals(vertices: FloatArray, faces: NDArray[np.int64]) -> FloatArray: ...  # [F, 3]
def longest_edges(vertices: FloatArray, faces: NDArray[np.int64]) -> FloatArray: ...  # [F]
def face_areas(vertices: FloatArray, faces: NDArray[np.int64]) -> FloatArray: ...  # [F]
def signed_tetrahedra(vertices: FloatArray, faces: NDArray[np.int64]) -> FloatArray: ...  # [F]
def closed_bodies(
    vertices: FloatArray, faces: IntArray
) -> (
    tuple[NDArray[np.int64], FloatArray, FloatArray, FloatArray, bool, float, float] | None
): ...  # [F], [B], [B], [B, 6], no pinch, least height, least fold
def separate_fans(vertices: FloatArray, faces: IntArray) -> tuple[FloatArray, IntArray]: ...
def along_a_curve(vertices: FloatArray, faces: IntArray) -> tuple[FloatArray, IntArray]: ...
def point_bodies(vertices: FloatArray, faces: IntArray) -> IntArray: ...  # [V]
def label_cells(marks: BoolArray) -> NDArray[np.int64]: ...  # [X * Y * Z]
def nearest_labels(  # [N]
    labels: NDArray[np.int64], cells: NDArray[np.int64], reach: float
) -> NDArray[np.int64]: ...

class PointTree:
    def __init__(self, points: FloatArray) -> None: ...
    def within(  # [M], [sum]
        self, centres: FloatArray, radii: FloatArray, most: int = ...
    ) -> tuple[NDArray[np.int64], IntArray]: ...

Piece = tuple[FloatArray, IntArray, float, FloatArray, IntArray, float]
"""Vertices [V, 3], faces [F, 3] and volume, and those of its hull."""

class Surface:
    def __init__(self, vertices: FloatArray, faces: IntArray, threads: int = 1) -> None: ...
    def distance(self, points: FloatArray, threads: int = 0) -> FloatArray: ...  # [N]
    def closest(self, points: FloatArray, threads: int = 0) -> tuple[FloatArray, IntArray]: ...  # [N, 3], [N]
    def winding(self, points: FloatArray, accuracy: float = 2.0, threads: int = 0) -> FloatArray: ...  # [N]

def apart_points(surface: Surface, points: FloatArray, reach: float, enough: int) -> IntArray: ...  # [K]
def sample_surface(vertices: FloatArray, faces: IntArray, count: int, seed: int) -> tuple[FloatArray, IntArray]: ...
def crossings(vertices: FloatArray, faces: IntArray, body: NDArray[np.int64], most: int) -> tuple[int, int]: ...
def directed_hausdorff(
    vertices: FloatArray, faces: IntArray, surface: Surface, tolerance: float, threads: int = 0
) -> Interval: ...

class HullCorners:
    def __init__(self, corners: FloatArray) -> None: ...

class Filling:
    def __init__(self, vertices: FloatArray, faces: IntArray, threads: int = 1) -> None: ...
    @property
    def surface(self) -> Surface: ...
    def feasibility(self, hull_vertices: FloatArray, hull_faces: IntArray, threshold: float) -> int: ...  # 0, 1 or 2
    def joint_feasibilities(
        self, hulls: Sequence[HullCorners], pairs: IntArray, threshold: float, threads: int = 0
    ) -> tuple[FloatArray, IntArray]: ...
    def comes_deeper(self, hull_vertices: FloatArray, hull_faces: IntArray, threshold: float) -> bool: ...
    def clipped(
        self, hull_vertices: FloatArray, hull_faces: IntArray
    ) -> tuple[FloatArray, IntArray, float, TreeCache]: ...
    def uncovered(
        self, vertices: list[FloatArray], faces: list[IntArray], reach: float, grain: float, threads: int = 0
    ) -> list[FloatArray]: ...

class TreeCache:
    def __init__(self) -> None: ...

def meets_concavity(
    part_vertices: FloatArray,
    part_faces: IntArray,
    hull_vertices: FloatArray,
    hull_faces: IntArray,
    part_volume: float,
    hull_volume: float,
    threshold: float,
    tree: TreeCache | None = None,
) -> bool: ...
def concavity(
    part_vertices: FloatArray,
    part_faces: IntArray,
    hull_vertices: FloatArray,
    hull_faces: IntArray,
    part_volume: float,
    hull_volume: float,
    tolerance: float,
    floor: float = 0.0,
    tree: TreeCache | None = None,
) -> tuple[Interval, Interval, Interval, float]: ...

class Simplifier:
    def __init__(self, vertices: FloatArray, faces: IntArray) -> None: ...
    def reduce(self, count: int, threads: int = 1) -> None: ...
    def mesh(self) -> tuple[FloatArray, IntArray]: ...

class HullUnion:
    def __init__(self, vertices: list[FloatArray], faces: list[IntArray], threads: int = 0) -> None: ...
    def only(self, some: IntArray) -> HullUnion: ...
    def exposed(self, gap: float = 1e-6, threads: int = 0) -> tuple[FloatArray, IntArray]: ...
    def over(self, surface: Surface, tolerance: float, gap: float = 1e-6, threads: int = 0) -> Greatest: ...
    def under(self, vertices: FloatArray, faces: IntArray, tolerance: float, threads: int = 0) -> Greatest: ...
    def distance(self, points: FloatArray, threads: int = 0) -> FloatArray: ...  # [N]

def simplify_hull(
    vertices: FloatArray, faces: IntArray, max_vertices: int, max_faces: int, tolerance: float, bounds: FloatArray
) -> tuple[FloatArray, IntArray]: ...
def navigable_balls(
    surface: Surface,
    hull_vertices: FloatArray,
    hull_faces: IntArray,
    radius: float,
    tolerance: float,
    reachable_only: bool,
    seeds: FloatArray | None,
    closed: FloatArray,
    pitch: float,
    threads: int = 0,
) -> tuple[FloatArray, FloatArray]: ...  # [B, 3], [B]

class FlushBody:
    def __init__(self, vertices: FloatArray, faces: IntArray) -> None: ...
    def depths(self, points: FloatArray) -> FloatArray: ...  # [N]
    def contact(self, other: FlushBody, depth: float, touch: float) -> tuple[IntArray, FloatArray]: ...  # [S], [N, 3]
    def layer(self, other: FlushBody, sides: IntArray, depth: float, touch: float) -> FloatArray: ...  # [N, 3]

class BallSet:
    def __init__(self, centres: FloatArray, radii: FloatArray) -> None: ...
    def intrusions(
        self, vertices: FloatArray, faces: IntArray, candidates: IntArray | None, least: float, first: bool = False
    ) -> tuple[IntArray, FloatArray]: ...  # [K], [K]
