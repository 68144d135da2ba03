"""Ten tasks whose outcome depends on the shape of what collides; shapes are built here, in metres."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Protocol, TypeAlias

import numpy as np
import trimesh
from manifold3d import CrossSection, Manifold, OpType

from rlacd.solid.arrays import FloatArray

Vector: TypeAlias = Sequence[float]

TOLERANCE = 0.025
"""How far from its true place a thing may end, as a share of its shape's longest side: what a threshold of 0.05 allows.
No passage is narrower than that on both sides."""

X, Y, Z = ("slide", (1, 0, 0)), ("slide", (0, 1, 0)), ("slide", (0, 0, 1))
TURN = ("hinge", (0, 0, 1))
FREE = None


@dataclass(frozen=True)
class Body:
    """A body of a scene.

    Attributes
    ----------
    shape : str or float or tuple
        A name in `SHAPES`; the radius of a ball; the sides of a box.
    at, turn : vectors
        Where the shape's origin is, in metres; rotation as a quaternion, w first.
    moves : sequence of (kind, axis), or None
        Its joints: none if it is fixed. None if it is free.
    mass : float
        Kilograms.
    target : callable, optional
        The time in seconds to where its joints, or x, y and z if it is free, are pulled.
    pull : vector
        Newtons a metre (newton metres a radian) of that, for each; damping is a fifth of it, per second.
    """

    shape: str | float | tuple[float, float, float]
    at: Vector = (0.0, 0.0, 0.0)
    turn: Vector = (1.0, 0.0, 0.0, 0.0)
    moves: Sequence[tuple[str, Vector]] | None = FREE
    mass: float = 0.1
    target: Callable[[float], Vector] | None = None
    pull: Vector = ()


class World(Protocol):
    """A scene in an engine; bodies by their index."""

    def step(self) -> float:
        """Take a step; how deep the deepest contact is, in metres."""

    def place(self, body: int) -> FloatArray:
        """Rotation and position [4, 4] of a shape's own frame."""

    def joints(self, body: int) -> tuple[FloatArray, FloatArray]:
        """Positions and velocities of its joints; of its origin's x, y, z if it is free."""


@dataclass(frozen=True)
class Scene:
    """Bodies over a floor at z = 0, for some seconds; then whether all is as it has to be."""

    bodies: Sequence[Body]
    seconds: float
    passed: Callable[[World], bool]


# --- shapes -----------------------------------------------------------------------------------------------------------


def box(low: Vector, high: Vector) -> Manifold:
    return Manifold.cube(tuple(np.subtract(high, low))).translate(tuple(low))


def rod(radius: float, low: float, high: float, sides: int = 32) -> Manifold:
    return Manifold.cylinder(high - low, radius, radius, sides).translate((0, 0, low))


def bent(path: FloatArray, radius: float) -> Manifold:
    """A round bar along a path [N, 3]."""
    balls = [Manifold.sphere(radius, 16).translate(tuple(point)) for point in path]
    return Manifold.batch_boolean([Manifold.batch_hull(list(pair)) for pair in pairwise(balls)], OpType.Add)


def arc(low: float, high: float, x: float, z: float, wide: float, tall: float) -> FloatArray:
    """Points [13, 3] of an ellipse in the plane y = 0."""
    angles = np.linspace(low, high, 13) * np.pi
    return np.stack([x + wide * np.cos(angles), np.zeros(13), z + tall * np.sin(angles)], axis=1)


def mug() -> Manifold:
    outside = CrossSection([[(0, 0), (0.036, 0), (0.04, 0.004), (0.04, 0.1), (0, 0.1)]]).revolve(48)
    inside = CrossSection([[(0, 0.005), (0.034, 0.005), (0.036, 0.008), (0.036, 0.11), (0, 0.11)]]).revolve(48)
    return outside + bent(arc(-0.5, 0.5, 0.038, 0.052, 0.032, 0.030), 0.0045) - inside


def hook() -> Manifold:
    """A plate on a wall at x = 0; its bar leaves along y, and turns up."""
    bar = bent(np.array([(0, 0, 0), (0, -0.05, 0), (0, -0.062, 0.006), (0, -0.066, 0.018)]), 0.004)
    return bar + box((-0.02, 0, -0.03), (0.02, 0.006, 0.03))


def holed() -> Manifold:
    return box((-0.06, -0.06, -0.02), (0.06, 0.06, 0)) - rod(0.024, -0.03, 0.01)


def peg() -> Manifold:
    return rod(0.0185, -0.06, 0.001) + rod(0.032, 0, 0.02)


def chair() -> Manifold:
    legs = [box((x, y, 0), (x + 0.04, y + 0.04, 0.45)) for x in (-0.2, 0.16) for y in (-0.2, 0.16)]
    back = [box((x, 0.16, 0.44), (x + 0.04, 0.2, 0.9)) for x in (-0.2, -0.02, 0.16)]
    rails = [box((-0.2, 0.16, 0.82), (0.2, 0.2, 0.9)), box((-0.2, -0.2, 0.41), (0.2, 0.2, 0.45))]
    return Manifold.batch_boolean([*legs, *back, *rails], OpType.Add)


