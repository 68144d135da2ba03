"""Where the links of a robot are: at rest, and at joint positions spread over what the joints allow.

Kinematics are those of yourdfpy for URDF and of MuJoCo for MJCF. Positions are a Sobol sequence (Sobol', "On the
distribution of points in a cube", 1967), scrambled by the seed.
"""

from __future__ import annotations

import logging
import math
from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from rlacd.errors import import_extra
from rlacd.solid.arrays import FloatArray

SAMPLES = 500
"""Joint positions that are looked at, beside that at rest."""

_SLIDE, _HINGE = 2, 3
"""``mjtJoint`` of MuJoCo."""

_FOR = "checking that links stay clear of each other"


@dataclass(frozen=True)
class Joint:
    """A joint that turns or slides; vectors are in the frame that all links share, with all joints at rest.

    Attributes
    ----------
    name : str
    slides : bool
    lower, upper, rest : float
        In radians or the unit of length.
    anchor, axis : float64 [3]
        A point on its axis, and the axis' direction.
    parent : int
        The joint that carries it; -1 if none does.
    leader : int
        The joint that drives it; -1 if none does.
    curve : tuple of float
        How far it is then from rest: a polynomial in how far its leader is, from the linear term up.
    """

    name: str
    slides: bool
    lower: float
    upper: float
    rest: float
    anchor: FloatArray
    axis: FloatArray
    parent: int = -1
    leader: int = -1
    curve: tuple[float, ...] = ()


@dataclass(frozen=True)
class Motion:
    """Where links are.

    Attributes
    ----------
    links : tuple of str
    poses : float64 [S, L, 4, 4]
        From each link's frame to one that all share; the first sample is at rest.
    joints : tuple of Joint
        Those that move: first those that are sampled, then those that others drive.
    positions : float64 [S, J]
        Of the sampled joints, in radians or the unit of length.
    adjacent : frozenset of (int, int)
        Links that one joint connects, the lower number first.
    warnings : tuple of str
        What a joint's range was taken to be, where the file does not say.
    fixed : frozenset of int
        Links that never move: of two of them, hulls may touch.
    carrier : tuple of int
        For each link, the last below it, or itself, whose joint was looked at only at rest; -1 if there is none.
    carried : tuple of int
        For each link, the joint that carries it; -1 if none does.
    place : callable
        Takes positions [J] and returns the poses of links [L, 4, 4].
    """

    links: tuple[str, ...]
    poses: FloatArray
    joints: tuple[Joint, ...] = ()
    positions: FloatArray = field(default_factory=lambda: np.zeros((1, 0)))
    adjacent: frozenset[tuple[int, int]] = frozenset()
    warnings: tuple[str, ...] = ()
    fixed: frozenset[int] = frozenset()
    carrier: tuple[int, ...] = ()
    carried: tuple[int, ...] = ()
    place: Callable[[FloatArray], FloatArray] | None = None

    @property
    def sampled(self) -> tuple[Joint, ...]:
        """The joints that others do not drive."""
        return self.joints[: self.positions.shape[1]]

    def at(self, positions: Sequence[float]) -> Motion:
        """The same links, only where other positions of the sampled joints put them."""
        row = np.array([positions], dtype=np.float64)
        return replace(self, positions=row, poses=self.poses[:1] if self.place is None else self.place(row[0])[None])

    def some(self, links: Sequence[str]) -> Motion:
        """Of some of the links, in the given order. Those between two of them do not keep them from being adjacent."""
        numbers = {name: i for i, name in enumerate(self.links)}
        chosen = [numbers[name] for name in links]
        new = {old: i for i, old in enumerate(chosen)}
        pairs = {(min(new[a], new[b]), max(new[a], new[b])) for a, b in self._joined(set(chosen))}
        place = self.place
        return replace(
            self,
            links=tuple(links),
            poses=self.poses[:, chosen],
            adjacent=frozenset(pairs),
            fixed=frozenset(new[i] for i in self.fixed & {*chosen}),
            carrier=tuple(self.carrier[i] for i in chosen),
            carried=tuple(self.carried[i] for i in chosen),
            place=None if place is None else lambda positions: place(positions)[chosen],
        )

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
        if sample == 0 or not self.sampled:
            return "at rest"
        moved = zip(self.sampled, self.positions[sample], strict=True)
        return "at " + ", ".join(f"{joint.name} = {value:.4g}" for joint, value in moved)


