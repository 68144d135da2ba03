"""What a simulator makes of a decomposition: a pile of copies settles, and balls are dropped into every hollow."""

from __future__ import annotations

import tempfile
import time
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import trimesh

from rlacd import _native
from rlacd.errors import MissingExtraError
from rlacd.io.read.load import load_mesh
from rlacd.io.write import save
from rlacd.result import Result
from rlacd.solid.arrays import FloatArray, IntArray

SIZE = 0.2
"""Longest side of every object in metres; simulators are tuned for things that a hand can hold."""

COPIES, SECONDS, STEP = 20, 2.5, 0.002

WARP_STEPS = 100
"""Steps that are timed in MuJoCo Warp."""

PAIRS = 3000
"""Room in each world for pairs of hulls whose boxes meet."""

BIN = 1.6
"""Half the width of the bin that the pile falls into, in longest sides."""

GRID = 7
"""Balls are dropped on a grid of this many per side, along each of the six directions of the axes."""

BALL = 0.03
"""Radius of the balls, in longest sides."""

NEAR = 0.025
"""How far from its true place a ball may rest, in longest sides: the usual threshold of 0.05, in the frame."""

FALL_SPEED, DROP_STEP = 0.5, 0.001
"""The speed in metres per second at which balls fall, so slowly that they tunnel through nothing."""


@dataclass(frozen=True)
class Drops:
    """Where balls came to rest.

    Attributes
    ----------
    holes, passed : int
        Balls that, by the exact mesh, pass through the object's convex hull to the other side; those that did.
    hollows, rested : int
        Balls that, by the exact mesh, come to rest more than `NEAR` inside the object's convex hull; those that came to
        rest within `NEAR` of that place.

    Balls are counted only if one wider by `NEAR` does the same: others may differ by what the threshold allows.
    """

    holes: int
    passed: int
    hollows: int
    rested: int


def model_size(result: Result) -> int:
    """Bytes of a body's MJCF file and its collision meshes."""
    with tempfile.TemporaryDirectory(prefix="rlacd-") as folder:
        save(result, Path(folder) / "body.xml")
        files = [path for path in Path(folder).rglob("*") if path.is_file()]
        return sum(path.stat().st_size for path in files if "_visual" not in path.name)


def scaled_source(path: Path) -> tuple[tuple[FloatArray, IntArray], float, FloatArray]:
    """Read a mesh, centred and scaled to `SIZE`: its vertices and faces, the factor, and what was its centre."""
    source = load_mesh(path)
    used = source.vertices[np.unique(source.faces)]
    low, high = used.min(axis=0), used.max(axis=0)
    factor, centre = SIZE / float((high - low).max()), (low + high) / 2
    return ((source.vertices - centre) * factor, source.faces.astype(np.int32)), factor, centre


def pile_in_mujoco(result: Result, seed: int = 0) -> tuple[float, float]:
    """Drop copies of a body whose longest side is `SIZE`, turned by the seed, into a bin, in MuJoCo.

    Returns
    -------
    steps_per_second : float
        Steps per CPU second.
    contacts : float
        Mean number of contacts per step, over the last second.
    """
    mujoco = get_mujoco()
    model = _pile(result, seed)
    data = mujoco.MjData(model)
    steps = round(SECONDS / STEP)
    contacts = np.zeros(steps)
    began = time.process_time()
    for step in range(steps):
        mujoco.mj_step(model, data)
        contacts[step] = data.ncon
    return steps / (time.process_time() - began), float(contacts[-round(1 / STEP) :].mean())


