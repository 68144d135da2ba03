"""Properties that hulls must have, judged without the kernels that made them.

Distances are sampled from below or computed over all triangles, hulls are checked in rational arithmetic or by Qhull,
and solids are manifold3d's. Lengths are in the frame where the longest side is 2. Each judge returns its complaints as
sentences, none if all is well.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import manifold3d
import numpy as np
import numpy.typing as npt
import trimesh
from scipy import ndimage
from scipy.spatial import cKDTree

from fuzz.eye import LEAST_A_HULL, farthest_from_triangles, in_frame, seen_over, seen_under
from fuzz.geometry import (
    Floats,
    Ints,
    Polytope,
    distance_to_union,
    sampled,
    why_not_convex,
)
from fuzz.recipes import Shape
from rlacd import PRESETS, NavigableSpace

COVERAGE_TOLERANCE = 5e-3
"""Distance by which hulls may miss the input or exceed the threshold without a warning in the report."""

ROUNDING = 1e-5

HAIR = 1e-6
"""Relative growth of hulls before they are intersected with the input."""

SAMPLES = 400

THIN = 1e-3


@dataclass(frozen=True)
class Case:
    """An input, the options, and the result.

    Attributes
    ----------
    shape : Shape
    options : dict
    hulls : list of (vertices [V, 3], faces [F, 3])
        In the input's unit, as read from the output file.
    report : dict
        Hulls, hausdorff, warnings, complete, and what the criterion says.
    """

    shape: Shape
    options: dict[str, Any]
    hulls: list[tuple[Floats, Ints]]
    report: dict[str, Any]

    @property
    def warned(self) -> str:
        return " ".join(self.report["warnings"])


def finite_faces(shape: Shape) -> Ints:
    """The faces with finite vertices only."""
    finite: npt.NDArray[np.bool_] = np.asarray(np.isfinite(shape.vertices).all(axis=1))
    return shape.faces[finite[shape.faces].all(axis=1)]


def judge(case: Case, samples: int = SAMPLES) -> list[str]:
    """Run all judges, each with about `samples` points of the input and of the hulls."""
    found = [f"hull {i}: {why}" for i, hull in enumerate(case.hulls) if (why := why_not_convex(*hull))]
    found += limits(case)
    faces = finite_faces(case.shape)
    if (
        found
        or "cannot resolve lengths" in case.warned
        or len(np.unique(case.shape.vertices[np.unique(faces)], axis=0)) < 2
    ):
        return found
    every_face = faces
    where, faces, hulls = in_frame(case.shape.vertices, faces, case.hulls)
    random = np.random.default_rng(0)
    if len(faces):
        found += coverage(case, where, faces, hulls, random, samples)
        found += left_out(case, where[np.unique(every_face)], hulls)
        found += overhang(case, where[every_face], hulls, random, samples)
        found += passages(case)
    if case.shape.is_closed and len(faces) == len(every_face):  # a part may reach out to faces without area
        found += mass(case, where, faces)
        solid = filled_solid(where, faces)
        if solid is not None:
            found += concavity(case, solid, where[faces], hulls, random, samples)
            found += free_space(case, solid, hulls, random)
    return found


def limits(case: Case) -> list[str]:
    found = []
    preset = PRESETS.get(case.options.get("preset", ""))
    for index, (name, what) in enumerate((("max_vertices", "vertices"), ("max_faces", "faces"))):
        limit = case.options.get(name, getattr(preset, name, None))
        most = max(len(hull[index]) for hull in case.hulls)
        if limit is not None and most > limit:
            found.append(f"a hull has {most} {what}, not {limit}")
    most_hulls = case.options.get("max_hulls")
    if most_hulls is not None and len(case.hulls) > most_hulls and case.report["complete"]:
        found.append(f"{len(case.hulls)} hulls, not {most_hulls}; said: {case.warned!r}")
    if len(case.hulls) != case.report["hulls"] or not case.hulls:
        found.append(f"{len(case.hulls)} hulls in the file, {case.report['hulls']} in the report")
    return found


def coverage(
    case: Case, where: Floats, faces: Ints, hulls: list[Polytope], random: np.random.Generator, samples: int
) -> list[str]:
    """Every point of the input lies in a hull or as near as the report says; it must warn of large distances.

    No word excuses them where repair dropped nothing; bodies that cavities are kept in may be cavities themselves.
    """
    missed = seen_under(hulls, where, faces, samples, random)
    reported = case.report["hausdorff"]["missed"]
    found = []
    if reported is not None and missed.distance > reported + ROUNDING:
        found.append(f"the input leads {missed.distance:.6g} out of the hulls, the report says {reported:.6g}")
    may_drop = not _is_as_given(case) or "keep_cavities" in case.options
    is_excused = may_drop and any(
        word in case.warned for word in ("outside the hulls", "from the hulls", "no time to measure")
    )
    if missed.distance > COVERAGE_TOLERANCE + ROUNDING and not is_excused:
        found.append(f"the input leads {missed.distance:.6g} out of the hulls, without a reason")
    return found


def _is_as_given(case: Case) -> bool:
    """Whether repair left the solid as it is."""
    steps = {body["step"] for body in case.report.get("repair", [])}
    return bool(steps) and steps <= {"closed", "reoriented"}


def left_out(case: Case, corners: Floats, hulls: list[Polytope]) -> list[str]:
    """Corners that only faces without an area have lie in a hull, or a warning says that they do not."""
    farthest = float(distance_to_union(corners, hulls).max())
    under = case.report["hausdorff"]["missed"]
    if under is None or farthest <= COVERAGE_TOLERANCE + ROUNDING or "outside the hulls" in case.warned:
        return []
    return [f"a corner of a face lies {farthest:.6g} outside the hulls, and no word of it"]


def mass(case: Case, where: Floats, faces: Ints) -> list[str]:
    """Volume, centre and inertia are those that trimesh finds for the closed input, less its cavities."""
    said = case.report.get("mass")
    if said is None or not _is_as_given(case):
        return []
    body = trimesh.Trimesh(where, faces, process=False)
    unit = 2 / np.ptp(case.shape.vertices[np.unique(finite_faces(case.shape))], axis=0).max()
    volume, inertia = said["volume_abs"] * unit**3, np.array(said["inertia_abs"]) * unit**5
    found = []
    if abs(volume - body.volume) > HAIR * (1 + body.volume):
        found.append(f"the volume is {volume:.8g}, not {body.volume:.8g}")
    if np.abs(inertia - body.moment_inertia).max() > HAIR * 10:
        found.append(f"the inertia is {inertia.tolist()}, not {body.moment_inertia.tolist()}")
    return found


def overhang(
    case: Case, corners: Floats, hulls: list[Polytope], random: np.random.Generator, samples: int
) -> list[str]:
    """No point of the hulls' outer surface is farther from the input than the report or the threshold allows.

    Faces without area need not be covered, but hulls may extend to them.
    """
    reached = seen_over(hulls, corners, samples, random)
    reported = case.report["hausdorff"]["added"]
    found = []
    if reported is not None and reached.distance > reported + 2 * ROUNDING:
        found.append(f"the hulls reach {reached.distance:.6g} beyond the input, the report says {reported:.6g}")
    allowed = case.options.get("threshold", math.inf) + COVERAGE_TOLERANCE + ROUNDING
    is_warned_of = any(
        word in case.warned for word in ("exceed", "beyond the input", "Incomplete", "no time to measure")
    )
    if reached.distance > allowed and not is_warned_of:
        found.append(f"the hulls reach {reached.distance:.6g} beyond the input, and no word of it")
    return found


def passages(case: Case) -> list[str]:
    """Of a plate's equal holes, each keeps its share or is listed; those that lose much are listed, each once.

    What is left of a hole is measured all along its axis, where a ball that passes has its centre.
    """
    axes, listed = case.shape.axes, case.report.get("passages")
    if len(axes) == 0 or listed is None or not case.report["complete"]:
        return []
    size = np.ptp(case.shape.vertices, axis=0).max() / 2
    hulls = [Polytope(vertices / size, faces) for vertices, faces in case.hulls]
    along = axes[:, :1] + np.linspace(0.1, 0.9, 9)[:, None] * (axes[:, 1:] - axes[:, :1])
    left = distance_to_union(along.reshape(-1, 3) / size, hulls).reshape(len(axes), -1).min(axis=1)
    radius, found = case.shape.hole / size, []
    named = np.zeros(len(axes), dtype=int)
    for passage in listed:
        away = np.linalg.norm(along - passage["at_abs"], axis=2).min(axis=1)
        named[away.argmin()] += 1
    is_asked = "keep_open" in case.options and radius > 1.01 * case.options.get("threshold", 0.05)
    is_kept = not is_asked or left.min() >= (case.options["keep_open"] - 0.05) * radius
    if not is_kept and "--keep-open allows" not in case.warned:
        found.append(f"a hole of radius {radius:.4g} keeps {left.min():.4g}, and no word of it")
    if radius > 0.009 and (missed := (left < 0.75 * radius) & (named == 0)).any():
        found.append(f"{missed.sum()} of {len(axes)} holes narrow, one to {left[missed].min():.4g}, and are not listed")
    if named.max() > 1:
        found.append(f"a hole is listed {named.max()} times")
    return found


def filled_solid(where: Floats, faces: Ints) -> manifold3d.Manifold | None:
    """The closed input as a solid without cavities; None if manifold3d does not accept it."""
    solid = manifold3d.Manifold(manifold3d.Mesh64(np.ascontiguousarray(where), faces.astype(np.uint64)))
    kept = triangles_of(solid)[0]
    if len(kept) == 0 or np.max(cKDTree(kept).query(where[np.unique(faces)])[0]) > ROUNDING:
        return None  # manifold3d drops bodies without volume, which repair turns into slabs
    pieces = solid.decompose()
    if any(abs(piece.volume()) < THIN * piece.surface_area() for piece in pieces):
        return None  # repair turns sheets into slabs
    outer = [piece for piece in pieces if piece.volume() > 0]
    return manifold3d.Manifold.batch_boolean(outer, manifold3d.OpType.Add) if outer else None


def triangles_of(solid: manifold3d.Manifold) -> tuple[Floats, Ints]:
    mesh = solid.to_mesh64()
    return np.array(mesh.vert_properties[:, :3], dtype=np.float64), np.array(mesh.tri_verts, dtype=np.int64)


def concavity(
    case: Case,
    solid: manifold3d.Manifold,
    corners: Floats,
    hulls: list[Polytope],
    random: np.random.Generator,
    samples: int,
) -> list[str]:
    """The solid gives a lower bound of each hull's concavity.

    A point of the hull's surface is as far from the solid as from its nearest triangle, or lies on the surface of the
    intersection, at no distance from the solid; and the intersection is what the solid fills of the hull.
    """
    reported = case.report.get("concavity")
    if reported is None:
        return []
    found = []
    threshold = case.options["threshold"]
    weight = 0.0 if {"max_vertices", "max_faces", "preset"} & case.options.keys() else 0.3  # limits may add volume
    if reported > threshold * (1 + 1e-9) and "exceed" not in case.warned:
        found.append(f"the concavity is {reported:.6g}, more than {threshold:g}, and no word of it")
    if "finite" in " ".join(case.shape.steps) or "filled, at most" in case.warned:
        return found  # what was filled is solid to the report
    for i, hull in enumerate(hulls):
        body = manifold3d.Manifold(manifold3d.Mesh64(hull.vertices, hull.faces.astype(np.uint64)))
        # manifold3d can lose a spike where faces coincide, and a film anywhere: the better of two attempts counts.
        shares = [share for share in (solid ^ body, solid ^ _a_hair_larger(body)) if not share.is_empty()]
        if body.is_empty() or not shares:
            continue  # too thin for booleans
        points = sampled(hull.vertices, hull.faces, max(LEAST_A_HULL, samples // len(hulls)), random)
        least = min(_least_concavity(body, share, corners, points, random, weight) for share in shares)
        if least > reported + 1e-3:
            found.append(f"hull {i} is {least:.6g} concave, the report says {reported:.6g} at most")
    return found


def _least_concavity(
    body: manifold3d.Manifold,
    share: manifold3d.Manifold,
    corners: Floats,
    points: Floats,
    random: np.random.Generator,
    weight: float,
) -> float:
    """Lower bound, from points of the hull, of its concavity; `share` is what the solid, of these `corners`, fills."""
    radius = math.pow(max(0.0, 3 * (body.volume() - share.volume()) / (4 * math.pi)), 1 / 3)
    vertices, faces = triangles_of(share)
    near = np.concatenate([vertices[faces], corners])
    return max(weight * radius, farthest_from_triangles(points, near, random).distance)


def _a_hair_larger(body: manifold3d.Manifold) -> manifold3d.Manifold:
    """Scale a body slightly, so that its faces do not coincide with those of another."""
    middle = np.reshape(body.bounding_box(), (2, 3)).mean(axis=0)
    return body.translate(-middle).scale([1 + HAIR] * 3).translate(middle)


def free_space(case: Case, solid: manifold3d.Manifold, hulls: list[Polytope], random: np.random.Generator) -> list[str]:
    """No hull reaches far into a place that a ball can certainly get to.

    Certain are the grid cells that are so far from the surface that the ball, enlarged by the tolerance, fits
    everywhere in them and on the straight line to their neighbours, and that are connected to the outside by such
    cells.
    """
    space = case.options.get("criterion")
    if not isinstance(space, NavigableSpace) or space.closed_planes or not case.report["complete"]:
        return []
    if any(
        word in case.warned
        for word in ("could keep the hulls off", "reach into", "is small", "asked for", "no tighter", "larger than")
    ):
        return []
    assert space.radius is not None
    assert space.tolerance is not None
    radius, tolerance = float(space.radius), float(space.tolerance)
    if radius >= 2 or "max_hulls" in case.options:
        return []
    vertices, faces = triangles_of(solid)
    pitch = max(radius / 3, (2 + 4 * radius) / 48)
    spacing = pitch / 3
    tree = cKDTree(_dense(vertices, faces, spacing))
    lower, upper = vertices.min(axis=0) - 2 * radius - pitch, vertices.max(axis=0) + 2 * radius + pitch
    axes = [np.arange(a, b + pitch, pitch) for a, b in zip(lower, upper, strict=True)]
    grid = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1)
    clearance = np.asarray(tree.query(grid.reshape(-1, 3))[0]).reshape(grid.shape[:3]) - spacing
    labels, _ = ndimage.label(clearance >= radius + tolerance + pitch)
    outside = labels == labels[0, 0, 0]
    if labels[0, 0, 0] == 0:
        return []
    reached = grid[outside]
    reached = reached[random.permutation(len(reached))[:2000]]
    depth = radius - distance_to_union(reached, hulls)
    worst = float(depth.max())
    # Between the balls a hull can reach a third of their radius without being noticed.
    return [f"a hull reaches {worst:.6g} into a ball of {radius:g}"] if worst > 0.4 * radius + pitch else []


def _dense(vertices: Floats, faces: Ints, spacing: float) -> Floats:
    """Sample points such that every point of the triangles is within `spacing` of one."""
    points = [vertices]
    for a, b, c in vertices[faces]:
        longest = max(np.linalg.norm(b - a), np.linalg.norm(c - b), np.linalg.norm(a - c))
        steps = max(1, int(np.ceil(longest / spacing)))
        i, j = np.meshgrid(np.arange(steps + 1), np.arange(steps + 1), indexing="ij")
        kept = i + j <= steps
        s, t = i[kept] / steps, j[kept] / steps
        points.append(a + s[:, None] * (b - a) + t[:, None] * (c - a))
    return np.concatenate(points)