def at_rest(links: Sequence[str], fixed: Collection[str] = ()) -> Motion:
    """Links that share a frame and are looked at where they are; those that are fixed may touch each other."""
    places = frozenset(i for i, name in enumerate(links) if name in fixed)
    poses = np.tile(np.eye(4), (1, len(links), 1, 1))
    return Motion(tuple(links), poses, fixed=places, carrier=tuple(range(len(links))), carried=(-1,) * len(links))


class _Range(NamedTuple):
    name: str
    slides: bool
    lower: float
    upper: float


def _positions(joints: Sequence[_Range], samples: int, seed: int) -> FloatArray:
    """Rest, then so many samples [1 + samples, J]."""
    rest = np.zeros((1, len(joints)))
    if not joints or samples <= 0:
        return rest
    qmc = import_extra("scipy.stats.qmc", _FOR, "clear")
    sobol = qmc.Sobol(len(joints), scramble=True, rng=np.random.default_rng(seed))
    spread = sobol.random_base2(math.ceil(math.log2(samples)))[:samples]
    lower, upper = (np.array([getattr(joint, side) for joint in joints]) for side in ("lower", "upper"))
    return np.concatenate([rest, lower + spread * (upper - lower)])


def _range(kind: str, name: str, limits: tuple[float, float] | None, said: list[str]) -> _Range | None:
    """What is sampled of a joint that turns or slides; None if it stays at rest, which `said` tells."""
    if limits is not None and limits[0] < limits[1] and all(map(math.isfinite, limits)):
        return _Range(name, kind != "turns", *limits)
    if kind == "turns":
        if limits is None or limits[0] >= limits[1]:
            said.append(f"the joint {name} has no limits, so a whole turn was looked at")
        return _Range(name, False, -math.pi, math.pi)
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
    ranges = {each.name: each for joint in robot.actuated_joints if (each := _range(*_urdf_limits(joint), said))}
    links = [link.name for link in robot.robot.links]

    def place(positions: FloatArray) -> FloatArray:
        robot.update_cfg(dict(zip(ranges, positions.tolist(), strict=True)))
        return np.stack([robot.get_transform(name) for name in links])

    positions = _positions([*ranges.values()], samples, seed)
    poses = np.stack([place(row) for row in positions])
    parents = {links.index(joint.child): links.index(joint.parent) for joint in robot.robot.joints}
    held = {links.index(joint.child) for joint in robot.actuated_joints if joint.name not in ranges}
    carrier = _last(parents, {link: link for link in held}, len(links))
    joints, carried = _urdf_joints(robot.robot, ranges, parents, dict(zip(links, poses[0], strict=True)))
    near = _pairs(parents)
    return Motion(tuple(links), poses, joints, positions, near, tuple(said), frozenset(), carrier, carried, place)


def _urdf_joints(
    robot: Any, ranges: Mapping[str, _Range], parents: Mapping[int, int], rest: Mapping[str, FloatArray]
) -> tuple[tuple[Joint, ...], tuple[int, ...]]:
    """The joints that move, and for each link that which carries it."""
    known, places = {joint.name: joint for joint in robot.joints}, [*rest]
    driven = [j for j in robot.joints if j.mimic is not None and j.mimic.joint in ranges and j.type != "fixed"]
    moving = [*(known[name] for name in ranges), *driven]
    names = [joint.name for joint in moving]
    carried = _last(parents, {places.index(joint.child): i for i, joint in enumerate(moving)}, len(places))
    made = []
    for joint in moving:
        axis = np.array([1.0, 0.0, 0.0] if joint.axis is None else joint.axis, dtype=np.float64)
        pose, parent = rest[joint.child], carried[places.index(joint.parent)]
        where = pose[:3, 3], (pose[:3, :3] * axis / np.linalg.norm(axis)).sum(axis=1)
        if joint.name in ranges:
            _, slides, lower, upper = ranges[joint.name]
            made.append(Joint(joint.name, slides, lower, upper, 0.0, *where, parent))
        else:
            leader, times = names.index(joint.mimic.joint), joint.mimic.multiplier
            by = leader, (1.0 if times is None else float(times),)
            made.append(Joint(joint.name, joint.type == "prismatic", 0.0, 0.0, 0.0, *where, parent, *by))
    return tuple(made), carried


def _pairs(parents: Mapping[int, int]) -> frozenset[tuple[int, int]]:
    return frozenset((min(pair), max(pair)) for pair in parents.items())


