"""Where the links of a robot are: at rest, and at joint positions spread over what the joints allow.

Where links rest, and what joints do, is read by yourdfpy for URDF and by MuJoCo for MJCF. Positions are a Sobol
sequence (Sobol', "On the distribution of points in a cube", 1967), scrambled by the seed.
"""

from __future__ import annotations

import logging
import math
from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from itertools import combinations
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.polynomial import Polynomial
from trimesh.transformations import quaternion_matrix

from rlacd.clear.bodies import PRIMITIVES, Primitive
from rlacd.errors import import_extra
from rlacd.solid.arrays import FloatArray, dots

SAMPLES = 500
"""Joint positions that are looked at, beside that at rest."""

_KINDS = {2: ("slides without limits", True), 3: ("turns", False)}
"""What joints do of which ``mjtJoint``, and whether they slide; the others are free or balls."""

_FOR = "checking that links stay clear of each other"

Limits = tuple[float, float]
"""Of a joint, in radians or the unit of length."""

_Said = dict[tuple[str, str], list[str]]
"""The names of joints, by what is unusual of them and what that leads to."""


@dataclass(frozen=True)
class Joint:
    """A joint that turns or slides; vectors are in the frame that all links share, with all joints at rest."""

    name: str
    slides: bool
    lower: float
    upper: float
    rest: float
    """In radians or the unit of length."""
    anchor: FloatArray
    axis: FloatArray
    """``[3]``, a point on its axis, and the axis' direction."""
    parent: int = -1
    """The joint that carries it; -1 if none does."""
    leader: int = -1
    """The joint that drives it; -1 if none does."""
    curve: tuple[float, ...] = ()
    """How far it is then from rest: a polynomial in how far its leader is, from the linear term up."""


class Solids(NamedTuple):
    """What of a link collides."""

    primitives: Sequence[Primitive] = ()
    meshes: int = 0
    others: int = 0
    """Shapes that cannot be compared, such as height fields."""


_Shape = tuple[str, Sequence[float], FloatArray]
"""Its kind, a primitive's sizes, and its pose in the frame of its link."""


def _solids(shapes: Iterable[_Shape]) -> Solids:
    primitives, others = list[Primitive](), list[str]()
    for kind, sizes, place in shapes:
        if (own := Primitive.read(kind, sizes, place)) is None:
            others.append(kind)
        else:
            primitives.append(own)
    meshes = others.count("mesh")
    return Solids(primitives, meshes, len(others) - meshes)


@dataclass(frozen=True)
class Motion:
    """Where links are."""

    links: tuple[str, ...]  # those that were asked for, and behind them all others that have primitives
    poses: FloatArray  # [S, L, 4, 4], from each link's frame to one that all share; the first sample is at rest
    joints: tuple[Joint, ...] = ()  # those that move: first those that are sampled, then those that others drive
    positions: FloatArray = field(default_factory=lambda: np.zeros((1, 0)))  # [S, J], of the sampled joints
    # Links that one joint connects, or several across links without collision geometry, the lower number first; the
    # world is no link. Joints looked at only at rest do not count, since elsewhere links may be far from each other.
    adjacent: frozenset[tuple[int, int]] = frozenset()
    warnings: tuple[str, ...] = ()  # what a joint's range was taken to be, where the file does not say
    fixed: frozenset[int] = frozenset()  # links that never move: of two of them, hulls may touch
    carrier: tuple[int, ...] = ()  # the last link below, or itself, whose joint was looked at only at rest; -1: none
    carried: tuple[int, ...] = ()  # the joint that carries it; -1 if none does
    solids: tuple[Solids, ...] = ()  # of each link; empty where that is not known

    @property
    def sampled(self) -> tuple[Joint, ...]:
        """The joints that others do not drive."""
        return self.joints[: self.positions.shape[1]]

    def at(self, positions: Sequence[float]) -> Motion:
        """The same links, only where other positions of the sampled joints put them."""
        row = np.array([positions], dtype=np.float64)
        return replace(self, positions=row, poses=_placed(self.poses[0], self.joints, self.carried, row))

    def words(self, sample: int, links: tuple[int, int]) -> str:
        """The joint position of a sample, as text: of the joints that move one of two links to the other."""
        between = sorted({self._leading(number) for number in self._below(links[0]) ^ self._below(links[1])})
        if sample == 0 or not between:
            return "at rest"
        moved = ((self.joints[number].name, self.positions[sample, number]) for number in between)
        return "at " + ", ".join(f"{name} = {value:.4g}" for name, value in moved)

    def _below(self, link: int) -> set[int]:
        """All joints below a link, which move it."""
        found, number = set[int](), self.carried[link]
        while number >= 0:
            found.add(number)
            number = self.joints[number].parent
        return found

    def _leading(self, number: int) -> int:
        """The sampled joint that a joint follows, or is."""
        leader = self.joints[number].leader
        return number if leader < 0 else self._leading(leader)