def bolt() -> Manifold:
    """Head down."""
    return rod(0.018, 0, 0.012, 6) + rod(0.008, 0.011, 0.07)


def nut() -> Manifold:
    return rod(0.02, 0, 0.016, 6) - rod(0.0115, -0.01, 0.02)


def cabinet() -> Manifold:
    """Open towards -y."""
    return box((-0.16, 0, 0), (0.16, 0.34, 0.16)) - box((-0.142, -0.01, 0.015), (0.142, 0.32, 0.142))


def drawer() -> Manifold:
    return box((-0.125, 0, 0), (0.125, 0.3, 0.1)) - box((-0.11, 0.015, 0.012), (0.11, 0.285, 0.11))


def jaw() -> Manifold:
    """Open towards -x, for a rim between its lips."""
    return box((0, -0.03, -0.02), (0.05, 0.03, 0.02)) - box((-0.01, -0.04, -0.009), (0.03, 0.04, 0.009))


def plate() -> Manifold:
    """20 cm wide, a rim around a flat foot."""
    profile = [(0, 0), (0.06, 0), (0.1, 0.018), (0.1, 0.023), (0.058, 0.005), (0, 0.005)]
    return CrossSection([profile]).revolve(48)


def gear(teeth: int) -> Manifold:
    """Teeth 2 cm long, at a radius of 5 mm a tooth, 2 cm thick; one points along x."""
    pitch, step = 0.005 * teeth, 2 * np.pi / teeth
    shape = [(0.22, -0.010), (0.08, 0.010), (-0.08, 0.010), (-0.22, -0.010)]
    points = [
        ((pitch + out) * np.cos(a), (pitch + out) * np.sin(a))
        for tooth in range(teeth)
        for side, out in reversed(shape)
        for a in [step * (tooth + side)]
    ]
    return Manifold.extrude(CrossSection([points]), 0.02)


def crate() -> Manifold:
    """Its foot stands in the opening of the one below."""
    body = box((-0.1, -0.075, 0.02), (0.1, 0.075, 0.1)) + box((-0.07, -0.045, 0), (0.07, 0.045, 0.021))
    return body - box((-0.09, -0.065, 0.03), (0.09, 0.065, 0.11))


SHAPES: dict[str, Callable[[], Manifold]] = {
    **{"mug": mug, "hook": hook, "holed": holed, "peg": peg, "chair": chair, "bolt": bolt, "nut": nut},
    **{"cabinet": cabinet, "drawer": drawer, "jaw": jaw, "plate": plate, "crate": crate},
    **{"gear_8": lambda: gear(8), "gear_12": lambda: gear(12)},
}


def mesh_of(name: str) -> trimesh.Trimesh:
    """One of the `SHAPES`."""
    found = SHAPES[name]().to_mesh64()
    return trimesh.Trimesh(found.vert_properties[:, :3], found.tri_verts, process=False)


# --- tasks ------------------------------------------------------------------------------------------------------------


def near(world: World, body: int, place: Vector, size: float, tilt: float = 3.0) -> bool:
    """Whether a shape of a size is upright, within degrees, and its origin where it has to be, as far as told."""
    there = world.place(body)
    off = [abs(there[axis, 3] - want) for axis, want in enumerate(place) if not np.isnan(want)]
    return bool(max(off) <= TOLERANCE * size and there[2, 2] >= np.cos(np.radians(tilt)))


ANY = float("nan")


def ball_into_mug() -> Scene:
    return Scene(
        [Body("mug", mass=0.3), Body(0.015, at=(0, 0, 0.15), mass=0.02)],
        2.0,
        lambda world: near(world, 1, (ANY, ANY, 0.02), 0.11, 180) and near(world, 0, (ANY, ANY, 0), 0.11),
    )


def peg_into_hole() -> Scene:
    return Scene(
        [Body("holed", at=(0, 0, 0.1), moves=()), Body("peg", at=(0, 0, 0.17))],
        2.0,
        lambda world: near(world, 1, (ANY, ANY, 0.1), 0.12),
    )


def mug_on_hook() -> Scene:
    return Scene(
        [Body("hook", at=(0, 0, 0.3), moves=()), Body("mug", at=(-0.057, -0.03, 0.233), mass=0.3)],
        4.0,
        lambda world: world.place(1)[2, 3] > 0.15,
    )


def chair_under_load() -> Scene:
    return Scene(
        [Body("chair", mass=6), Body((0.3, 0.3, 0.2), at=(0, -0.02, 0.6), mass=60)],
        3.0,
        lambda world: near(world, 1, (ANY, ANY, 0.55), 0.9) and near(world, 0, (0, 0, 0), 0.9),
    )


