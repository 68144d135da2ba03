"""A body as a simulator or an engine needs it: hulls for collision, a visible mesh, mass, and the up axis."""

from __future__ import annotations

import math
import re
from collections.abc import Collection, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, NamedTuple, TypeAlias

import numpy as np
import trimesh

from rlacd.errors import OutputError
from rlacd.io.read.contents import Triangles
from rlacd.io.write.encode import encode_obj, encode_plain_obj, hull_name
from rlacd.io.write.single_precision import placed_mesh, required_hull
from rlacd.options.names import UNITS, PrimitiveKind
from rlacd.options.output import DENSITY, OutputOptions
from rlacd.report import Mass
from rlacd.result import Result
from rlacd.solid.arrays import FloatArray
from rlacd.solid.frame import HALF_THICKNESS

if TYPE_CHECKING:
    from rlacd.extras.primitive import Primitive

TO_Z_UP = {
    "x": (math.sqrt(0.5), 0.0, -math.sqrt(0.5), 0.0),
    "y": (math.sqrt(0.5), math.sqrt(0.5), 0.0, 0.0),
    "z": (1.0, 0.0, 0.0, 0.0),
}
"""Quaternions (w, x, y, z) that rotate a body's up axis to z."""


@dataclass(frozen=True)
class RigidBody:
    """A body to write; all lengths in the input's own unit and frame."""

    name: str
    """Printable, without line breaks; from the name of the user's file."""
    hulls: Sequence[trimesh.Trimesh]
    """At least one."""
    primitives: Sequence[Primitive | None]
    """For each hull what it stands for, or None."""
    visual: trimesh.Trimesh | None
    """The input as it was read; None for a point cloud."""
    mass: Mass
    """Of the repaired solid without its closed cavities, at the requested density."""
    up: str
    """The axis of the input that points up."""
    is_scene: bool = False
    """Whether to add a floor and a light, where the format has them."""


class Look(NamedTuple):
    """The looks of a visible mesh: red, green, blue and opacity, and a picture as PNG."""

    rgba: Sequence[float]
    picture: bytes | None


class Painted(NamedTuple):
    """The triangles of one material, and for each of their vertices its place in the picture."""

    name: str
    mesh: Triangles
    texture: FloatArray | None
    look: Look


@dataclass(frozen=True, eq=False)
class MeshFile:
    """A mesh file beside the model: its name, content, and position in the body's frame."""

    name: str
    """File name."""
    data: bytes
    """Its bytes."""
    shift: FloatArray
    """``[3]``; zero unless the body lies too far from its origin for float32."""
    look: Look | None = None
    """What it looks like, if that is known."""

    @property
    def picture_name(self) -> str:
        """The name of the file of its picture."""
        return f"{self.name.rpartition('.')[0]}.png"


Shape: TypeAlias = "MeshFile | Primitive"
"""What collides: a mesh file, or a primitive that needs none."""


def model_of(result: Result, asked: OutputOptions) -> RigidBody:
    """Collect everything to be written of a decomposition.

    Raises
    ------
    OutputError
        There are no hulls, or the body weighs nothing at this density.
    """
    density = DENSITY if asked.density is None else asked.density
    if not result.hulls:
        raise OutputError("there are no hulls to write; decompose a mesh first.")
    of_volume = result.report.mass
    if asked.mass is not None and of_volume.volume_abs > 0:
        density = asked.mass / of_volume.volume_abs
    weighed = of_volume.scaled(density)
    if not (0 < weighed.volume_abs < math.inf and np.isfinite(weighed.inertia_abs).all()):
        raise OutputError(f"the mass of {result.name} at density {density:g} is {weighed.volume_abs:g}; scale it.")
    visual = result.source if len(result.source.faces) else None
    name = printable_name(result.name).replace("::", "_")  # a separator between names in SDF
    if name == "world" or re.fullmatch("__.*__", name):
        name = f"body_{name.strip('_')}"  # simulators reserve those names
    return RigidBody(name, result.hulls, result.primitives, visual, weighed, result.up_axis(asked.up))


