"""Links that were clear of each other stay clear: small robots in MuJoCo, and where that cannot be, what is said."""

from __future__ import annotations

import sys
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
import trimesh
from lxml import etree

import rlacd
from rlacd.clear import (
    Body,
    Cleared,
    Offence,
    Surface,
    Touching,
    at_rest,
    check,
    kept_clear,
    mjcf_motion,
    touching,
    urdf_motion,
    warnings_of,
)
from rlacd.clear.bodies import Primitive, overlapping, placed_boxes
from rlacd.errors import OptionError
from tests.moving import ALL, Joint, Robot, block, drawer, fork_and_lug

mujoco = pytest.importorskip("mujoco", reason="extra sim")
pytest.importorskip("coal", reason="extra clear")
pytest.importorskip("yourdfpy", reason="extra clear")


def positions_with_contacts(urdf: Path) -> list[float]:
    """The positions of its joints, all together from one limit to the other, at which MuJoCo finds contacts."""
    model = mujoco.MjModel.from_xml_path(str(urdf))
    data, found = mujoco.MjData(model), []
    for share in np.linspace(0, 1, 41).tolist():
        data.qpos[:] = (1 - share) * model.jnt_range[:, 0] + share * model.jnt_range[:, 1]
        mujoco.mj_forward(model, data)
        found += [share] if any(contact.dist < 0 for contact in data.contact) else []
    return found


@pytest.mark.slow
@pytest.mark.parametrize("make", ALL)
@pytest.mark.promise("links-clear")
def test_links_with_play_between_them_do_not_touch_as_hulls(make: Callable[[], Robot], tmp_path: Path) -> None:
    robot = make()
    done = rlacd.rewrite_robot(robot.write(tmp_path), tmp_path / "out.urdf", quality="fast", threads=1)
    touches = make is not drawer  # which is made of boards, so its hulls are exact
    assert any(pair.kept_clear for pair in done.pairs) == touches, "as tight as the threshold, hulls would touch"
    assert [pair for pair in done.pairs if pair.share] == []
    assert done.samples == 501
    assert positions_with_contacts(done.path) == []
    assert not [warning for warning in done.warnings if "touch" in warning]


@pytest.mark.slow
@pytest.mark.promise("links-clear")
def test_links_too_close_for_any_hulls_are_named_with_depth_and_joint_position(tmp_path: Path) -> None:
    robot, options = fork_and_lug(play=1e-4).write(tmp_path), {"quality": "fast", "threads": 1, "samples": 50}
    done = rlacd.rewrite_robot(robot, tmp_path / "out.urdf", threshold_abs=0.02, max_hulls=4, **options)
    (pair,) = done.pairs
    assert (pair.meshes, pair.adjacent, pair.kept_clear) == (0, True, False)
    assert pair.new_depth > 1e-4
    assert done.touch_within is not None
    assert 1e-4 <= done.touch_within <= 0.05, "hulls touch where links are 0.1 mm apart"
    (said,) = [warning for warning in done.warnings if "touch though the links do not" in warning]
    assert said.startswith(f"Hulls of fork and lug touch though the links do not, up to {pair.new_depth:.4g} m ")
    assert "lug_joint = " in said or "at rest" in said