def at_rest(
    links: Sequence[str],
    fixed: Collection[str] = (),
    poses: Sequence[FloatArray] | None = None,
    adjacent: Collection[tuple[int, int]] = (),
) -> Motion:
    """Links that are looked at where they are, by default in one frame; those that are fixed may touch each other."""
    where = np.tile(np.eye(4), (1, len(links), 1, 1)) if poses is None else np.stack(poses)[None]
    places = frozenset(i for i, name in enumerate(links) if name in fixed)
    carrier, carried = tuple(range(len(links))), (-1,) * len(links)
    near = frozenset(adjacent)
    return Motion(tuple(links), where, adjacent=near, fixed=places, carrier=carrier, carried=carried)


class _Read(NamedTuple):
    """A joint of a file; what has no limits and no leader (-1: a constant) stays at rest."""

    name: str
    slides: bool
    link: int
    limits: Limits | None = None
    rest: float = 0.0
    leader: int | None = None
    curve: tuple[float, ...] = ()


def urdf_motion(path: Path, samples: int = SAMPLES, seed: int = 0, links: Sequence[str] | None = None) -> Motion:
    """Where the links of a URDF are; or some of them, in the given order.

    Raises
    ------
    MissingExtraError
        The extra ``clear`` is not installed.
    """
    return _motion(_Urdf(path), samples, seed, links)


def mjcf_motion(path: Path, samples: int = SAMPLES, seed: int = 0, links: Sequence[str] | None = None) -> Motion:
    """Where the bodies of an MJCF model are; joints that others drive by a joint equality follow them.

    Raises
    ------
    MissingExtraError
        The extra ``clear`` is not installed.
    ValueError
        MuJoCo does not read the model.
    """
    return _motion(_Mjcf(path), samples, seed, links)


def _motion(file: _Urdf | _Mjcf, samples: int, seed: int, links: Sequence[str] | None) -> Motion:
    asked = file.links if links is None else links
    if lost := [name for name in asked if name not in file.links]:
        raise ValueError(f"it has no link {lost[0]}")
    chosen = [file.links.index(name) for name in asked]
    chosen += [i for i, own in file.solids.items() if own.primitives and i not in chosen and i != file.world]
    sampled = {j: joint for j, joint in file.joints.items() if joint.limits is not None}
    moving = {j: file.joints[j] for j in _led(file.joints, sampled)}
    number = {j: i for i, j in enumerate(moving)}
    positions = _positions([*sampled.values()], samples, seed)
    rest = file.rest()[chosen]
    last = {moving[j].link: number[j] for j in sorted(moving)}  # of several in a link, each carries the next
    joints = []
    for j, joint in moving.items():
        before = [number[i] for i in sorted(moving) if i < j and moving[i].link == joint.link]
        parent = before[-1] if before else _last(file.parents, last, [file.parents.get(joint.link)])[0]
        lower, upper = joint.limits or (joint.rest, joint.rest)
        driven = -1 if joint.leader is None else number[joint.leader], joint.curve
        joints.append(Joint(joint.name, joint.slides, lower, upper, joint.rest, *file.axis(j), parent, *driven))
    held = {joint.link: joint.link for j, joint in file.joints.items() if j not in moving and joint.leader != -1}
    carried = _last(file.parents, last, chosen)
    return Motion(
        tuple(file.links[i] for i in chosen),
        np.concatenate([rest[None], _placed(rest, joints, carried, positions[1:])]),
        tuple(joints),
        positions,
        _adjacent(file, [link for link in file.parents if link not in held], chosen),
        _told(file.said),
        carrier=_last(file.parents, held, chosen),
        carried=carried,
        solids=tuple(file.solids.get(i, Solids()) for i in chosen),
    )