def implausible(model: RigidBody) -> str | None:
    """Say in a sentence what suggests that the input's unit is not the metre, as simulators take it to be."""
    bounds = np.array([hull.bounds for hull in model.hulls])
    size = float((bounds[:, 1].max(axis=0) - bounds[:, 0].min(axis=0)).max())
    mass = model.mass.volume_abs
    if SIZES[0] <= size <= SIZES[1] and MASSES[0] <= mass <= MASSES[1]:
        return None
    said = f"the body of {model.name} is {size:.3g} m long and weighs {mass:.3g} kg"
    if PREFERRED[0] <= size <= PREFERRED[1]:
        return f"{said}: --density or --mass sets its mass (density=, mass= in Python)."
    units = [f"--unit {unit}" for unit in ("mm", "cm") if PREFERRED[0] <= size * UNITS[unit] <= PREFERRED[1]]
    way = f"{' or '.join(units)} converts" if units and size > SIZES[0] else "--scale multiplies"
    how = f"{way} them, --mass sets its mass (unit=, scale=, mass= in Python)"
    return f"{said}, since simulators take lengths to be in metres: {how}."


def hollow(result: Result) -> str | None:
    """Say in a sentence if most of the input is open sheets, whose mass is that of the thickness repair gave them."""
    bodies = result.report.repair
    sheets = sum(body.faces_in for body in bodies if body.step == SHEET)
    if 2 * sheets <= sum(body.faces_in for body in bodies):
        return None
    walls = f"walls {result.report.unit_in_frame.words(2 * HALF_THICKNESS)} thick"
    return f"{result.name} is a hollow shell of open sheets, weighed as {walls}: mass= (--mass) sets its mass."


SHEET = "slab"
"""The step of repair that gives sheets a thickness."""

PREFERRED = (5e-3, 5.0)
"""Metres: a unit is suggested if the body is as long in it."""

SIZES, MASSES = (1e-3, 50.0), (1e-6, 1e6)
"""What is plausible for a body: metres, and kilograms."""


def printable_name(name: str) -> str:
    """Remove from a name what some text format cannot hold: control characters, broken Unicode."""
    plain = "".join("_" if ord(mark) < 32 or ord(mark) == 127 else mark for mark in name)
    return plain.encode(errors="replace").decode().translate({0xFFFE: "_", 0xFFFF: "_"}).strip() or "mesh"


def node_name(name: str) -> str:
    """Make the name one word, for formats where a space ends it."""
    return re.sub(r"\s+", "_", printable_name(name))


def shapes_of(model: RigidBody, stem: str, kinds: Collection[PrimitiveKind], *, one_mesh: bool = False) -> list[Shape]:
    """The shapes that collide: OBJ files ``<stem>_000.obj``, ...

    A hull that stands for a primitive of one of the `kinds` is that primitive. With `one_mesh`, the hulls are objects
    of a single file, ``<stem>_collision.obj``.

    Raises
    ------
    OutputError
        A hull is too thin for the single precision of simulators.
    """
    shapes: list[Shape] = []
    for index, (hull, primitive) in enumerate(zip(model.hulls, model.primitives, strict=True)):
        if primitive is not None and primitive.kind in kinds and not one_mesh:
            shapes.append(primitive)
            continue
        rounded, shift = required_hull(hull, hull_name(index), "for a simulator")
        exact = rounded if shift.any() else hull  # readers in double precision get the exact hull if possible
        shapes.append(MeshFile(f"{stem}_{index:03d}.obj", encode_plain_obj(exact), shift))
    if not one_mesh:
        return shapes
    far = any(isinstance(shape, MeshFile) and shape.shift.any() for shape in shapes)
    bounds = np.array([hull.bounds for hull in model.hulls])
    shift = (bounds[:, 0].min(axis=0) + bounds[:, 1].max(axis=0)) / 2 if far else np.zeros(3)
    moved = [trimesh.Trimesh(hull.vertices - shift, hull.faces, process=False) for hull in model.hulls]
    return [MeshFile(f"{stem}_collision.obj", encode_obj(moved), shift)]


def visuals_of(model: RigidBody, stem: str, painted: Sequence[Painted] = ()) -> list[MeshFile]:
    """The visible meshes, as OBJ files: one, or one for each material where the looks are known."""
    if model.visual is None:
        return []
    if not painted:
        mesh, shift = placed_mesh(model.visual)
        return [MeshFile(f"{stem}_visual.obj", encode_plain_obj(mesh), shift)]
    files = []
    for name, whole, texture, look in painted:
        mesh, shift = placed_mesh(whole)
        files.append(MeshFile(f"{stem}_{name}_visual.obj", encode_plain_obj(mesh, texture), shift, look))
    return files


def numbers(values: Sequence[float] | FloatArray) -> str:
    """Write numbers with every digit, separated by spaces."""
    return " ".join(repr(float(value) + 0.0) for value in values)  # + 0.0: no negative zero
