"""Where the links of a robot are: at rest, and at joint positions spread over what the joints allow.

Kinematics are those of yourdfpy for URDF and of MuJoCo for MJCF. Positions are a Sobol sequence (Sobol', "On the
distribution of points in a cube", 1967), scrambled by the seed.
"""

from __future__ import annotations

import logging
import math
from collections.abc import Collection, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from rlacd.errors import import_extra
from rlacd.solid.arrays import FloatArray

SAMPLES = 500
"""Joint positions that are looked at, beside that at rest."""

_FOR = "checking that links stay clear of each other"


@dataclass(frozen=True)
class Motion:
    """Where links are.

    Attributes
    ----------
    links : tuple of str
    poses : float64 [S, L, 4, 4]
        From each link's frame to one that all share; the first sample is at rest.
    joints : tuple of str
        Those that move.
    positions : float64 [S, J]
        Of these joints, in radians or the unit of length.
    adjacent : frozenset of (int, int)
        Links that one joint connects, the lower number first.
    warnings : tuple of str
        What a joint's range was taken to be, where the file does not say.
    fixed : frozenset of int
        Links that never move: of two of them, hulls may touch.
    carrier : tuple of int
        For each link, the last below it, or itself, whose joint was looked at only at rest; -1 if there is none.
    """

    links: tuple[str, ...]
    poses: FloatArray
    joints: tuple[str, ...] = ()
    positions: FloatArray = field(default_factory=lambda: np.zeros((1, 0)))
    adjacent: frozenset[tuple[int, int]] = frozenset()
    warnings: tuple[str, ...] = ()
    fixed: frozenset[int] = frozenset()
    carrier: tuple[int, ...] = ()

    def some(self, links: Sequence[str]) -> Motion:
        """Of some of the links, in the given order. Those between two of them do not keep them from being adjacent."""
        place = {name: i for i, name in enumerate(self.links)}
        chosen = [place[name] for name in links]
        new = {old: i for i, old in enumerate(chosen)}
        pairs = {(min(new[a], new[b]), max(new[a], new[b])) for a, b in self._joined(set(chosen))}
        carrier = tuple(self.carrier[i] for i in chosen)
        own = tuple(links), self.poses[:, chosen], self.joints, self.positions, frozenset(pairs), self.warnings
        return Motion(*own, frozenset(new[i] for i in self.fixed & {*chosen}), carrier)

    def _joined(self, kept: set[int]) -> set[tuple[int, int]]:
        """Pairs of kept links that are adjacent, directly or across links that are not kept."""
        near: dict[int, set[int]] = {}
        for a, b in self.adjacent:
            near.setdefault(a, set()).add(b)
            near.setdefault(b, set()).add(a)
        found = set()
        for start in kept:
            seen, waiting = {start}, [start]
            while waiting:
                for link in near.get(waiting.pop(), set()) - seen:
                    seen.add(link)
                    if link in kept:
                        found.add((min(start, link), max(start, link)))
                    else:
                        waiting.append(link)
        return found

    def words(self, sample: int) -> str:
        """The joint position of a sample, as text."""
        if sample == 0 or not self.joints:
            return "at rest"
        moved = zip(self.joints, self.positions[sample], strict=True)
        return "at " + ", ".join(f"{name} = {value:.4g}" for name, value in moved)


def at_rest(links: Sequence[str], fixed: Collection[str] = ()) -> Motion:
    """Links that share a frame and are looked at where they are; those that are fixed may touch each other."""
    places = frozenset(i for i, name in enumerate(links) if name in fixed)
    poses = np.tile(np.eye(4), (1, len(links), 1, 1))
    return Motion(tuple(links), poses, fixed=places, carrier=tuple(range(len(links))))


class _Joint(NamedTuple):
    name: str
    lower: float
    upper: float


def _positions(joints: Sequence[_Joint], samples: int, seed: int) -> FloatArray:
    """Rest, then so many samples [1 + samples, J]."""
    rest = np.zeros((1, len(joints)))
    if not joints or samples <= 0:
        return rest
    qmc = import_extra("scipy.stats.qmc", _FOR, "clear")
    sobol = qmc.Sobol(len(joints), scramble=True, rng=np.random.default_rng(seed))
    spread = sobol.random_base2(math.ceil(math.log2(samples)))[:samples]
    lower, upper = (np.array([getattr(joint, side) for joint in joints]) for side in ("lower", "upper"))
    return np.concatenate([rest, lower + spread * (upper - lower)])


def _range(kind: str, name: str, limits: tuple[float, float] | None, said: list[str]) -> _Joint | None:
    """What is sampled of a joint that turns or slides; None if it stays at rest, which `said` tells."""
    if limits is not None and limits[0] < limits[1] and all(map(math.isfinite, limits)):
        return _Joint(name, *limits)
    if kind == "turns":
        if limits is None or limits[0] >= limits[1]:
            said.append(f"the joint {name} has no limits, so a whole turn was looked at")
        return _Joint(name, -math.pi, math.pi)
    said.append(f"the joint {name} {kind}, so it was looked at only at rest")
    return None