def _placed(rest: FloatArray, joints: Sequence[Joint], carried: Sequence[int], positions: FloatArray) -> FloatArray:
    """Poses [S, L, 4, 4] at positions [S, J] of links that rest at poses [L, 4, 4], carried by joints or by none."""
    away, moves = list[FloatArray](), dict[int, FloatArray]()
    for number, joint in enumerate(joints):
        leads = number < positions.shape[1]
        ahead = positions[:, number] - joint.rest if leads else away[joint.leader]
        away.append(ahead if leads else sum(c * ahead ** (i + 1) for i, c in enumerate(joint.curve)) + 0 * ahead)

    def move(number: int) -> FloatArray:
        if number < 0:
            return np.tile(np.eye(4), (len(positions), 1, 1))
        if number not in moves:
            moves[number] = _after(move(joints[number].parent), _step(joints[number], away[number]))
        return moves[number]

    poses = np.empty((len(positions), *rest.shape))
    for link, by in enumerate(carried):
        poses[:, link] = _after(move(by), rest[link])
    return poses


def _step(joint: Joint, away: FloatArray) -> FloatArray:
    """What a joint does [S, 4, 4], so far from rest [S]: it slides or, by Rodrigues' formula, turns."""
    moves = np.tile(np.eye(4), (len(away), 1, 1))
    if joint.slides:
        moves[:, :3, 3] = away[:, None] * joint.axis
        return moves
    x, y, z = joint.axis.tolist()
    across = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    sines, rests = np.sin(away)[:, None, None], 2 * np.sin(away / 2)[:, None, None] ** 2
    moves[:, :3, :3] += sines * across + rests * (np.outer(joint.axis, joint.axis) - np.eye(3))
    moves[:, :3, 3] = joint.anchor - dots(moves[:, :3, :3], joint.anchor)
    return moves


def _after(first: FloatArray, then: FloatArray) -> FloatArray:
    """Products of poses [S, 4, 4] and [S, 4, 4] or [4, 4]."""
    whole = first.copy()
    whole[:, :3, :3] = dots(first[:, :3, None, :3], np.swapaxes(then[..., :3, :3], -1, -2)[..., None, :, :])
    whole[:, :3, 3] += dots(first[:, :3, :3], then[..., None, :3, 3])
    return whole


def _positions(joints: Sequence[_Read], samples: int, seed: int) -> FloatArray:
    """Rest, then so many samples [1 + samples, J]."""
    rest = np.array([[joint.rest for joint in joints]], dtype=np.float64)
    if not joints or samples <= 0:
        return rest
    qmc = import_extra("scipy.stats.qmc", _FOR, "clear")
    sobol = qmc.Sobol(len(joints), scramble=True, rng=np.random.default_rng(seed))
    spread = sobol.random_base2(math.ceil(math.log2(samples)))[:samples]
    lower, upper = np.array([joint.limits for joint in joints]).T
    return np.concatenate([rest, lower + spread * (upper - lower)])


def _led(joints: Mapping[int, _Read], first: Collection[int]) -> list[int]:
    """The first joints and those that follow them, each behind its leader."""
    led = [*first]
    for leader in led:
        led += [j for j, joint in joints.items() if joint.leader == leader]
    return led


def _limits(kind: str, name: str, given: Limits | None, said: _Said) -> Limits | None:
    """Between what a joint is sampled; None if it stays at rest, which `said` tells."""
    if given is not None and given[0] < given[1] and all(map(math.isfinite, given)):
        return given
    if kind == "turns":
        if given is None or given[0] >= given[1]:
            said.setdefault(("has no limits", "a whole turn was looked at"), []).append(name)
        return -math.pi, math.pi
    said.setdefault((kind, "it was looked at only at rest"), []).append(name)
    return None


def _told(said: _Said) -> tuple[str, ...]:
    """A sentence for all joints of a kind."""
    sentences = []
    for (kind, what), names in said.items():
        others = f" (as for {len(names) - 1} more)" if len(names) > 1 else ""
        sentences.append(f"the joint {names[0]} {kind}, so {what}{others}")
    return tuple(sentences)