def pile_in_warp(result: Result, worlds: int, seed: int = 0) -> float:
    """Time the same pile once it lies, in many worlds at once, in MuJoCo Warp; on a GPU if there is one.

    Returns
    -------
    steps_per_second : float
        Steps of all worlds together, per second of wall time.

    Raises
    ------
    RuntimeError
        A world has more contacts than there was room for, so that it is not what MuJoCo simulates.
    """
    mujoco, (warp, mujoco_warp) = get_mujoco(), get_warp()
    model = _pile(result, seed)
    data = mujoco.MjData(model)
    mujoco.mj_step(model, data, round((SECONDS - 0.5) / STEP))
    most = 8 * data.ncon + 200  # four rows a contact, and as much again
    there = mujoco_warp.put_model(model)
    now = mujoco_warp.put_data(model, data, nworld=worlds, nconmax=PAIRS, njmax=most)
    for _ in range(3):  # compiles the kernels
        mujoco_warp.step(there, now)
    step: Callable[[], None] = partial(mujoco_warp.step, there, now)
    if warp.is_cuda_available():
        with warp.ScopedCapture() as capture:
            step()
        step = partial(warp.capture_launch, capture.graph)
    warp.synchronize()
    began = time.perf_counter()
    for _ in range(WARP_STEPS):
        step()
    warp.synchronize()
    spent = time.perf_counter() - began
    if now.nefc.numpy().max() >= most or now.ncollision.numpy().max() >= PAIRS * worlds:
        raise RuntimeError("MuJoCo Warp had no room for all contacts; raise PAIRS.")
    return worlds * WARP_STEPS / spent


def _pile(result: Result, seed: int) -> Any:
    """MuJoCo's model of copies above a bin, each turned by the seed."""
    mujoco = get_mujoco()
    random = np.random.default_rng(seed)
    places = [(x, y, 1.0 + 1.2 * z) for z in range(COPIES) for x in (-0.7, 0.7) for y in (-0.7, 0.7)][:COPIES]
    spec = mujoco.MjSpec()
    spec.option.timestep = STEP
    with tempfile.TemporaryDirectory(prefix="rlacd-") as folder:
        body = mujoco.MjSpec.from_file(str(save(result, Path(folder) / "body.xml")))
        for index, (place, turn) in enumerate(zip(places, random.normal(size=(COPIES, 4)), strict=True)):
            frame = spec.worldbody.add_frame(pos=[SIZE * x for x in place], quat=turn / np.linalg.norm(turn))
            spec.attach(body.copy(), prefix=f"{index}_", frame=frame)
        for normal in [(0, 0, 1), (1, 0, 0), (-1, 0, 0), (0, 1, 0), (0, -1, 0)]:
            at = [-BIN * SIZE * x * (normal[2] == 0) for x in normal]
            plane = mujoco.mjtGeom.mjGEOM_PLANE
            spec.worldbody.add_geom(type=plane, size=[9, 9, 1], pos=at, zaxis=normal)
        return spec.compile()


def drops_in_mujoco(result: Result) -> Drops:
    """Drop balls onto a fixed body whose longest side is `SIZE`, from all six sides, in MuJoCo."""
    surface, around = surface_of(result.source), surface_of(result.source.convex_hull)
    counts = np.zeros(4, dtype=int)
    for axis in range(3):
        for sign in (-1.0, 1.0):
            starts, way, far = above(result.source.bounds, axis, sign)
            true = exact_depths(surface, starts, way, far)
            wide = exact_depths(surface, starts, way, far, BALL + NEAR)
            met = exact_depths(around, starts, way, far)
            found = _depths_in_mujoco(result, starts, axis, sign, far)
            holes = (met < far) & (wide >= far)
            hollows = (true < far) & (true > met + NEAR * SIZE) & (wide > true - 2 * NEAR * SIZE)
            passed = holes & (found >= far - NEAR * SIZE)
            rested = hollows & (np.abs(found - true) <= NEAR * SIZE)
            counts += [holes.sum(), passed.sum(), hollows.sum(), rested.sum()]
    return Drops(*counts.tolist())


