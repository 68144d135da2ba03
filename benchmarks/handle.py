"""Handling in a simulator: objects are grasped between two fingertips, and hung on a peg, as by the exact mesh."""

from __future__ import annotations

import tempfile
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.simulate import BALL, NEAR, SIZE, above, exact_depths, get_mujoco, surface_of
from rlacd import _native
from rlacd.io.write import save
from rlacd.result import Result
from rlacd.solid.arrays import BoolArray, FloatArray

GRASPS, PEGS = 12, 6
"""At most this many of either are tried, spread over those that the exact mesh allows."""

FINE = 40
"""Holes are sought along this many lines squared."""

OPENING = 0.5
"""How far apart the fingertips may be, in longest sides: as a small gripper's, 10 cm at an object of 20 cm."""

STEEP = 0.97
"""Least cosine of the angle (14 degrees) between a grasp and the surface's normals at both fingertips."""

SQUEEZE = 5.0
"""Force of a fingertip, in multiples of the object's weight."""

CLOSING, HELPED = 0.2, 0.1
"""Metres per second at which fingertips close, and seconds for which the object stays in its place."""

PEG = 0.01
"""Radius of a peg, in longest sides."""

SECONDS, STEP = 1.0, 0.001


@dataclass(frozen=True)
class Handling:
    """Which grasps and pegs hold.

    Attributes
    ----------
    grasps, held : int
        Lines along which two fingertips, by the exact mesh, meet the surface squarely from both sides; those at which
        the fingertips, pressed together while the object hangs between them, end as far apart as by the exact mesh, to
        within `NEAR` on either side.
    pegs, hung : int
        Holes that a straight line along an axis passes, with room for twice the peg's radius, and that the object
        encloses as seen along it, by the exact mesh; those by which the object still hangs on a peg after a second.
    """

    grasps: int
    held: int
    pegs: int
    hung: int


def handle_in_mujoco(result: Result) -> Handling:
    """Grasp and hang a body whose longest side is `SIZE`, in MuJoCo."""
    grasps, pegs = _lines(result)
    with tempfile.TemporaryDirectory(prefix="rlacd-") as folder:
        path = save(result, Path(folder) / "body.xml")
        held = sum(_is_held(path, *grasp) for grasp in grasps)
        hung = sum(_hangs(path, *peg, _centre(result)) for peg in pegs)
    return Handling(len(grasps), held, len(pegs), hung)


def _lines(result: Result) -> tuple[list[tuple[FloatArray, FloatArray, float]], list[tuple[FloatArray, FloatArray]]]:
    """Grasps: both fingertips' places [2, 3] by the exact mesh, their way, and the gap; pegs: a place and the way."""
    surface = surface_of(result.source)
    grasps: list[tuple[FloatArray, FloatArray, float]] = []
    pegs: list[tuple[FloatArray, FloatArray]] = []
    for axis in range(3):
        starts, way, far = above(result.source.bounds, axis, 1.0)
        ends, back, _ = above(result.source.bounds, axis, -1.0)
        first, second = exact_depths(surface, starts, way, far), exact_depths(surface, ends, back, far)
        tips = np.stack([starts + first[:, None] * way, ends + second[:, None] * back], axis=1)
        gaps = far - first - second
        for line in np.flatnonzero((first < far) & (gaps > 0) & (gaps <= OPENING * SIZE + 2 * BALL * SIZE)):
            if all(_is_square(surface, tip, way) for tip in tips[line]):
                grasps.append((tips[line], way, float(gaps[line])))
        lines, _, _ = above(result.source.bounds, axis, 1.0, FINE)
        free = exact_depths(surface, lines, way, far, 2 * PEG) >= far
        pegs += [(lines[line] + way * far / 2, way) for line in _enclosed(free.reshape(FINE, FINE))]
    return _spread(grasps, GRASPS), _spread(pegs, PEGS)


def _spread(some: list[Any], most: int) -> list[Any]:
    return [some[place] for place in np.unique(np.linspace(0, len(some) - 1, min(most, len(some))).astype(int))]