def _last(parents: Mapping[int, int], what: Mapping[int, int], links: Sequence[int | None]) -> tuple[int, ...]:
    """For each link, what the last link on the way down to it has, or itself; -1 if none has anything."""

    def last(link: int | None) -> int:
        while link is not None and link not in what:
            link = parents.get(link)
        return -1 if link is None else what[link]

    return tuple(map(last, links))


def _adjacent(file: _Urdf | _Mjcf, carried: Sequence[int], chosen: Sequence[int]) -> frozenset[tuple[int, int]]:
    """Places of chosen links that one joint connects, or several across links without collision geometry."""
    import networkx  # only robots need it

    edges = [(link, file.parents[link]) for link in carried if file.parents[link] != file.world]
    graph, new = networkx.Graph(edges), {link: place for place, link in enumerate(chosen)}
    empty = [link for link in graph if link not in file.solids and link not in new]
    between = networkx.connected_components(graph.subgraph(empty))
    joined = [*map(set, graph.edges), *({near for link in part for near in graph[link]} for part in between)]
    places = (sorted(new[link] for link in links if link in new) for links in joined)
    return frozenset(pair for near in places for pair in combinations(near, 2))


class _Urdf:
    """A URDF as yourdfpy reads it."""

    def __init__(self, path: Path) -> None:
        yourdfpy = import_extra("yourdfpy", _FOR, "clear")
        with _quiet("yourdfpy"):
            self._robot = yourdfpy.URDF.load(str(path), load_meshes=False, build_collision_scene_graph=False)
        self._joints = self._robot.robot.joints
        self.links, self.said = [link.name for link in self._robot.robot.links], _Said()
        self.parents = {self.links.index(joint.child): self.links.index(joint.parent) for joint in self._joints}
        actuated = {joint.name for joint in self._robot.actuated_joints}
        names = [joint.name for joint in self._joints]
        followers = {joint.name: joint.mimic for joint in self._joints if joint.mimic is not None}
        for mimic in len(followers) * [*followers.values()]:  # yourdfpy lets a joint follow one that moves by itself
            if (ahead := followers.get(mimic.joint)) is not None:
                mimic.joint, mimic.offset = ahead.joint, mimic.offset + mimic.multiplier * ahead.offset
                mimic.multiplier *= ahead.multiplier
        self.joints = {}
        for number, joint in enumerate(self._joints):
            link, mimic = self.links.index(joint.child), joint.mimic
            read = _Read(joint.name, joint.type == "prismatic", link)
            if joint.name in actuated:
                self.joints[number] = read._replace(limits=_limits(*_urdf_limits(joint), self.said))
            elif mimic is not None and joint.type != "fixed" and mimic.joint in names:
                times = 1.0 if mimic.multiplier is None else float(mimic.multiplier)
                self.joints[number] = read._replace(leader=names.index(mimic.joint), curve=(times,))
        self._robot.update_cfg(dict.fromkeys(actuated, 0.0))
        self.world = self.links.index("world") if "world" in self.links else None
        links = enumerate(self._robot.robot.links)
        self.solids = {i: _solids(map(_urdf_shape, link.collisions)) for i, link in links if link.collisions}

    def rest(self) -> FloatArray:
        return np.stack([self._robot.get_transform(name) for name in self.links])

    def axis(self, joint: int) -> tuple[FloatArray, FloatArray]:
        said, pose = self._joints[joint].axis, self._robot.get_transform(self._joints[joint].child)
        axis = np.array([1.0, 0.0, 0.0] if said is None else said, dtype=np.float64)
        return pose[:3, 3], (pose[:3, :3] * axis / np.linalg.norm(axis)).sum(axis=1)


def _urdf_shape(collision: Any) -> _Shape:
    geometry, place = collision.geometry, np.eye(4) if collision.origin is None else collision.origin
    if (box := geometry.box) is not None:
        return "box", box.size / 2, place
    if (cylinder := geometry.cylinder) is not None:
        return "cylinder", [cylinder.radius, cylinder.length / 2], place
    return ("mesh", (), place) if geometry.sphere is None else ("sphere", [geometry.sphere.radius], place)