def _depths_in_mujoco(result: Result, starts: FloatArray, axis: int, sign: float, far: float) -> FloatArray:
    """How far balls fall; each slides along its own line, slowed so that it does not tunnel through anything."""
    mujoco = get_mujoco()
    with tempfile.TemporaryDirectory(prefix="rlacd-") as folder:
        path = save(result, Path(folder) / "body.xml")
        spec = mujoco.MjSpec.from_file(str(path))
        (body,) = spec.worldbody.bodies
        for joint in body.joints:
            spec.delete(joint)
        way = np.zeros(3)
        way[axis] = sign
        spec.option.gravity, spec.option.timestep = (9.81 * way).tolist(), DROP_STEP
        for start in starts:
            ball = spec.worldbody.add_body(pos=start.tolist())
            ball.add_joint(type=mujoco.mjtJoint.mjJNT_SLIDE, axis=way.tolist(), damping=9.81 / FALL_SPEED)
            geom = ball.add_geom(type=mujoco.mjtGeom.mjGEOM_SPHERE, size=[BALL * SIZE, 0, 0], mass=1.0)
            geom.contype, geom.conaffinity = 2, 1  # they meet the body, not each other
            # As hard as the step allows, without friction: with MuJoCo's defaults, a ball that lands beside the top of
            # an edge creeps past it, even past that of a single box.
            geom.priority, geom.solref, geom.friction = 1, [2 * DROP_STEP, 1.0], [0.0, 0.0, 0.0]
        model = spec.compile()
    data = mujoco.MjData(model)
    starting = 1.5 * FALL_SPEED / 9.81  # what it takes to come to that speed; more lets balls creep down steep walls
    for _ in range(round((1.05 * far / FALL_SPEED + starting) / DROP_STEP)):
        mujoco.mj_step(model, data)
    fallen: FloatArray = np.minimum(np.array(data.qpos), far)
    return fallen


def surface_of(mesh: trimesh.Trimesh) -> _native.Surface:
    """Make the surface of a mesh, which measures exact distances."""
    vertices, faces = np.asarray(mesh.vertices, dtype=np.float64), np.asarray(mesh.faces, dtype=np.int32)
    return _native.Surface(np.ascontiguousarray(vertices), np.ascontiguousarray(faces))


def above(bounds: FloatArray, axis: int, sign: float, grid: int = GRID) -> tuple[FloatArray, FloatArray, float]:
    """Where balls start [N, 3], outside the box; the way they fall [3]; and how far it is to the other side."""
    low, high = np.asarray(bounds)
    others = [other for other in range(3) if other != axis]
    lines = [np.linspace(low[other], high[other], grid + 2)[1:-1] for other in others]
    starts = np.zeros((grid**2, 3))
    starts[:, others] = np.stack(np.meshgrid(*lines, indexing="ij"), axis=-1).reshape(-1, 2)
    clearance = 1.5 * BALL * SIZE
    starts[:, axis] = (low if sign > 0 else high)[axis] - sign * clearance
    way = np.zeros(3)
    way[axis] = sign
    return starts, way, float((high - low)[axis] + 2 * clearance)


def exact_depths(
    surface: _native.Surface, starts: FloatArray, way: FloatArray, far: float, ball: float = BALL
) -> FloatArray:
    """How far balls fall until they touch a surface, by sphere tracing; `far` if they do not."""
    fallen = np.zeros(len(starts))
    moving = np.ones(len(starts), dtype=bool)
    while moving.any():
        free = surface.distance(np.ascontiguousarray(starts[moving] + fallen[moving, None] * way)) - ball * SIZE
        fallen[moving] += np.maximum(free, 1e-5)
        moving[moving] = (free > 1e-5) & (fallen[moving] < far)
    depths: FloatArray = np.minimum(fallen, far)
    return depths


def get_mujoco() -> Any:
    """Import MuJoCo, or say how to install it."""
    try:
        import mujoco
    except ImportError as error:
        raise MissingExtraError("MuJoCo is missing: run  pip install 'rlacd[sim]'  and try again.") from error
    return mujoco


def get_warp() -> tuple[Any, Any]:
    """Import Warp and MuJoCo Warp, or say how to install them."""
    try:
        import mujoco_warp
        import warp
    except ImportError as error:
        raise MissingExtraError("MuJoCo Warp is missing: run  pip install mujoco-warp  and try again.") from error
    warp.config.quiet = True
    return warp, mujoco_warp