def nut_onto_bolt() -> Scene:
    return Scene(
        [Body("bolt", moves=()), Body("nut", at=(0, 0, 0.05), mass=0.05)],
        2.0,
        lambda world: near(world, 1, (ANY, ANY, 0.012), 0.07),
    )


def drawer_that_opens() -> Scene:
    """A ball lies in it; the cabinet stands at z = 0, and the drawer is pulled 16 cm out."""
    pulled = Body(
        "drawer", (0, 0.015, 0.016), mass=1, target=lambda t: (0, 0.015 - 0.16 * min(t / 1.5, 1), 0), pull=(0, 200, 0)
    )
    return Scene(
        [Body("cabinet", moves=()), pulled, Body(0.02, (0, 0.05, 0.06), mass=0.02)],
        2.5,
        lambda world: (
            near(world, 1, (ANY, ANY, 0.015), 0.3)
            and world.place(1)[1, 3] < -0.1
            and near(world, 2, (ANY, ANY, 0.047), 0.3, 180)
            and world.place(2)[1, 3] < 0.2
        ),
    )


def gripper_lifts_plate() -> Scene:
    """Two jaws close around the rim, then rise by 10 cm."""

    def target(t: float) -> Vector:
        return min(t, 0.5) * 0.2, 0.1 * min(max(t - 1, 0), 1)

    def closing(side: int) -> Body:
        turn = (1, 0, 0, 0) if side > 0 else (0, 0, 0, 1)
        inwards = ("slide", (-1, 0, 0))
        return Body("jaw", (0.18 * side, 0, 0.0205 + 0.06), turn, [inwards, Z], 0.5, target, (100, 4000))

    stand = Body((0.1, 0.1, 0.06), (0, 0, 0.03), moves=())
    return Scene(
        [stand, Body("plate", (0, 0, 0.061), mass=0.4), closing(1), closing(-1)],
        3.0,
        lambda world: world.place(1)[2, 3] > 0.13 and near(world, 1, (0, 0, ANY), 0.2, 15),
    )


def gears_that_mesh() -> Scene:
    """The small one is turned once."""
    drive = Body("gear_8", (0, 0, 0.05), moves=[TURN], mass=0.2, target=lambda t: (np.pi * min(t, 2.0),), pull=(1.0,))
    turned = float(np.cos(np.pi / 24)), 0.0, 0.0, float(np.sin(np.pi / 24))

    def passed(world: World) -> bool:
        (small, _), (large, _) = world.joints(0), world.joints(1)
        return bool(abs(small[0] - 2 * np.pi) < 0.1 and abs(large[0] + 2 / 3 * small[0]) < 0.3)

    return Scene([drive, Body("gear_12", (0.106, 0, 0.05), turned, [TURN], 0.4)], 3.0, passed)


def pile_of_fifty() -> Scene:
    """Mugs, turned at random, come to lie in a bin: after 3 s, whichever hulls they have, one may still slide."""
    walls = [
        Body((0.02 if x else 0.7, 0.02 if y else 0.7, 2.0), (0.34 * x, 0.34 * y, 1.0), moves=())
        for x, y in ((1, 0), (-1, 0), (0, 1), (0, -1))
    ]
    grid = [(0.16 * (x - 1.5), 0.16 * (y - 1.5), 0.1 + 0.16 * z) for z in range(4) for x in range(4) for y in range(4)]
    mugs = []
    for place, turn in zip(grid[:50], np.random.default_rng(0).normal(size=(50, 4)), strict=True):
        turn /= np.linalg.norm(turn)
        middle = trimesh.transformations.quaternion_matrix(turn)[:3, :3] @ (0.015, 0, 0.05)
        mugs.append(Body("mug", place - middle, turn, mass=0.3))

    def passed(world: World) -> bool:
        there = np.array([world.place(4 + index)[:3, 3] for index in range(50)])
        fastest = max(float(np.linalg.norm(world.joints(4 + index)[1])) for index in range(50))
        return bool(np.abs(there[:, :2]).max() < 0.4 and there[:, 2].min() > -0.003 and fastest < 0.3)

    return Scene([*walls, *mugs], 4.0, passed)


def stack_of_ten() -> Scene:
    """Each crate is where the one below, as it stands, puts it."""

    def passed(world: World) -> bool:
        below = [np.array([0, 0, -0.08]), *(world.place(index)[:3, 3] for index in range(9))]
        places = np.add(below, (0, 0, 0.08))
        return all(near(world, index, place, 0.2) for index, place in enumerate(places.tolist()))

    return Scene([Body("crate", (0, 0, 0.081 * index)) for index in range(10)], 3.0, passed)


TASKS: dict[str, Callable[[], Scene]] = {
    task.__name__.replace("_", " "): task
    for task in (
        *(ball_into_mug, peg_into_hole, mug_on_hook, chair_under_load, nut_onto_bolt, drawer_that_opens),
        *(gripper_lifts_plate, gears_that_mesh, pile_of_fifty, stack_of_ten),
    )
}