def urdf_motion(path: Path, samples: int = SAMPLES, seed: int = 0) -> Motion:
    """Where the links of a URDF are.

    Raises
    ------
    MissingExtraError
        The extra ``clear`` is not installed.
    """
    yourdfpy = import_extra("yourdfpy", _FOR, "clear")
    with _quiet("yourdfpy"):
        robot = yourdfpy.URDF.load(str(path), load_meshes=False, build_collision_scene_graph=False)
    said: list[str] = []
    found = [_range(*_urdf_limits(joint), said) for joint in robot.actuated_joints]
    joints = [joint for joint in found if joint is not None]
    positions = _positions(joints, samples, seed)
    links = [link.name for link in robot.robot.links]
    poses = np.tile(np.eye(4), (len(positions), len(links), 1, 1))
    for sample, values in zip(poses, positions.tolist(), strict=True):
        robot.update_cfg(dict(zip((joint.name for joint in joints), values, strict=True)))
        for place, name in enumerate(links):
            sample[place] = robot.get_transform(name)
    parents = {links.index(joint.child): links.index(joint.parent) for joint in robot.robot.joints}
    sampled = {joint.name for joint in joints}
    held = {j.child for j in robot.actuated_joints if j.name not in sampled}
    carrier = _carriers(parents, {links.index(child) for child in held}, len(links))
    names = tuple(joint.name for joint in joints)
    return Motion(tuple(links), poses, names, positions, _pairs(parents), tuple(said), carrier=carrier)


def _pairs(parents: Mapping[int, int]) -> frozenset[tuple[int, int]]:
    return frozenset((min(pair), max(pair)) for pair in parents.items())


def _carriers(parents: Mapping[int, int], held: Collection[int], count: int) -> tuple[int, ...]:
    """For each link, the last of those held at rest on the way down to it; -1 if there is none."""

    def carrier(link: int) -> int:
        while link not in held:
            if link not in parents:
                return -1
            link = parents[link]
        return link

    return tuple(carrier(link) for link in range(count))


@contextmanager
def _quiet(name: str) -> Iterator[None]:
    """Keep a library from logging anything but errors: what it warns of does not concern kinematics."""
    logger = logging.getLogger(name)
    level = logger.level
    logger.setLevel(logging.ERROR)
    try:
        yield
    finally:
        logger.setLevel(level)


def _urdf_limits(joint: Any) -> tuple[str, str, tuple[float, float] | None]:
    if joint.type == "continuous":
        return "turns", joint.name, (-math.inf, math.inf)
    limit = joint.limit
    known = limit is not None and limit.lower is not None and limit.upper is not None
    limits = (float(limit.lower), float(limit.upper)) if known else None
    kinds = {"revolute": "turns", "prismatic": "slides without limits"}
    return kinds.get(joint.type, f"is {joint.type}"), joint.name, limits if joint.type in kinds else None


def mjcf_motion(path: Path, samples: int = SAMPLES, seed: int = 0) -> Motion:
    """Where the bodies of an MJCF model are; joints that others drive by a joint equality follow them.

    Raises
    ------
    MissingExtraError
        The extra ``clear`` is not installed.
    ValueError
        MuJoCo does not read the model.
    """
    mujoco = import_extra("mujoco", _FOR, "clear")
    model = mujoco.MjModel.from_xml_path(str(path))
    data, said = mujoco.MjData(model), list[str]()
    driven = _driven(model, mujoco)
    joints, at, sampled = [], [], {*driven}
    for j in range(model.njnt):
        name, kind = model.joint(j).name or f"number {j}", int(model.jnt_type[j])
        if j in driven:
            continue
        kinds = {int(mujoco.mjtJoint.mjJNT_HINGE): "turns", int(mujoco.mjtJoint.mjJNT_SLIDE): "slides without limits"}
        limits = tuple(model.jnt_range[j].tolist()) if model.jnt_limited[j] else None
        joint = _range(kinds.get(kind, "is free or a ball"), name, limits if kind in kinds else None, said)
        if joint is not None:
            joints.append(joint)
            at.append(int(model.jnt_qposadr[j]))
            sampled.add(j)
    positions = _positions(joints, samples, seed)
    poses = np.tile(np.eye(4), (len(positions), model.nbody, 1, 1))
    for row, (sample, values) in enumerate(zip(poses, positions, strict=True)):
        data.qpos[:] = model.qpos0
        if row:
            data.qpos[at] = values
        for slave, (master, curve) in driven.items():
            away = 0.0 if master < 0 else data.qpos[model.jnt_qposadr[master]] - model.qpos0[model.jnt_qposadr[master]]
            start = model.jnt_qposadr[slave]
            data.qpos[start] = model.qpos0[start] + sum(c * away**power for power, c in enumerate(curve))
        mujoco.mj_kinematics(model, data)
        sample[:, :3, :3], sample[:, :3, 3] = data.xmat.reshape(-1, 3, 3), data.xpos
    positions[0] = model.qpos0[at]
    links = [model.body(i).name or f"body_{i}" for i in range(model.nbody)]
    parents = {i: int(p) for i, p in enumerate(model.body_parentid) if i}
    held = {int(model.jnt_bodyid[j]) for j in range(model.njnt)} - {int(model.jnt_bodyid[j]) for j in sampled}
    names, carrier = tuple(joint.name for joint in joints), _carriers(parents, held, model.nbody)
    return Motion(tuple(links), poses, names, positions, _pairs(parents), tuple(said), carrier=carrier)


def _driven(model: Any, mujoco: Any) -> dict[int, tuple[int, list[float]]]:
    """Joints that a joint equality sets, with the joint that drives each (-1: none) and the polynomial."""
    is_joint = np.flatnonzero(model.eq_type == int(mujoco.mjtEq.mjEQ_JOINT))
    return {
        int(model.eq_obj1id[e]): (int(model.eq_obj2id[e]), model.eq_data[e, :5].tolist())
        for e in is_joint
        if model.eq_active0[e]
    }