def _urdf_limits(joint: Any) -> tuple[str, str, Limits | None]:
    if joint.type == "continuous":
        return "turns", joint.name, (-math.inf, math.inf)
    limit = joint.limit
    known = limit is not None and limit.lower is not None and limit.upper is not None
    kinds = {"revolute": "turns", "prismatic": "slides without limits"}
    limits = (float(limit.lower), float(limit.upper)) if known and joint.type in kinds else None
    return kinds.get(joint.type, f"is {joint.type}"), joint.name, limits


class _Mjcf:
    """An MJCF model as MuJoCo reads it."""

    def __init__(self, path: Path) -> None:
        mujoco = import_extra("mujoco", _FOR, "clear")
        self._model = model = mujoco.MjModel.from_xml_path(str(path))
        self._data = mujoco.MjData(model)
        self.links, self.said = [model.body(i).name or f"body_{i}" for i in range(model.nbody)], _Said()
        self.parents = {i: int(parent) for i, parent in enumerate(model.body_parentid) if i}
        shapes = _mjcf_shapes(mujoco.mjtGeom, model)
        self.world, self.solids = 0, {body: _solids(own) for body, own in shapes.items()}
        joint_equality = int(mujoco.mjtEq.mjEQ_JOINT)
        self._driven = {
            int(model.eq_obj1id[e]): (int(model.eq_obj2id[e]), model.eq_data[e, :5].tolist())
            for e in range(model.neq)
            if model.eq_type[e] == joint_equality and model.eq_active0[e]
        }
        self.joints = {j: self._read(j) for j in range(model.njnt)}
        leaders = [j for j, joint in self.joints.items() if joint.leader is None or joint.leader < 0]
        away = {-1: 0.0}  # at rest
        for j in _led(self.joints, leaders):
            leader, curve = self._driven.get(j, (-1, [0.0]))
            ahead = Polynomial([away[leader], 1.0])
            away[j], *linear = Polynomial(curve)(ahead).coef.tolist()
            self.joints[j] = self.joints[j]._replace(curve=tuple(linear))
            self._data.qpos[model.jnt_qposadr[j]] += away[j]
        mujoco.mj_kinematics(model, self._data)

    def _read(self, j: int) -> _Read:
        model = self._model
        kind, slides = _KINDS.get(int(model.jnt_type[j]), ("is free or a ball", None))
        name, rest = model.joint(j).name or f"number {j}", float(model.qpos0[model.jnt_qposadr[j]])
        read = _Read(name, bool(slides), int(model.jnt_bodyid[j]), rest=rest)
        if j in self._driven:
            return read._replace(leader=self._driven[j][0])
        given = tuple(model.jnt_range[j].tolist()) if model.jnt_limited[j] and slides is not None else None
        roots = {int(model.body_rootid[body]) for body in self.solids if body}
        if slides is None and roots == {read.link}:
            return read  # all that collides hangs on it, so where it is makes no difference
        return read._replace(limits=_limits(kind, name, given, self.said))

    def rest(self) -> FloatArray:
        model, data = self._model, self._data
        poses = np.tile(np.eye(4), (model.nbody, 1, 1))
        poses[:, :3, :3], poses[:, :3, 3] = data.xmat.reshape(-1, 3, 3), data.xpos
        return poses

    def axis(self, joint: int) -> tuple[FloatArray, FloatArray]:
        return self._data.xanchor[joint].copy(), self._data.xaxis[joint].copy()


def _mjcf_shapes(kinds: Any, model: Any) -> dict[int, list[_Shape]]:
    """What of each body collides, by its contact properties or as one of a pair."""
    names = {int(getattr(kinds, f"mjGEOM_{name.upper()}")): name for name in (*PRIMITIVES.keys() - {"cone"}, "mesh")}
    collides = (model.geom_contype | model.geom_conaffinity) != 0
    collides[[*model.pair_geom1, *model.pair_geom2]] = True
    found: dict[int, list[_Shape]] = {}
    for g in np.flatnonzero(collides).tolist():
        place = np.asarray(quaternion_matrix(model.geom_quat[g]))
        place[:3, 3] = model.geom_pos[g]
        shape = names.get(int(model.geom_type[g]), "other"), model.geom_size[g], place
        found.setdefault(int(model.geom_bodyid[g]), []).append(shape)
    return found


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