@pytest.mark.slow
@pytest.mark.promise("links-clear")
def test_links_that_would_take_too_many_hulls_keep_theirs_and_are_told(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    robot, found = fork_and_lug().write(tmp_path), []
    for growth, spare in ((3, 16), (1, 0)):
        monkeypatch.setattr(rlacd.clear.mend, "MOST_GROWTH", growth)
        monkeypatch.setattr(rlacd.clear.mend, "SPARE", spare)
        done = rlacd.rewrite_robot(robot, tmp_path / "out.urdf", quality="fast", threads=1, samples=50)
        is_told = [warning.endswith("to be clear of each other takes too many hulls.") for warning in done.warnings]
        found.append(([len(link.hulls) for link in done.links], is_told))
    ((fork, lug), free), (kept, told) = found
    assert (free, told) == ([], [True])
    assert kept[0] == fork
    assert kept[1] < lug <= max(3 * kept[1], kept[1] + 16), "the lug alone is mended"


def test_a_pair_that_mending_does_not_help_is_left_once_both_have_made_way() -> None:
    """Two frames one in the other, whose hulls no decomposition changes."""
    boards = [block((-2, -2, 0), (2, -1.9, 1)), block((-2, 1.9, 0), (2, 2, 1))]
    frame = trimesh.util.concatenate(boards)
    surface, hull = (Surface(mesh.vertices, mesh.faces) for mesh in (frame, frame.convex_hull))
    inner = Surface(block((-1, -1, 0), (1, 1, 1)).vertices, block((-1, -1, 0), (1, 1, 1)).faces)
    bodies = [Body("frame", surface, [hull]), Body("inner", inner, [inner])]
    tried = []

    def redo(number: int, *_: object) -> list[Surface]:
        tried.append(number)
        return bodies[number].hulls

    done = kept_clear(bodies, at_rest(["frame", "inner"]), redo)
    assert 1 <= len(tried) <= 2
    assert done.touching[0, 1].offences
    assert (done.mended, done.given_up) == ((), frozenset())


def test_links_whose_own_meshes_overlap_are_told_and_left_as_they_are(tmp_path: Path) -> None:
    """Of three links in a row, the outer two cross in the input wherever the joints are."""
    links = {
        "base": block((0, 0, 0), (1, 1, 1)),
        "middle": block((3, 0, 0), (4, 1, 1)),
        "tip": block((0.5, 0.2, 0.2), (1.5, 0.8, 0.8)),
    }
    joints = tuple(
        Joint("revolute", parent, child, (1, 0, 0), (0, 0.5, 0.5), (-0.1, 0.1))
        for parent, child in (("base", "middle"), ("middle", "tip"))
    )
    path = Robot("row", links, joints).write(tmp_path)
    done = rlacd.rewrite_robot(path, tmp_path / "out.urdf", threads=1, samples=20, srdf=tmp_path / "row.srdf")
    assert done.warnings == ["base and tip touch in the input itself wherever the joints are."]
    still = rlacd.rewrite_robot(path, tmp_path / "still.urdf", threads=1, samples=0)
    assert still.warnings == ["base and tip touch in the input itself."]
    assert {(pair.first, pair.second): pair.kind for pair in done.pairs} == {
        ("base", "middle"): "adjacent",
        ("base", "tip"): "always",
        ("middle", "tip"): "adjacent",
    }
    reasons = [
        element.get("reason") for element in etree.parse(str(tmp_path / "row.srdf")).iterfind("disable_collisions")
    ]
    assert reasons == ["Adjacent", "Default", "Adjacent"]
    assert done.as_dict()["pairs"][1]["contact"] == "always"


def test_all_pairs_with_new_contacts_are_named() -> None:
    """The deepest in a sentence each, the rest in one; also those that collide themselves elsewhere."""
    letters = [*"abcdefgh"]
    bodies = [Body(name, Surface(np.empty((0, 3)), np.empty((0, 3), int))) for name in letters]

    def touching(depth: float, *meshes: bool) -> Touching:
        return Touching(np.array([True, True]), np.array(meshes), (Offence(0, np.eye(4), depth),))

    found = {(0, i): touching(i, False, False) for i in range(1, 8)}
    found |= {(1, 2): touching(0.5, True, False), (1, 3): touching(0.25, True, False)}
    found[2, 3] = Touching(np.array([True, True]), np.array([True, True]), ())
    said = warnings_of(Cleared(bodies, found), at_rest(letters), str)
    assert said == [
        *(
            f"Hulls of a and {letters[i]} touch though the links do not, up to {i} deep at rest."
            for i in (7, 6, 5, 4, 3)
        ),
        "Hulls of other links touch too, up to 2 deep: a with b, c; b with c, d.",
        "c and d touch in the input itself wherever the joints are.",
    ]


ARM = """<mujoco><asset><mesh name="box" file="box.obj"/></asset><worldbody>
  <body name="a"><joint name="j" type="hinge" axis="0 0 1"/><geom type="mesh" mesh="box" mass="1"/>
    <body name="b" pos="3 0 0"><joint name="k" type="hinge" axis="0 0 1" range="-30 30" limited="true"/>
      <geom type="mesh" mesh="box" mass="1"/>
      <body name="c" pos="3 0 0"><geom type="mesh" mesh="box" mass="1"/></body></body></body>
  <body name="cup" pos="0 0 1.01"><freejoint/><geom type="mesh" mesh="box" mass="1"/></body>
</worldbody><equality><joint joint1="k" joint2="j" polycoef="0.1 0.5 0 0 0"/></equality></mujoco>
"""


@pytest.fixture
def arm(tmp_path: Path) -> Path:
    trimesh.creation.box().export(tmp_path / "box.obj")
    (tmp_path / "arm.xml").write_text(ARM)
    return tmp_path / "arm.xml"


def test_pairs_of_bodies_are_excluded_from_contacts_where_asked(arm: Path) -> None:
    done = rlacd.rewrite_robot(arm, arm.with_name("out.xml"), exclude="adjacent,never", samples=30, threads=1)
    kinds = {(pair.first, pair.second): pair.kind for pair in done.pairs}
    assert kinds[("a", "b")] == kinds[("b", "c")] == "adjacent"
    assert kinds[("a", "c")] == "never"
    assert kinds[("a", "cup")] == "sometimes", "a cup moves freely: what it does at rest says nothing"
    model = mujoco.MjModel.from_xml_path(str(done.path))
    assert model.nexclude == 3
    again = rlacd.rewrite_robot(done.path, arm.with_name("again.xml"), exclude=["never"], samples=30, threads=1)
    assert mujoco.MjModel.from_xml_path(str(again.path)).nexclude == 3, "what is excluded already stays so once"


SWEEP = """<mujoco><asset><mesh name="box" file="box.obj"/><hfield name="h" nrow="2" ncol="2" size="1 1 1 1"/></asset>
<worldbody><geom type="plane" size="1 1 1"/><body name="a"><freejoint/><geom type="mesh" mesh="box"/>
  <body name="b" pos="3 0 0"><joint axis="0 0 1" range="-100 100" limited="true"/>{of_b}
    <inertial pos="0 0 0" mass="1" diaginertia="1 1 1"/>
    <body name="c" pos="2 0 0"><joint axis="0 0 1" range="-170 170" limited="true"/><geom type="mesh" mesh="box"/>{of_c}
</body></body></body></worldbody></mujoco>"""
MESH, LONG = '<geom type="mesh" mesh="box"/>', '<geom type="{}" size="2.5 .1 .1" euler="0 {} 0" pos="-2.5 0 0"/>'


def in_contact(path: Path) -> int:
    """At how many of 400 positions of the sampled joints MuJoCo finds contacts."""
    model = mujoco.MjModel.from_xml_path(str(path))
    data, rng, free, found = mujoco.MjData(model), np.random.default_rng(0), model.jnt_type != 0, 0
    for _ in range(400):
        data.qpos[model.jnt_qposadr[free]] = rng.uniform(*model.jnt_range[free].T)
        mujoco.mj_forward(model, data)
        found += data.ncon > 0
    return found


@pytest.mark.parametrize(
    ("of_b", "of_c", "kind"),
    [
        (MESH, "", "never"),
        (MESH, LONG.format("box", 0), "sometimes"),
        (MESH, LONG.format("ellipsoid", 0), "sometimes"),
        (MESH, '<geom type="capsule" fromto="-5 0 0 0 0 0" size=".1"/>', "sometimes"),
        (MESH, '<geom type="cylinder" fromto="-5 0 0 0 0 0" size=".1"/>', "sometimes"),
        (MESH, LONG.format("box", 0).replace("<geom ", '<geom contype="0" conaffinity="0" '), "never"),
        (MESH, '<geom type="hfield" hfield="h"/>', "sometimes"),
        ("", "", "adjacent"),
        ('<geom type="box" size=".5 .5 .5"/>', "", "never"),
    ],
)
@pytest.mark.promise("links-clear")
def test_pairs_never_touch_only_if_everything_that_collides_was_compared(
    arm: Path, of_b: str, of_c: str, kind: str
) -> None:
    arm.write_text(SWEEP.format(of_b=of_b, of_c=of_c))
    done = rlacd.rewrite_robot(arm, arm.with_name("out.xml"), exclude="never", samples=200, threads=1)
    kinds = {(pair.first, pair.second): pair.kind for pair in done.pairs}
    assert kinds["a", "c"] == kind
    assert kinds.get(("b", "c"), "adjacent") == kinds.get(("a", "b"), "adjacent") == "adjacent"
    assert in_contact(done.path) == in_contact(arm)


def test_bodies_on_the_world_are_not_adjacent(arm: Path) -> None:
    door = """<body name="{}" pos="0 {} 0"><joint axis="0 0 1" range="-100 100" limited="true"/>
    <geom type="mesh" mesh="box" pos=".5 0 0"/></body>"""
    doors = door.format("left", 0) + door.format("right", 1.5)
    arm.write_text(f'<mujoco><asset><mesh name="box" file="box.obj"/></asset><worldbody>{doors}</worldbody></mujoco>')
    done = rlacd.rewrite_robot(arm, arm.with_name("out.xml"), exclude=["adjacent"], samples=50, threads=1)
    assert [pair.kind for pair in done.pairs] == ["sometimes"]
    assert in_contact(done.path) == in_contact(arm) > 0
    link = '<link name="{}"><collision><geometry><mesh filename="box.obj"/></geometry></collision></link>'
    hinge = """<joint name="{0}_" type="revolute"><parent link="{1}"/><child link="{0}"/><axis xyz="0 0 1"/>
    <origin xyz="0 {2} 0"/><limit lower="-1" upper="1" effort="1" velocity="1"/></joint>"""
    for root, adjacent in (("world", 0), ("frame", 1)):
        doors = "".join(link.format(name) + hinge.format(name, root, y) for name, y in (("left", 0), ("right", 1.5)))
        arm.with_suffix(".urdf").write_text(f'<robot name="r"><link name="{root}"/>{doors}</robot>')
        assert len(urdf_motion(arm.with_suffix(".urdf"), 0, 0, ["left", "right"]).adjacent) == adjacent


def test_hulls_are_kept_clear_of_primitives_too(tmp_path: Path) -> None:
    """A block that slides in a channel, which one hull would fill."""
    channel = trimesh.boolean.difference([block((-1, -1, 0), (1, 1, 1)), block((-2, -0.5, 0.5), (2, 0.5, 2))])
    channel.export(tmp_path / "channel.stl")
    mesh, box = '<mesh filename="channel.stl"/>', '<box size="0.4 0.9 0.4"/>'
    links = [
        f'<link name="{name}"><collision><geometry>{shape}</geometry></collision></link>'
        for name, shape in (("channel", mesh), ("block", box))
    ]
    slide = """<joint name="j" type="prismatic"><parent link="channel"/><child link="block"/><origin xyz="0 0 0.75"/>
    <limit lower="-0.5" upper="0.5" effort="1" velocity="1"/></joint>"""
    (tmp_path / "r.urdf").write_text(f'<robot name="r">{"".join(links)}{slide}</robot>')
    done = rlacd.rewrite_robot(tmp_path / "r.urdf", tmp_path / "out.urdf", threshold_abs=0.6, samples=20, threads=1)
    (pair,) = done.pairs
    assert (pair.first, pair.second, pair.share, pair.kept_clear) == ("channel", "block", 0, True)


def test_primitives_touch_where_mujoco_says(tmp_path: Path) -> None:
    """Of random kinds, sizes and places, and a mesh; not where they are within a thousandth of touching."""
    rng, kinds, wrong, close = np.random.default_rng(1), ["box", "sphere", "capsule", "cylinder", "ellipsoid"], [], 0
    mesh = trimesh.creation.box((0.6, 0.8, 1.0))
    hull = Surface(np.asarray(mesh.vertices), np.asarray(mesh.faces))
    for _ in range(200):
        spec, bodies = mujoco.MjSpec(), []
        spec.add_mesh(name="m", uservert=mesh.vertices.ravel(), userface=mesh.faces.ravel())
        for name in rng.choice([*kinds, "mesh"], 2):
            turn, sizes = rng.normal(size=4), rng.uniform(0.2, 0.6, 3)
            own = spec.worldbody.add_body().add_geom(
                type=getattr(mujoco.mjtGeom, f"mjGEOM_{name.upper()}"), pos=rng.uniform(-0.7, 0.7, 3), quat=turn
            )
            own.size, own.meshname = sizes, "m" if name == "mesh" else ""
            place = trimesh.transformations.quaternion_matrix(turn)
            place[:3, 3] = own.pos
            if name == "mesh":
                at = trimesh.transformations.transform_points(mesh.vertices, place)
                solid = Surface(at, hull.faces)
                bodies.append(Body("m", solid, [solid]))
            else:
                bodies.append(
                    Body(name, Surface(np.empty((0, 3)), np.empty((0, 3), int)), [], [Primitive(name, sizes, place)])
                )
        model = spec.compile()
        data = mujoco.MjData(model)
        mujoco.mj_forward(model, data)
        apart = mujoco.mj_geomDistance(model, data, 0, 1, 1.0, None)
        if abs(apart) > 1e-3:
            found = check(bodies, at_rest(["a", "b"]))
            touches = bool(found and found[0, 1].meshes.all())
            wrong += [(bodies[0].name, bodies[1].name, apart)] if touches != (apart < 0) else []
            close += touches
    assert wrong == []
    assert 50 < close < 150


@pytest.mark.parametrize(("height", "touches"), [(1.9, False), (-1.9, True)])
def test_a_cone_is_pointed_above(height: float, touches: bool) -> None:
    nothing, place = Surface(np.empty((0, 3)), np.empty((0, 3), int)), np.eye(4)
    place[:3, 3] = 0.9, 0, height
    shapes = Primitive("cone", (1.0, 2.0), np.eye(4)), Primitive("sphere", (0.01,), place)
    found = check([Body("", nothing, [], [shape]) for shape in shapes], at_rest(["a", "b"]))
    assert bool(found) == touches


@pytest.mark.parametrize("apart", [-0.001, 0.001])
def test_a_corner_may_have_any_number_of_neighbours(apart: float) -> None:
    """The tip of a cone of 400 sides, which coal refuses, and a block above it."""
    cone, roof = trimesh.creation.cone(1.0, 2.0, sections=400), block((-1, -1, 2 + apart), (1, 1, 3))
    shapes = [Surface(mesh.vertices, mesh.faces) for mesh in (cone, roof)]
    found = check([Body("", shape, [shape]) for shape in shapes], at_rest(["a", "b"]))
    assert bool(found) == (apart < 0)


def ball_and_wall(folder: Path, dent: float) -> Path:
    """An egg with a dent in its side that slides past a wall, 1 mm away at its nearest."""
    egg = trimesh.creation.icosphere(subdivisions=3)
    egg.apply_scale([0.15, 0.06, 0.05])
    if dent:
        hollow = trimesh.creation.icosphere(subdivisions=2, radius=0.04).apply_translation((0, -0.1 + dent, 0))
        egg = trimesh.boolean.difference([egg, hollow])
    wall = block((-1, 0.061, -0.5), (1, 0.1, 0.5))
    slide = Joint("prismatic", "wall", "egg", (1, 0, 0), (0, 0, 0), (-0.5, 0.5))
    return Robot("egg", {"wall": wall, "egg": egg}, (slide,)).write(folder)


@pytest.mark.promise("links-clear")
@pytest.mark.parametrize("is_entered", [True, False])
def test_an_opening_stays_open_only_if_another_link_moves_in_it(is_entered: bool, tmp_path: Path) -> None:
    """A flask without a thickness, whose mouth is small beside it, and a rod that turns in its mouth or beside it."""
    profile = np.array([(0, 0), (0.5, 0), (0.5, 1.4), (0.3, 1.7)])
    flask = trimesh.creation.revolve(profile, sections=16)
    x = 0.0 if is_entered else 0.6
    rod = block((x - 0.05, -0.05, 0.9), (x + 0.05, 0.05, 2.5))
    turn = Joint("revolute", "flask", "rod", (0, 0, 1), (x, 0, 0), (-1, 1))
    robot = Robot("mixer", {"flask": flask, "rod": rod}, (turn,)).write(tmp_path)
    done = rlacd.rewrite_robot(robot, tmp_path / "out.urdf", quality="fast", threads=1, samples=20)
    assert (len(done.links[0].hulls) > 4) == is_entered
    assert [pair.share for pair in done.pairs] == [0] * len(done.pairs)
    assert positions_with_contacts(done.path) == []


@pytest.mark.promise("links-clear")
def test_hulls_are_exact_where_simpler_ones_would_touch(tmp_path: Path) -> None:
    robot, options = ball_and_wall(tmp_path, 0.02), {"threads": 1, "samples": 50, "quality": "fast"}
    simple = rlacd.rewrite_robot(
        robot, tmp_path / "simple.urdf", threshold_abs=0.03, detail="simple", links={"wall": 0.01}, **options
    )
    done = rlacd.rewrite_robot(robot, tmp_path / "out.urdf", threshold_abs=0.03, **options)
    assert [len(link.hulls) for link in done.links] == [1, 1]
    (pair,) = done.pairs
    assert (pair.share, pair.kept_clear) == (0, True)
    (egg,) = done.links[1].hulls
    given = trimesh.load_mesh(tmp_path / "egg.stl")
    assert egg.volume == pytest.approx(given.convex_hull.volume, rel=1e-6)
    (rough,) = simple.links[1].hulls
    assert len(rough.vertices) < len(egg.vertices) / 2


@pytest.mark.promise("links-clear")
def test_convex_meshes_come_back_as_they_are(tmp_path: Path) -> None:
    """Also where nothing is near; unless an engine's limit binds."""
    robot = ball_and_wall(tmp_path, 0.0)
    given = trimesh.load_mesh(tmp_path / "egg.stl")
    done = rlacd.rewrite_robot(robot, tmp_path / "out.urdf", threads=1, samples=0)
    (egg,) = done.links[1].hulls
    corners = {tuple(corner) for corner in given.vertices.astype("<f4").tolist()}
    assert {tuple(corner) for corner in egg.vertices.astype("<f4").tolist()} == corners
    other = rlacd.rewrite_robot(robot, tmp_path / "other.urdf", threads=1, samples=0, max_vertices=64)
    assert len(other.links[1].hulls[0].vertices) <= 64


def test_joints_of_mjcf_are_sampled_in_their_limits_or_told(arm: Path) -> None:
    motion = mjcf_motion(arm, 100, seed=3)
    assert [joint.name for joint in motion.sampled] == ["j"]
    assert motion.positions.shape == (101, 1)
    assert np.abs(motion.positions).max() == pytest.approx(np.pi, rel=0.05)
    assert [warning.split(",")[0] for warning in motion.warnings] == [
        "the joint j has no limits",
        "the joint number 2 is free or a ball",
    ]
    a, b = (motion.links.index(name) for name in "ab")
    turns = np.arctan2(motion.poses[:, b, 1, 0], motion.poses[:, b, 0, 0])
    driven = 0.1 + 1.5 * motion.positions[:, 0]
    assert np.cos(turns - driven) == pytest.approx(1), "k follows j by the equality"
    assert motion.poses[0, a] == pytest.approx(np.eye(4))


def test_joints_without_limits_are_told_in_one_sentence_and_a_floating_base_in_none(arm: Path) -> None:
    geom = '<geom type="mesh" mesh="box"/>'
    wheels = "".join(f'<body pos="{x} 0 0"><joint name="w{x}" axis="0 1 0"/>{geom}</body>' for x in range(2, 6))
    asset = '<asset><mesh name="box" file="box.obj"/></asset>'
    base = f'<body name="base"><freejoint/>{geom}{wheels}</body>'
    for more in ("", f'<body name="ball" pos="0 0 9"><freejoint/>{geom}</body>'):
        arm.write_text(f"<mujoco>{asset}<worldbody>{base}{more}</worldbody></mujoco>")
        motion = mjcf_motion(arm, 10)
        turns = "the joint w2 has no limits, so a whole turn was looked at (as for 3 more)"
        apart = "the joint number 0 is free or a ball, so it was looked at only at rest (as for 1 more)"
        assert {*motion.warnings} == {turns, apart} if more else {turns}


def test_words_name_the_joints_between_two_links_and_those_that_drive_them(arm: Path) -> None:
    """The joint k follows j, and so moves b to a; the cup hangs by none of them."""
    motion = mjcf_motion(arm, 4, links=["a", "b", "c", "cup"])
    moved = f"at j = {motion.positions[2, 0]:.4g}"
    assert [motion.words(2, pair) for pair in [(0, 1), (0, 2), (2, 3), (1, 2)]] == [moved, moved, moved, "at rest"]
    assert motion.words(0, (0, 1)) == "at rest"


@pytest.mark.parametrize("order", [(0, 1), (1, 0)])
def test_joints_follow_in_a_chain_whatever_the_order_of_the_lines(arm: Path, order: tuple[int, int]) -> None:
    def body(number: int, inner: str) -> str:
        joint = f'<joint name="j{number}" axis="0 0 1" range="-1 1" limited="true"/>'
        return f'<body name="b{number}" pos="1 0 0">{joint}<geom type="mesh" mesh="box"/>{inner}</body>'

    lines = ['<joint joint1="j2" joint2="j1"/>', '<joint joint1="j3" joint2="j2"/>']
    arm.write_text(f"""<mujoco><compiler angle="radian"/><asset><mesh name="box" file="box.obj"/></asset><worldbody>
    {body(1, body(2, body(3, "")))}</worldbody><equality>{lines[order[0]]}{lines[order[1]]}</equality></mujoco>""")
    mimic = '<joint name="j{0}" type="revolute"><parent link="b{1}"/><child link="b{0}"/><axis xyz="0 0 1"/>{2}</joint>'
    said = '<limit lower="-1" upper="1" effort="1" velocity="1"/>', '<mimic joint="j1"/>', '<mimic joint="j2"/>'
    joints = [mimic.format(i + 1, i, "".join(text for text in {said[0], said[i]})) for i in range(3)]
    links = "".join(f'<link name="b{i}"/>' for i in range(4))
    arm.with_suffix(".urdf").write_text(f'<robot name="r">{links}{"".join(joints[:: 1 - 2 * order[0]])}</robot>')
    names = ["b1", "b2", "b3"]
    for motion in (mjcf_motion(arm, 30, 0, names), urdf_motion(arm.with_suffix(".urdf"), 30, 0, names)):
        turns = np.arctan2(motion.poses[:, :, 1, 0], motion.poses[:, :, 0, 0])
        assert np.cos(turns - motion.positions * [[1, 2, 3]]) == pytest.approx(1)
        assert {joint.name for joint in motion.joints} == {"j1", "j2", "j3"}
        assert len(set(motion.carrier)) == 1


def test_links_are_where_mujoco_puts_them(arm: Path) -> None:
    """Joints turn and slide, two in one body; some follow others by curves with constants."""
    arm.write_text("""<mujoco><compiler angle="radian"/><default><joint limited="true" range="-1 2"/></default>
    <asset><mesh name="box" file="box.obj"/></asset><worldbody>
    <body name="a" pos="1 2 3" euler="0.3 0.2 0.1"><joint name="turn" axis="1 2 3" pos="0.1 0.2 0.3" ref="0.2"/>
      <joint name="slide" type="slide" axis="1 1 0"/><geom type="mesh" mesh="box"/>
      <body name="b" pos="0 1 0"><joint name="first" axis="0 1 0"/><geom type="mesh" mesh="box"/>
        <body name="c" pos="1 0 0"><joint name="second" type="slide" axis="0 0 1" ref="0.1"/>
          <geom type="mesh" mesh="box"/></body></body></body></worldbody>
    <equality><joint joint1="second" joint2="first" polycoef="0.1 0.5 0.2 0 0.1"/>
      <joint joint1="first" joint2="turn" polycoef="0.3 -1 0.2 0.1 0"/></equality></mujoco>""")
    motion, model = mjcf_motion(arm, 20, 0, ["a", "b", "c"]), mujoco.MjModel.from_xml_path(str(arm))
    assert [joint.name for joint in motion.joints] == ["turn", "slide", "first", "second"]
    data = mujoco.MjData(model)
    for (turn, slide), poses in zip(motion.positions, motion.poses, strict=True):
        first = 0.3 - (turn - 0.2) + 0.2 * (turn - 0.2) ** 2 + 0.1 * (turn - 0.2) ** 3
        data.qpos[:] = turn, slide, first, 0.1 + 0.1 + 0.5 * first + 0.2 * first**2 + 0.1 * first**4
        mujoco.mj_kinematics(model, data)
        assert poses[:, :3, 3] == pytest.approx(data.xpos[1:])
        assert poses[:, :3, :3].reshape(-1, 9) == pytest.approx(data.xmat[1:])


MIMIC = """<robot name="r">
  <link name="a"/><link name="b"/><link name="c"/><link name="d"/><link name="e"/>
  <joint name="ab" type="revolute"><parent link="a"/><child link="b"/><axis xyz="0 0 1"/>
    <limit lower="-1" upper="2" effort="1" velocity="1"/></joint>
  <joint name="ac" type="revolute"><parent link="a"/><child link="c"/><axis xyz="0 0 1"/>
    <limit lower="-1" upper="2" effort="1" velocity="1"/><mimic joint="ab" multiplier="-2" offset="0.5"/></joint>
  <joint name="ad" type="planar"><parent link="a"/><child link="d"/><axis xyz="0 0 1"/></joint>
  <joint name="de" type="continuous"><parent link="d"/><child link="e"/><axis xyz="0 0 1"/></joint>
</robot>
"""


def test_mimic_planar_and_endless_joints_of_urdf(tmp_path: Path) -> None:
    (tmp_path / "r.urdf").write_text(MIMIC)
    motion = urdf_motion(tmp_path / "r.urdf", 64)
    assert [joint.name for joint in motion.sampled] == ["ab", "de"]
    assert motion.warnings == ("the joint ad is planar, so it was looked at only at rest",)
    low, high = motion.positions[1:].min(axis=0), motion.positions[1:].max(axis=0)
    assert low == pytest.approx([-1, -np.pi], rel=0.1)
    assert high == pytest.approx([2, np.pi], rel=0.1)
    turns = {name: np.arctan2(*motion.poses[:, i, [1, 0], 0].T) for i, name in enumerate(motion.links)}
    assert np.cos(turns["c"] - (0.5 - 2 * turns["b"])) == pytest.approx(1)
    assert motion.carrier[motion.links.index("e")] == motion.links.index("d")
    assert np.array_equal(urdf_motion(tmp_path / "r.urdf", 64).poses, motion.poses)
    assert urdf_motion(tmp_path / "r.urdf", 0).poses.shape[0] == 1
    assert urdf_motion(tmp_path / "r.urdf", 64, links=[]).poses.shape == (65, 0, 4, 4)


def test_the_broad_phase_finds_what_all_pairs_would() -> None:
    rng = np.random.default_rng(0)
    lower = rng.random((7, 40, 3)) * 5
    boxes = np.stack([lower, lower + rng.random((7, 40, 3))], axis=2)
    meets = (boxes[:, :, None, 0] <= boxes[:, None, :, 1]).all(axis=-1)
    expected = np.argwhere(np.triu(meets & meets.transpose(0, 2, 1), k=1))
    assert np.array_equal(overlapping(boxes), expected)
    turn = trimesh.transformations.random_rotation_matrix(rng.random(3))
    around = placed_boxes(boxes[0], np.tile(turn, (1, 40, 1, 1)))[0]
    corners = trimesh.bounds.corners(boxes[0, 0]) @ turn[:3, :3].T
    assert around[0] == pytest.approx(np.stack([corners.min(axis=0), corners.max(axis=0)]))


def test_what_one_distance_settles_is_what_asking_everywhere_finds(monkeypatch: pytest.MonkeyPatch) -> None:
    """A bar that turns and slides by a ring, through its hole and into it: within reach, inside, or apart."""
    random, asked = np.random.default_rng(5), list[float]()
    poses = np.stack([trimesh.transformations.random_rotation_matrix(random.random(3)) for _ in range(40)])
    poses = np.repeat(poses, 10, axis=0)
    poses[:, :3, 3] = np.repeat(random.uniform(-1, 1, (40, 3)), 10, axis=0) + random.normal(0, 0.02, (400, 3))
    ring, bar = trimesh.creation.annulus(0.5, 1.0, 0.3), trimesh.creation.box((0.2, 0.3, 0.6))

    def pair() -> tuple[Surface, Surface]:
        return Surface(ring.vertices, ring.faces), Surface(bar.vertices, bar.faces)

    alone = [bool(touching._surfaces_meet(*pair(), pose[None], 0.01)[0]) for pose in poses]
    measure = touching.distance
    monkeypatch.setattr(touching, "distance", lambda *given: asked.append(0.0) or measure(*given))
    together = touching._surfaces_meet(*pair(), poses, 0.01)
    assert together.tolist() == alone
    assert 50 < sum(alone) < 350
    assert len(asked) < 320, "distances settle neighbours"


def test_a_body_inside_another_touches_it_and_one_in_its_hollow_does_not() -> None:
    """Of a hollow body that was read as such; hulls of both fill the hollow."""
    outer = trimesh.creation.box((4, 4, 4))
    hollow = trimesh.boolean.difference([outer, trimesh.creation.box((2, 2, 2))])
    inner = trimesh.creation.box((1, 1, 1))

    def body(name: str, mesh: trimesh.Trimesh) -> Body:
        hull = mesh.convex_hull
        return Body(name, Surface(mesh.vertices, mesh.faces), [Surface(hull.vertices, hull.faces)])

    (found,) = check([body("a", outer), body("b", inner)], at_rest("ab")).values()
    assert (found.hulls.tolist(), found.meshes.tolist(), found.offences) == ([True], [True], ())
    (found,) = check([body("a", hollow), body("b", inner)], at_rest("ab")).values()
    assert (found.meshes.tolist(), len(found.offences)) == ([False], 1)


def test_without_the_extra_a_warning_says_that_nothing_was_checked(arm: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "coal", None)
    done = rlacd.rewrite_robot(arm, arm.with_name("out.xml"), samples=5, threads=1)
    assert (done.samples, done.pairs) == (0, [])
    assert any("were not checked against each other" in w and "rlacd[clear]" in w for w in done.warnings)


def test_what_is_not_for_a_kind_of_file_is_refused(arm: Path, tmp_path: Path) -> None:
    with pytest.raises(OptionError, match=r"srdf .* is for a URDF"):
        rlacd.rewrite_robot(arm, arm.with_name("out.xml"), srdf=tmp_path / "a.srdf")
    with pytest.raises(OptionError, match=r"exclude .* is for MJCF and USD"):
        rlacd.rewrite_robot(fork_and_lug().write(tmp_path), tmp_path / "out.urdf", exclude="always")
    with pytest.raises(OptionError, match="some of adjacent, always, never"):
        rlacd.rewrite_robot(arm, arm.with_name("out.xml"), exclude="sometimes")


@pytest.mark.promise("links-clear")
def test_nodes_of_a_scene_that_do_not_touch_do_not_as_hulls() -> None:
    scene, parts = trimesh.Scene(), fork_and_lug().links
    for name, mesh in parts.items():
        scene.add_geometry(mesh, node_name=name)
    done = rlacd.decompose(scene, per_node=True, threshold=0.06, quality="fast", threads=1)
    hulls = {name: [hull for hull in done if hull.metadata["node"] == name] for name in parts}
    assert {name for name, own in hulls.items() if own} == set(parts)
    bodies = [
        Body(name, Surface(mesh.vertices, mesh.faces), [Surface(h.vertices, h.faces) for h in hulls[name]])
        for name, mesh in parts.items()
    ]
    assert check(bodies, at_rest(list(parts))) == {}
    apart = [rlacd.decompose(mesh, threshold_abs=0.03 * 0.3, quality="fast", threads=1) for mesh in parts.values()]
    alone = [b.with_hulls([Surface(h.vertices, h.faces) for h in own]) for b, own in zip(bodies, apart, strict=True)]
    assert len(check(alone, at_rest(list(parts)))) == 1, "each for itself, their hulls touch"
    assert not [warning for warning in done.report.warnings if "touch" in warning]


def test_a_model_that_mujoco_does_not_load_is_checked_at_rest_and_that_is_said(arm: Path) -> None:
    arm.write_text(arm.read_text().replace('joint1="k"', 'joint1="none"'))
    done = rlacd.rewrite_robot(arm, arm.with_name("out.xml"), samples=5, threads=1)
    assert (done.samples, len(done.pairs)) == (1, 6)
    (said,) = [warning for warning in done.warnings if "at rest only" in warning]
    assert "MuJoCo cannot place the links of arm.xml" in said
    assert {pair.kind for pair in done.pairs} == {"sometimes"}