def _last(parents: Mapping[int, int], what: Mapping[int, int], count: int) -> tuple[int, ...]:
    """For each link, what the last link on the way down to it has, or itself; -1 if none has anything."""

    def last(link: int) -> int:
        while link not in what:
            if link not in parents:
                return -1
            link = parents[link]
        return what[link]

    return tuple(last(link) for link in range(count))


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
    ranges = _mjcf_ranges(model, driven, said)
    at = model.jnt_qposadr[[*ranges]]

    def place(positions: FloatArray) -> FloatArray:
        data.qpos[:] = model.qpos0
        data.qpos[at] = positions
        for slave, (master, curve) in driven.items():
            away = 0.0 if master < 0 else data.qpos[model.jnt_qposadr[master]] - model.qpos0[model.jnt_qposadr[master]]
            start = model.jnt_qposadr[slave]
            data.qpos[start] = model.qpos0[start] + sum(c * away**power for power, c in enumerate(curve))
        mujoco.mj_kinematics(model, data)
        poses = np.tile(np.eye(4), (model.nbody, 1, 1))
        poses[:, :3, :3], poses[:, :3, 3] = data.xmat.reshape(-1, 3, 3), data.xpos
        return poses

    positions = _positions([*ranges.values()], samples, seed)
    positions[0] = model.qpos0[at]
    poses = np.stack([place(row) for row in positions[::-1]])[::-1]  # at rest last: there, joints' axes are read
    links = [model.body(i).name or f"body_{i}" for i in range(model.nbody)]
    parents = {i: int(p) for i, p in enumerate(model.body_parentid) if i}
    sampled = {int(model.jnt_bodyid[j]) for j in (*ranges, *driven)}
    held = {int(body) for body in model.jnt_bodyid} - sampled
    carrier = _last(parents, {link: link for link in held}, model.nbody)
    joints, carried = _mjcf_joints(model, data, ranges, driven, parents)
    near = _pairs(parents)
    return Motion(tuple(links), poses, joints, positions, near, tuple(said), frozenset(), carrier, carried, place)


def _mjcf_ranges(model: Any, driven: Collection[int], said: list[str]) -> dict[int, _Range]:
    """What is sampled of each joint; those that are driven, or stay at rest, have nothing."""
    ranges: dict[int, _Range] = {}
    for j in range(model.njnt):
        if j not in driven:
            kind = {_SLIDE: "slides without limits", _HINGE: "turns"}.get(int(model.jnt_type[j]))
            limits = tuple(model.jnt_range[j].tolist()) if kind and model.jnt_limited[j] else None
            found = _range(kind or "is free or a ball", model.joint(j).name or f"number {j}", limits, said)
            ranges |= {j: found} if found is not None else {}
    return ranges


def _mjcf_joints(
    model: Any, data: Any, ranges: Mapping[int, _Range], driven: Mapping[int, Any], parents: Mapping[int, int]
) -> tuple[tuple[Joint, ...], tuple[int, ...]]:
    """The joints that move, and for each body that which carries it; of several in a body, one carries the next."""
    moving = [*ranges, *(j for j, (master, _) in driven.items() if master in ranges)]
    number = {j: i for i, j in enumerate(moving)}
    carried = _last(parents, {int(model.jnt_bodyid[j]): number[j] for j in sorted(moving)}, model.nbody)
    made = []
    for j in moving:
        body = int(model.jnt_bodyid[j])
        before = [number[i] for i in range(int(model.body_jntadr[body]), j) if i in number]
        parent = before[-1] if before else carried[parents[body]]
        where = data.xanchor[j].copy(), data.xaxis[j].copy()
        rest = float(model.qpos0[model.jnt_qposadr[j]])
        if j in ranges:
            name, slides, lower, upper = ranges[j]
            made.append(Joint(name, slides, lower, upper, rest, *where, parent))
        else:
            (master, curve), slides = driven[j], int(model.jnt_type[j]) == _SLIDE
            made.append(Joint(f"{j}", slides, rest, rest, rest, *where, parent, number[master], tuple(curve[1:])))
    return tuple(made), carried


def _driven(model: Any, mujoco: Any) -> dict[int, tuple[int, list[float]]]:
    """Joints that a joint equality sets, with the joint that drives each (-1: none) and the polynomial."""
    is_joint = np.flatnonzero(model.eq_type == int(mujoco.mjtEq.mjEQ_JOINT))
    return {
        int(model.eq_obj1id[e]): (int(model.eq_obj2id[e]), model.eq_data[e, :5].tolist())
        for e in is_joint
        if model.eq_active0[e]
    }