def _enclosed(free: BoolArray) -> list[int]:
    """The middle of each region of free cells [N, N] that no path of free cells joins to the border, by its place."""
    regions = _native.label_cells(np.pad(free, 1, constant_values=True)[..., None]).reshape(len(free) + 2, -1)
    inner = regions[1:-1, 1:-1]
    blocked = np.argwhere(~free)
    middles = []
    for region in np.unique(regions):
        if region not in (0, regions[0, 0]):
            cells = np.argwhere(inner == region)
            away = np.linalg.norm(cells[:, None] - blocked[None], axis=2).min(axis=1)
            middles.append(int(np.ravel_multi_index(tuple(cells[away.argmax()]), free.shape)))
    return middles


def _is_square(surface: _native.Surface, tip: FloatArray, way: FloatArray) -> bool:
    """Whether the surface's normal at a fingertip is along its way, by differences of the distance."""
    step = 1e-3 * SIZE
    around = np.concatenate([tip + step * np.eye(3), tip - step * np.eye(3)])
    distances = surface.distance(np.ascontiguousarray(around))
    normal = (distances[:3] - distances[3:]) / (2 * step)
    return bool(abs(normal @ way) >= STEEP)


def _centre(result: Result) -> FloatArray:
    return np.array(result.report["mass"]["centre_abs"])


def _is_held(path: Path, tips: FloatArray, way: FloatArray, gap: float) -> bool:
    """Press two fingertips together on an object that gravity pulls sideways; they stay as far apart as they should."""
    mujoco = get_mujoco()
    spec = mujoco.MjSpec.from_file(str(path))
    sideways = np.roll(way, 1)
    spec.option.gravity, spec.option.timestep = (-9.81 * sideways).tolist(), STEP
    for tip, towards in zip(tips, (way, -way), strict=True):
        finger = spec.worldbody.add_body(pos=(tip - towards * NEAR * SIZE).tolist())
        finger.add_joint(type=mujoco.mjtJoint.mjJNT_SLIDE, axis=towards.tolist())
        finger.add_geom(
            type=mujoco.mjtGeom.mjGEOM_SPHERE,
            size=[BALL * SIZE, 0, 0],
            mass=1.0,
            friction=[1.0, 0.02, 0.001],
            condim=4,
            contype=2,
            conaffinity=1,
        )
    model = spec.compile()
    data = mujoco.MjData(model)
    weight = 9.81 * model.body_mass[1]
    model.body_mass[2:] = model.body_mass[1]
    model.dof_damping[6:] = SQUEEZE * weight / CLOSING
    data.qfrc_applied[6:] = SQUEEZE * weight
    for step in range(round(SECONDS / STEP)):
        if step * STEP < HELPED:  # the object is held by hand until the fingertips have closed
            data.qvel[:6] = 0.0
        mujoco.mj_step(model, data)
    closed = gap + 2 * NEAR * SIZE - float(data.qpos[7:].sum())
    return bool(_is_stable(data) and abs(closed - gap) <= 2 * NEAR * SIZE)


def _is_stable(data: Any) -> bool:
    """Whether MuJoCo never had to begin again."""
    return all(warning.number == 0 for warning in data.warning)


def _hangs(path: Path, place: FloatArray, way: FloatArray, centre: FloatArray) -> bool:
    """Put a peg through a hole of an object that gravity pulls away from it, and let go."""
    mujoco = get_mujoco()
    spec = mujoco.MjSpec.from_file(str(path))
    down = centre - place
    down -= (down @ way) * way
    distance = float(np.linalg.norm(down))
    down = down / distance if distance > 1e-6 else np.roll(way, 1)
    spec.option.gravity, spec.option.timestep = (9.81 * down).tolist(), STEP
    spec.worldbody.add_geom(
        type=mujoco.mjtGeom.mjGEOM_CAPSULE,
        size=[PEG * SIZE, 0, 0],
        fromto=[*(place - way * SIZE), *(place + way * SIZE)],
    )
    model = spec.compile()
    data = mujoco.MjData(model)
    for _ in range(round(SECONDS / STEP)):
        mujoco.mj_step(model, data)
    sunk = float((data.xipos[1] - centre) @ down)
    return bool(_is_stable(data) and sunk < 0.5 * SIZE and np.linalg.norm(data.qvel[:3]) < 2.0)
