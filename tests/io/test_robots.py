"""Rewriting URDF: every collision mesh becomes its hulls, every other byte stays, and simulators read the result."""

from __future__ import annotations

import json
import os
import re
from contextlib import nullcontext
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import trimesh
from click.testing import CliRunner
from lxml import etree

import rlacd
import rlacd.cli.decompose
from rlacd.cli.main import app
from rlacd.cli.terminal import rewrite_summary
from rlacd.errors import MeshFileError, OptionError
from rlacd.io.robots import decomposed
from tests.io.urdf_files import EAR, collisions, urdf, without_collision_meshes, write_ear
from tests.models import inside, table


@pytest.fixture
def ear(tmp_path: Path) -> Path:
    return write_ear(tmp_path)


@pytest.mark.parametrize("per", ["link", "mesh"])
@pytest.mark.promise("robots", "robot-hulls")
def test_a_urdf_keeps_every_byte_but_its_collision_meshes_whose_space_hulls_fill_at_every_scale(
    ear: Path, per: Any
) -> None:
    done = rlacd.rewrite_robot(ear, ear.with_name("out.urdf"), per=per, threads=1)
    after = done.path.read_text()
    assert without_collision_meshes(after) == without_collision_meshes(EAR)
    base, tip = (link.results for link in done.links)
    assert (len(base), len(tip)) == (1, 1 if per == "link" else 2)
    assert per == "link" or tip[1] is base[0], "what is used twice at one scale is decomposed once"
    first, second = len(base[0]), len(tip[0])
    assert after.count("<!-- kept > -->") == first, "what else is in a collision goes to each hull"
    names = [element.get("name") for element in etree.parse(str(done.path)).iterfind(".//collision")]
    assert names[:first] == [f"a > b_{index:03d}" for index in range(first)]
    assert done.warnings == []
    hulls = collisions(done.path)
    assert all(hull.volume > 0 and hull.is_convex for hull in hulls)
    scales = [[0.5, 0.5, 2.0], [-1.0, 1.0, 1.0], [0.5, 0.5, 2.0]]
    tables = [table().apply_transform(np.diag([*scale, 1.0])) for scale in scales]
    groups = [(hulls[:first], tables[0]), (hulls[first:], trimesh.util.concatenate(tables[1:]))]
    if per == "mesh":
        groups[1:] = [(hulls[first : first + second], tables[1]), (hulls[first + second :], tables[2])]
    for group, want in groups:
        assert trimesh.util.concatenate(group).bounds == pytest.approx(want.bounds, abs=1e-6)
        assert inside(group, want.vertices, 1e-6).all()
    for link, group in zip(done.links, (hulls[:first], hulls[first:]), strict=True):
        shift = 1.0 if link.name == "base" else 0.0  # its collision stands higher
        ours = trimesh.util.concatenate(link.hulls).bounds - (0, 0, shift)
        assert ours == pytest.approx(trimesh.util.concatenate(group).bounds, abs=1e-6)


LEVER = """<robot name="r">
<link name="arm">
  <collision name="beam">
    <origin xyz="1 2 3" rpy="0.3 0 0.5"/>
    <geometry><mesh filename="bar.stl" scale="2 1 1"/></geometry>
  </collision>
  <!-- between -->
  <collision><origin xyz="0 0 5"/><geometry><sphere radius="1"/></geometry></collision>
  <collision><geometry><mesh filename="bar.stl" scale="-1 1 1"/></geometry>
    <origin xyz="1 2 3.5" rpy="1.2 0.4 -2"/></collision>
  <collision group="soft"><geometry><mesh filename="bar.stl"/></geometry></collision>
</link>
<link name="hand">
  <collision><origin xyz="7 0 0" rpy="0 0 1"/><geometry><mesh filename="bar.stl"/></geometry></collision>
</link>
<joint name="j" type="revolute">
  <parent link="arm"/><child link="hand"/><origin xyz="0 9 0" rpy="0 0 1.5707963"/>
</joint>
</robot>"""


@pytest.fixture
def lever(tmp_path: Path) -> Path:
    trimesh.creation.box((1, 0.2, 0.2)).apply_translation((0.5, 0.3, 0)).export(tmp_path / "bar.stl")
    (tmp_path / "lever.urdf").write_text(LEVER)
    return tmp_path / "lever.urdf"


def collision_meshes(robot: Path) -> list[trimesh.Trimesh]:
    """The meshes of a URDF with all joints at zero, as yourdfpy places them; its spheres are left out."""
    yourdfpy = pytest.importorskip("yourdfpy", reason="the extra sim is not installed")
    bare = robot.with_name(f"bare_{robot.name}")
    bare.write_text(re.sub("<collision><[^<]*<geometry><sphere.*", "", robot.read_text()))
    urdf = yourdfpy.URDF.load(str(bare), load_collision_meshes=True, build_collision_scene_graph=True)
    scene = urdf.collision_scene
    each = [(scene.geometry[name], pose) for pose, name in map(scene.graph.get, scene.graph.nodes_geometry)]
    return [part for mesh, pose in each for part in mesh.copy().apply_transform(pose).split(only_watertight=False)]


def test_the_meshes_of_a_link_become_one_solid_where_its_first_mesh_was(lever: Path) -> None:
    """Turned, moved and mirrored; what collides differently stays apart, and primitives stay."""
    done = rlacd.rewrite_robot(lever, lever.with_name("out.urdf"), threshold_abs=0.01, threads=1)
    arm, hand = done.links
    assert [len(result.report.repair) for result in arm.results] == [2, 1]
    assert hand.results[0] is arm.results[1], "alike, wherever it is"
    after = done.path.read_text()
    assert after.count("<!-- between -->") == after.count('<sphere radius="1"/>') == after.count('group="soft"') == 1
    assert after.count("collision name=") == len(arm.results[0])
    before, hulls = collision_meshes(lever), [mesh.convex_hull for mesh in collision_meshes(done.path)]
    corners = np.concatenate([mesh.vertices for mesh in before])
    assert inside(hulls, corners, 1e-5).all()
    assert sum(hull.volume for hull in hulls) == pytest.approx(sum(abs(mesh.volume) for mesh in before), rel=0.05)


def test_a_link_of_sheets_and_points_is_covered(tmp_path: Path) -> None:
    trimesh.PointCloud(trimesh.creation.box().vertices + np.array([5, 0, 0])).export(tmp_path / "points.ply")
    trimesh.Trimesh([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]], [[0, 1, 2], [0, 2, 3]]).export(tmp_path / "flat.stl")
    trimesh.creation.box().export(tmp_path / "box.stl")
    robot = urdf(tmp_path, "filename='flat.stl'", "filename='points.ply'", "filename='box.stl' scale='-1 2 1'")
    done = rlacd.rewrite_robot(robot, tmp_path / "out.urdf", threads=1)
    assert [len(result.source.faces) for result in done.links[0].results] == [14, 0]
    assert trimesh.util.concatenate(collisions(done.path)).bounds == pytest.approx(
        np.array([[-0.5, -1, -0.5], [5.5, 1, 0.5]]), abs=0.01
    )
    trimesh.Trimesh().export(tmp_path / "empty.stl")
    with pytest.raises(MeshFileError, match=r"empty\.stl"):
        rlacd.rewrite_robot(urdf(tmp_path, "filename='box.stl'", "filename='empty.stl'"), tmp_path / "no.urdf")


def test_lengths_are_shares_of_the_robot_at_rest(lever: Path) -> None:
    ball = np.array([[-1, -1, 4], [1, 1, 6]])
    size = np.ptp(np.concatenate([ball, *(mesh.vertices for mesh in collision_meshes(lever))]), axis=0).max()
    assert size > 10, "the joint turns the hand away"
    for how, length in (({}, 0.015 * size), ({"threshold": 0.1}, 0.05 * size), ({"threshold_abs": 0.2}, 0.2)):
        done = rlacd.rewrite_robot(lever, lever.with_name("out.urdf"), links={"h.nd": 0.01}, threads=1, **how)  # type: ignore[arg-type]
        for link, want in zip(done.links, (length, 0.01), strict=True):
            options = link.results[0].report.options
            assert options["criterion"] == "distance"
            assert options["threshold_abs"] == pytest.approx(want, rel=5e-3)
    own = rlacd.rewrite_robot(lever, lever.with_name("own.urdf"), relative_to="mesh", per="mesh", threads=1)
    options = own.links[0].results[0].report.options
    assert (options["criterion"], options["threshold"], options["threshold_abs"]) == ("concavity", 0.05, None)
    with pytest.raises(OptionError, match=r"matches the regular expression 'han'; there are arm, hand"):
        rlacd.rewrite_robot(lever, lever.with_name("no.urdf"), links={"han": 0.01})


@pytest.mark.parametrize("robot", ["kuka_iiwa/model.urdf", "franka_panda/panda.urdf"])
@pytest.mark.nightly
def test_real_robots_are_rewritten_and_simulated(tmp_path: Path, robot: str) -> None:
    """The arms that come with pybullet; Panda's calls its folder of meshes a package."""
    bullet = pytest.importorskip("pybullet", reason="the extra sim is not installed")
    import pybullet_data

    source = Path(pybullet_data.getDataPath()) / robot
    done = rlacd.rewrite_robot(source, tmp_path / "arm.urdf", threshold=0.2, policy="navacd")
    text, after = source.read_text(), done.path.read_text()
    folder = os.path.relpath(source.parent, tmp_path)
    named = without_collision_meshes(after).replace(f'filename="{folder}/', 'filename="')
    assert named == without_collision_meshes(text), "names follow, all else stays"
    # PyBullet finds packages above the file only: without what Panda shows, what collides is what is read.
    lean = re.sub(r"<visual.*?</visual>", "", after, flags=re.DOTALL) if "package://" in after else after
    done.path.write_text(lean)
    client = bullet.connect(bullet.DIRECT)
    try:
        arm = bullet.loadURDF(str(done.path), useFixedBase=True, physicsClientId=client)
        joints = bullet.getNumJoints(arm, physicsClientId=client)
        shapes = [bullet.getCollisionShapeData(arm, link, physicsClientId=client) for link in range(-1, joints)]
        assert sum(map(len, shapes)) == sum(len(link.files) for link in done.links)
        for _ in range(24):
            bullet.stepSimulation(physicsClientId=client)
    finally:
        bullet.disconnect(client)


def test_packages_keep_their_name_in_the_new_references(tmp_path: Path) -> None:
    package = tmp_path / "ws" / "ear_description"
    (package / "meshes").mkdir(parents=True)
    (package / "urdf").mkdir()
    names = '<!-- <name>old</name> --><author><name>A. N. Other</name></author><name lang="en"> ear </name>'
    described = f'<?xml version="1.0" encoding="UTF-16"?><package format="3">{names}</package>'
    (package / "package.xml").write_text(described, encoding="utf-16")
    table().export(package / "meshes" / "table.stl")
    source = package / "urdf" / "ear.urdf"
    source.write_text(EAR.replace("meshes/table", "package://ear/meshes/table"))
    inside = rlacd.rewrite_robot(source, package / "urdf" / "out.urdf", threads=1)
    assert 'package://ear/urdf/out_urdf/out_table_000.obj"' in inside.path.read_text()
    outside = rlacd.rewrite_robot(source, tmp_path / "out.urdf", threads=1)
    assert '"out_urdf/out_table_000.obj"' in outside.path.read_text()


@pytest.mark.parametrize("how", ["option", "sibling", "ament", "ros"])
def test_packages_are_found_where_robotics_people_keep_them(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, how: str
) -> None:
    robot, parts = tmp_path / "src" / "bot" / "bot.urdf", tmp_path / "elsewhere" / "parts"
    robot.parent.mkdir(parents=True)
    if how == "sibling":
        parts = tmp_path / "src" / "parts"
    elif how == "ament":
        parts = tmp_path / "install" / "share" / "parts"
        monkeypatch.setenv("AMENT_PREFIX_PATH", str(tmp_path / "install"))
    elif how == "ros":
        monkeypatch.setenv("ROS_PACKAGE_PATH", str(tmp_path / "elsewhere"))
    parts.mkdir(parents=True)
    (parts / "package.xml").write_text("<package><name>parts</name></package>")
    table().export(parts / "table.stl")
    robot.write_text(EAR.replace("meshes/table", "package://parts/table"))
    given = [f"parts={parts}"] if how == "option" else []
    done = rlacd.rewrite_robot(robot, robot.with_name("out.urdf"), package_dirs=given, threads=1)
    assert {mesh for link in done.links for mesh in link.meshes} == {parts / "table.stl"}


def test_lengths_are_in_the_robots_unit(tmp_path: Path) -> None:
    """A mesh in millimetres at scale 0.001: the tolerance is in metres."""
    big = table()
    big.apply_scale(1000.0)
    big.export(tmp_path / "big.stl")
    robot = urdf(tmp_path, "filename='big.stl' scale='0.001 0.001 0.001'")
    done = rlacd.rewrite_robot(robot, tmp_path / "out.urdf", threshold_abs=0.004, threads=1)
    assert done.links[0].results[0].report.options["threshold_abs"] == 0.004  # metres, as it was given
    (hulls,) = [trimesh.util.concatenate(collisions(done.path))]
    assert hulls.bounds == pytest.approx(table().bounds, abs=1e-6)


def test_a_mesh_smaller_than_the_threshold_becomes_one_hull(tmp_path: Path) -> None:
    apart = trimesh.util.concatenate([table(), table().apply_translation((1, 0, 0))])
    for name, mesh in (("one", table()), ("two", apart)):
        mesh.export(tmp_path / f"{name}.stl")
    urdf(tmp_path, "filename='one.stl'", "filename='two.stl'")
    done = rlacd.rewrite_robot(tmp_path / "r.urdf", tmp_path / "out.urdf", threshold_abs=0.9, per="mesh", threads=1)
    assert [len(result) for result in done.links[0].results] == [1, 1]
    fine = rlacd.rewrite_robot(tmp_path / "r.urdf", tmp_path / "fine.urdf", threshold_abs=0.01, per="mesh", threads=1)
    assert [len(result) for result in fine.links[0].results] == [5, 10]


def test_a_timeout_counts_for_each_mesh(ear: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    given = []
    whole = decomposed.decompose_quietly

    def watched(*words: object, **options: object) -> object:
        given.append(options["timeout"])
        return whole(*words, **options)  # type: ignore[arg-type]

    monkeypatch.setattr(decomposed, "decompose_quietly", watched)
    rlacd.rewrite_robot(ear, ear.with_name("out.urdf"), timeout=50.0, threads=1)
    assert given == [50.0, 50.0]


def test_the_unit_of_collada_files_is_applied_as_ros_does(tmp_path: Path) -> None:
    big = table()
    big.apply_scale(100.0)
    dae = big.export(file_type="dae")
    text = dae.decode() if isinstance(dae, bytes) else dae
    text = re.sub(r"<up_axis>", '<unit name="centimeter" meter="0.01"/><up_axis>', text)
    (tmp_path / "table.dae").write_text(text)
    done = rlacd.rewrite_robot(urdf(tmp_path, "filename='table.dae'"), tmp_path / "out.urdf", threads=1)
    assert trimesh.util.concatenate(collisions(done.path)).bounds == pytest.approx(table().bounds, abs=1e-6)
    assert any("Y_UP" in warning for warning in done.warnings)


def test_meshes_of_one_name_in_two_folders_do_not_clash(tmp_path: Path) -> None:
    for folder, size in (("a", 1.0), ("b", 2.0)):
        (tmp_path / folder).mkdir()
        trimesh.creation.box((size, size, size)).export(tmp_path / folder / ("Arm.stl" if folder == "a" else "arm.stl"))
    robot = urdf(tmp_path, "filename='a/Arm.stl'", "filename='b/arm.stl'")
    done = rlacd.rewrite_robot(robot, tmp_path / "out.urdf", per="mesh", threads=1)
    assert [mesh.extents[0] for mesh in collisions(done.path)] == pytest.approx([1.0, 2.0])
    assert len({name.lower() for name in done.links[0].files}) == 2


def test_line_ends_and_encodings_are_kept(ear: Path) -> None:
    data = EAR.replace('version="1.0"', 'version="1.0" encoding="iso-8859-1"').replace("made by", "für")
    ear.write_bytes(data.replace("\n", "\r\n").encode("latin-1"))
    done = rlacd.rewrite_robot(ear, ear.with_name("aus – 机.urdf"), threads=1)
    after = done.path.read_bytes()
    assert b"f\xfcr" in after
    assert after.count(b"\n") == after.count(b"\r\n")
    assert len(collisions(done.path)) > 3, "names that Latin-1 cannot hold are written as character references"


def test_a_robot_is_rewritten_on_the_command_line(ear: Path) -> None:
    run = CliRunner().invoke(app, ["decompose", str(ear), "--threads", "1", "--report", "-"])
    assert run.exit_code == 0, run.output
    assert ear.with_name("ear_hulls.urdf").is_file()
    assert "2 links" in run.stderr
    assert re.search(r"tip +2 meshes +\d+ hulls? +farthest [\d.e-]+ m\n", run.stderr)
    assert [link["name"] for link in json.loads(run.stdout)["links"]] == ["base", "tip"]
    run = CliRunner().invoke(app, ["decompose", str(ear), "--link", "t.*=1mm", "--link", "base=0.5", "--per", "mesh"])
    assert run.exit_code == 0, run.output
    for words, says in (
        (["--picture", "p.png"], "--picture is for a single mesh"),
        (["--package-dir", "no/such"], "does not exist"),
        (["--link", "tip"], "REGEX=LENGTH"),
        (["--link", "*tip=1mm"], "regular expressions"),
        (["--link", "tap=1mm"], "base, tip"),
        (["--relative-to", "node"], "'mesh'"),
    ):
        run = CliRunner().invoke(app, ["decompose", str(ear), *words])
        assert run.exit_code == 2
        assert says in " ".join(run.stderr.split())
        assert run.stderr.count("\n") == 1


def test_warnings_of_a_kind_are_one_that_names_the_worst(tmp_path: Path) -> None:
    """Rings whose holes and gaps close, in another number and size each, from files whose y axis points up."""
    links = []
    for index, (width, count) in enumerate([(0.02, 1), (0.06, 3), (0.04, 1)]):
        rings = [trimesh.creation.annulus(width, width + 0.05, 0.05, sections=24) for _ in range(count)]
        mesh = trimesh.util.concatenate([ring.apply_translation((i, 0, 0)) for i, ring in enumerate(rings)])
        (tmp_path / f"ring{index}.dae").write_bytes(trimesh.exchange.dae.export_collada(mesh))
        mesh = f'<mesh filename="ring{index}.dae"/>'
        links.append(f'<link name="l{index}"><collision><geometry>{mesh}</geometry></collision></link>')
    (tmp_path / "r.urdf").write_text(f"<robot name='r'>{''.join(links)}</robot>")
    done = rlacd.rewrite_robot(tmp_path / "r.urdf", tmp_path / "out.urdf", threshold_abs=0.015, max_hulls=1, threads=1)
    said = [warning for warning in done.warnings if "passage" in warning]
    assert len(said) == 1
    assert said[0].startswith("l1 and 2 others: 5 passages narrow by over half, 5 to nothing: near")
    (turned,) = [warning for warning in done.warnings if "Y_UP" in warning]
    assert turned.startswith("l0 (ring0.dae) and 2 others: "), "the link, and the file to correct"
    assert len(done.warnings) == 5, "about the threshold, about mass, and about the links, which stand in each other"


def test_warnings_in_python_name_the_robot_and_its_links_once(tmp_path: Path) -> None:
    bowl = trimesh.creation.icosphere(subdivisions=2)
    trimesh.Trimesh(bowl.vertices, bowl.faces[bowl.triangles_center[:, 2] < 0.2]).export(tmp_path / "bowl.stl")
    urdf(tmp_path, "filename='bowl.stl'")
    with pytest.warns(rlacd.DecompositionWarning) as caught:
        done = rlacd.rewrite_robot(tmp_path / "r.urdf", tmp_path / "out.urdf", quality="fast", threads=1)
    (one,) = [one for one in caught if one.category is rlacd.DecompositionWarning]  # others' garbage may warn, too
    assert str(one.message) == f"r.urdf: {' '.join(done.warnings)}"
    assert one.filename == __file__
    assert any(warning.startswith("l: 1 open body became a thin shell") for warning in done.warnings)


def test_a_mass_that_follows_from_hulls_is_told(tmp_path: Path) -> None:
    mujoco = pytest.importorskip("mujoco", reason="extra sim")
    table().export(tmp_path / "table.stl")
    mesh, mass = '<collision><geometry><mesh filename="table.stl"/></geometry></collision>', '<mass value="1"/>'
    inertial = f'<inertial>{mass}<inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/></inertial>'
    for number, stated in enumerate(["", inertial]):
        links = "".join(f'<link name="{name}">{stated}{mesh}</link>' for name in ("base", "tip"))
        joint = (
            '<joint name="j" type="continuous"><parent link="base"/><child link="tip"/><origin xyz="2 0 0"/></joint>'
        )
        (tmp_path / "r.urdf").write_text(f'<robot name="r">{links}{joint}</robot>')
        done = rlacd.rewrite_robot(tmp_path / "r.urdf", tmp_path / "out.urdf", threads=1)
        before, after = (mujoco.MjModel.from_xml_path(str(path)) for path in (tmp_path / "r.urdf", done.path))
        said = [warning for warning in done.warnings if warning.startswith("2 links, such as base, have no <inertial>")]
        assert (len(said), np.allclose(before.body_mass, after.body_mass)) == ((1, False), (0, True))[number]
        assert not [warning for warning in done.warnings if "<inertia>" in warning]


@pytest.mark.parametrize(("off", "said"), [(0.4, []), (1.1, ["The <inertia> of the link base cannot be"])])
def test_an_inertia_that_no_body_has_is_told(off: float, said: list[str], tmp_path: Path) -> None:
    """MuJoCo refuses such a file, with or without hulls."""
    mujoco = pytest.importorskip("mujoco", reason="extra sim")
    table().export(tmp_path / "table.stl")
    inertia = f'<mass value="1"/><inertia ixx="1" iyy="1" izz="1" ixy="{off}" ixz="0" iyz="0"/>'
    mesh = '<collision><geometry><mesh filename="table.stl"/></geometry></collision>'
    links = f'<link name="world"/><link name="base"><inertial>{inertia}</inertial>{mesh}</link>'
    joint = '<joint name="j" type="floating"><parent link="world"/><child link="base"/></joint>'
    (tmp_path / "r.urdf").write_text(f'<robot name="r">{links}{joint}</robot>')
    done = rlacd.rewrite_robot(tmp_path / "r.urdf", tmp_path / "out.urdf", threads=1, quality="fast")
    assert [warning[: len(said[0])] for warning in done.warnings if "<inertia>" in warning] == said
    for path in (tmp_path / "r.urdf", done.path):
        with pytest.raises(ValueError, match="positive eigenvalues") if said else nullcontext():
            mujoco.MjModel.from_xml_path(str(path))


def test_info_shows_the_links_of_a_robot(ear: Path) -> None:
    run = CliRunner().invoke(app, ["info", str(ear)])
    assert run.exit_code == 0, run.output
    assert re.search(
        r"2 that collide, 2 with meshes\n +base +1 mesh +\d+ triangles, 1 box\n +tip +2 meshes", run.stdout
    )
    facts = json.loads(CliRunner().invoke(app, ["info", str(ear), "--json"]).stdout)
    assert [(link["name"], len(link["meshes"])) for link in facts["links"]] == [("base", 1), ("tip", 2)]


def test_links_of_primitives_alone_count_and_are_told(tmp_path: Path) -> None:
    """For the size, in tables and in the matrix: a mesh of 10 cm between a pole and a ball, 3 m apart."""
    trimesh.creation.box((0.1, 0.1, 0.1)).export(tmp_path / "box.stl")
    shapes = {"pole": '<cylinder radius="0.1" length="2"/>', "tool": '<mesh filename="box.stl"/>'}
    shapes |= {"tip": '<sphere radius="0.5"/>', "world": '<box size="9 9 9"/>'}
    along = '<origin xyz="0 0 0" rpy="0 1.5707963 0"/>'
    links = [
        f'<link name="{name}"><collision>{along}<geometry>{shape}</geometry></collision></link>'
        for name, shape in shapes.items()
    ]
    joints = [
        f"""<joint name="{child}_" type="revolute"><parent link="{parent}"/><child link="{child}"/>
        <origin xyz="{x} 0 0"/><axis xyz="1 0 0"/><limit lower="-1" upper="1" effort="1" velocity="1"/></joint>"""
        for parent, child, x in (("world", "pole", 0), ("pole", "tool", 1.5), ("tool", "tip", 1.5))
    ]
    robot = tmp_path / "r.urdf"
    robot.write_text(f"<robot name='r'>{''.join(links + joints)}</robot>")
    matrix = tmp_path / "r.srdf"
    done = rlacd.rewrite_robot(robot, tmp_path / "out.urdf", srdf=matrix, samples=10, threads=1)
    assert done.size == pytest.approx(1 + 3 + 0.5, rel=0.01), "the pole lies along x"
    assert done.links[1].results[0].report.options["threshold_abs"] == pytest.approx(0.015 * done.size, rel=0.01)
    assert [(link.name, len(link.hulls), link.primitives) for link in done.links] == [
        ("pole", 0, 1),
        ("tool", 1, 0),
        ("tip", 0, 1),
    ]
    assert [link.name for link in done.replaced] == ["tool"]
    assert re.search(
        r"\n  pole +1 primitive\n  tool +1 mesh +1 hull +farthest .*\n  tip +1 primitive\n", rewrite_summary(done)
    )
    said = {tuple(pair.attrib.values()) for pair in etree.parse(str(matrix)).iterfind("disable_collisions")}
    assert said == {("pole", "tool", "Adjacent"), ("tool", "tip", "Adjacent"), ("pole", "tip", "Never")}
    facts = json.loads(CliRunner().invoke(app, ["info", str(robot), "--json"]).stdout)
    assert [link["primitives"] for link in facts["links"]] == [["cylinder"], [], ["sphere"]]
    with pytest.raises(OptionError, match="matches the regular expression 'tip'; there are tool"):
        rlacd.rewrite_robot(robot, tmp_path / "no.urdf", links={"tip": 0.01})
    robot.write_text(robot.read_text().replace(shapes["tool"], '<box size="0.1 0.1 0.1"/>'))
    bare = rlacd.rewrite_robot(robot, tmp_path / "out.urdf", srdf=matrix, samples=10, threads=1)
    assert {tuple(pair.attrib.values()) for pair in etree.parse(str(matrix)).iterfind("disable_collisions")} == said
    assert bare.path.read_text() == robot.read_text()


SHOWN = """<robot name="r">
<link name="arm">
  <visual name="v"><origin xyz="1 0 0" rpy="0 .5 0"/><geometry><mesh filename="bar.stl" scale="1 2 1"/></geometry>
    <material name="m"><color rgba="1 0 0 1"/></material></visual>
  <visual><geometry><mesh filename="bar.stl"/></geometry></visual>
  <visual><geometry><sphere radius=".1"/></geometry></visual></link>
<link name="pole"><visual><origin xyz="0 1 0"/><geometry><cylinder radius=".1" length="1"/></geometry></visual></link>
<link name="cover"><collision><geometry><box size="1 1 1"/></geometry></collision>
  <visual><geometry><mesh filename="bar.stl"/></geometry></visual></link>
<joint name="j" type="revolute"><parent link="arm"/><child link="pole"/><origin xyz="0 0 5"/>
  <limit lower="-1" upper="1" effort="1" velocity="1"/></joint>
<joint name="k" type="revolute"><parent link="pole"/><child link="cover"/><origin xyz="0 0 5"/>
  <limit lower="-1" upper="1" effort="1" velocity="1"/></joint>
</robot>"""


def test_links_without_collision_geometry_get_it_from_what_they_show(tmp_path: Path) -> None:
    """Where asked; those that have some keep that, and what is shown stays byte for byte."""
    trimesh.creation.box((1, 0.2, 0.2)).export(tmp_path / "bar.stl")
    robot = tmp_path / "r.urdf"
    robot.write_text(SHOWN)
    asked: dict[str, Any] = {"srdf": tmp_path / "r.srdf", "samples": 20, "threads": 1}
    done = rlacd.rewrite_robot(robot, tmp_path / "out.urdf", from_visual=True, **asked)
    after = done.path.read_text()
    assert re.sub(r"\s*<collision>((?!<box).)*?</collision>", "", after) == SHOWN
    assert [(len(link.hulls), link.primitives) for link in done.links] == [(2, 1), (0, 1), (0, 1)]
    root = etree.fromstring(after)
    arm, pole, _ = root.iterfind("link")
    for link in (arm, pole):
        shown = [(v.find("origin"), v.find("geometry")[0]) for v in link.iterfind("visual")]
        primitives = [(o, g) for o, g in shown if g.tag != "mesh"]
        own = [(c.find("origin"), c.find("geometry")[0]) for c in link.iterfind("collision")]
        found = [(o, g) for o, g in own if g.tag != "mesh"]
        for (origin, shape), (other, same) in zip(primitives, found, strict=True):
            assert dict(shape.attrib) == dict(same.attrib)
            assert (origin is None and other is None) or dict(origin.attrib) == dict(other.attrib)
    bars = [trimesh.load_mesh(tmp_path / "bar.stl") for _ in range(2)]
    turn = trimesh.transformations.euler_matrix(0, 0.5, 0)
    bars[0].apply_transform(np.diag([1.0, 2.0, 1.0, 1.0])).apply_transform(turn).apply_translation((1, 0, 0))
    assert inside(done.links[0].hulls, np.concatenate([bar.vertices for bar in bars]), 1e-6).all()
    said = {tuple(pair.attrib.values()) for pair in etree.parse(str(asked["srdf"])).iterfind("disable_collisions")}
    assert said == {("arm", "pole", "Adjacent"), ("pole", "cover", "Adjacent"), ("arm", "cover", "Never")}
    plain = rlacd.rewrite_robot(robot, tmp_path / "out.urdf", **asked)
    assert plain.path.read_text() == SHOWN
    assert any(warning.endswith("has no collision mesh, so this is a copy.") for warning in plain.warnings)
    robot.write_text(re.sub("<collision.*?</collision>", "", SHOWN))
    (said,) = rlacd.rewrite_robot(robot, tmp_path / "out.urdf", threads=1).warnings
    assert said.endswith("so this is a copy; --from-visual makes collision geometry of what it shows.")
    robot.write_text(SHOWN)
    run = CliRunner().invoke(app, ["decompose", str(robot), "--from-visual", "--threads", "1", "--samples", "5"])
    assert run.exit_code == 0, run.output
    assert (tmp_path / "r_hulls.urdf").read_text().count("<collision>") == after.count("<collision>")


@pytest.fixture
def rings(tmp_path: Path) -> Path:
    """A ring, a bowl that is open at the top, and a box, which no joint connects."""
    trimesh.creation.torus(0.4, 0.1, major_sections=64, minor_sections=24).export(tmp_path / "ring.stl")
    bowl = trimesh.creation.icosphere(subdivisions=3, radius=0.4)
    trimesh.Trimesh(bowl.vertices, bowl.faces[bowl.triangles_center[:, 2] < 0.1]).export(tmp_path / "bowl.stl")
    trimesh.creation.box().export(tmp_path / "box.stl")
    collision = '<link name="{0}"><collision><geometry><mesh filename="{0}.stl"/></geometry></collision></link>'
    links = "".join(map(collision.format, ("ring", "bowl", "box")))
    (tmp_path / "rings.urdf").write_text(f'<robot name="r">{links}</robot>')
    return tmp_path / "rings.urdf"


def test_a_link_of_many_hulls_is_told_with_what_makes_it_fewer(rings: Path) -> None:
    options: dict[str, Any] = {"threshold_abs": 0.004, "samples": 0, "threads": 1, "quality": "fast"}
    done = rlacd.rewrite_robot(rings, rings.with_name("out.urdf"), **options)
    counts = {link.name: len(link.hulls) for link in done.links}
    told = [warning for warning in done.warnings if " at twice the tolerance " in warning]
    assert [warning.split()[0] for warning in told] == [name for name, count in counts.items() if count > 20]
    ((twice, four),) = re.findall(r"about (\d+) at twice .* and (\d+) at four times, --link 'ring=0.008'", told[0])
    assert counts["ring"] > int(twice) > int(four)
    again = rlacd.rewrite_robot(rings, rings.with_name("out.urdf"), links={"ring": 0.008}, **options)
    assert len(again.links[0].hulls) == int(twice)
    assert told[0].startswith(f"ring is {counts['ring']} hulls; ")
    assert told[0].endswith("'.")
    ((filled,),) = (re.findall(r"with its open bodies filled (\d+), --openings solid\.", told[1]),)
    solid = rlacd.rewrite_robot(rings, rings.with_name("out.urdf"), openings="solid", **options)
    assert len(solid.links[1].hulls) == int(filled) < counts["bowl"]
    own = rlacd.rewrite_robot(rings, rings.with_name("out.urdf"), relative_to="mesh", threads=1, samples=0)
    assert not [warning for warning in own.warnings if "twice" in warning]


@pytest.mark.parametrize("filled", [14, 15])
def test_to_fill_a_link_is_told_only_where_it_helps_more_than_twice_the_tolerance(
    filled: int, rings: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def counted(body: object, collider: object, options: dict[str, Any], *_: object) -> list[int]:
        return [filled] if options["openings"] == "solid" else [15, 10]

    monkeypatch.setattr("rlacd.io.robots.coarser._hulls", counted)
    done = rlacd.rewrite_robot(
        rings, rings.with_name("out.urdf"), threshold_abs=0.004, samples=0, threads=1, quality="fast"
    )
    told = next(warning for warning in done.warnings if warning.startswith("bowl is "))
    assert ("; with its open bodies filled 14, --openings solid." in told) == (filled < 15)


def test_a_link_with_a_small_opening_is_a_solid_and_told(rings: Path) -> None:
    """A palm without the cap beneath its wrist; a ball cannot roll in only if it is larger than that."""
    palm = trimesh.creation.icosphere(subdivisions=3, radius=0.4)
    trimesh.Trimesh(palm.vertices, palm.faces[palm.triangles_center[:, 2] < 0.3]).export(rings.with_name("bowl.stl"))
    options: dict[str, Any] = {"samples": 0, "threads": 1, "quality": "fast"}
    done = rlacd.rewrite_robot(rings, rings.with_name("out.urdf"), **options)
    assert [len(link.hulls) for link in done.links][1] == 1
    assert any("Holes were closed" in warning and "bowl" in warning for warning in done.warnings)
    shell = rlacd.rewrite_robot(rings, rings.with_name("out.urdf"), openings="auto", **options)
    assert len(shell.links[1].hulls) > 20


def test_a_robots_tradeoff_has_the_hulls_of_each_link(rings: Path) -> None:
    run = CliRunner().invoke(
        app, ["tradeoff", str(rings), "--threads", "1", "-t", "8mm", "--json", "--max-hulls", "20"]
    )
    assert run.exit_code == 0, run.output
    found = json.loads(run.stdout)
    assert found["thresholds_abs"][:4] == pytest.approx([0.008, 0.01, 0.012, 0.016])
    assert list(found["links"]) == ["ring", "bowl", "box"]
    assert found["total"] == [sum(counts) for counts in zip(*found["links"].values(), strict=True)]
    assert found["links"]["box"] == [1] * 10
    assert found["total"][found["pick"]] <= 20 < found["total"][found["pick"] - 1]
    options: dict[str, Any] = {"samples": 0, "threads": 1, "quality": "fast"}
    done = rlacd.rewrite_robot(rings, rings.with_name("out.urdf"), threshold_abs=0.016, **options)
    assert [len(link.hulls) for link in done.links] == [counts[3] for counts in found["links"].values()]
    table = CliRunner().invoke(app, ["tradeoff", str(rings), "--threads", "1", "-t", "8mm"]).stdout.splitlines()
    assert table[0].split()[:3] == ["threshold_abs", "8", "mm"]
    assert table[1].split() == ["ring", *map(str, found["links"]["ring"])]
    assert table[-1].split()[2:] == [*map(str, found["total"])]
    for words, says in ((["--criterion", "volume"], "lengths"), (["--scale", "2"], "single mesh")):
        refused = CliRunner().invoke(app, ["tradeoff", str(rings), *words])
        assert refused.exit_code == 2
        assert says in refused.stderr


@pytest.mark.parametrize("holds", ["", "<collision><geometry><sphere radius='1'/></geometry></collision>"])
def test_a_tradeoff_of_a_robot_without_collision_meshes_is_refused(holds: str, tmp_path: Path) -> None:
    robot = tmp_path / "robot.urdf"
    robot.write_text(f"<robot name='r'><link name='l'>{holds}</link></robot>")
    run = CliRunner().invoke(app, ["tradeoff", str(robot)])
    assert run.exit_code == 2
    assert run.stderr.endswith("robot.urdf has no collision mesh, so there is nothing to compare.\n")


def test_a_tradeoff_without_time_for_any_link_is_an_empty_table(rings: Path) -> None:
    run = CliRunner().invoke(app, ["tradeoff", str(rings), "--threads", "1", "--timeout", "1e-6"])
    assert run.exit_code == 4
    assert run.stdout.startswith("threshold_abs")
    assert run.stdout.count("\n") == 1


def test_a_log_tells_which_link_is_under_way(ear: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(rlacd.cli.decompose, "LOG_EVERY", 0.0)
    run = CliRunner().invoke(app, ["decompose", str(ear), "--threads", "1"])
    assert run.exit_code == 0, run.output
    assert re.search(r"^link base \(1 of 2\): \w+\n(.*\n)*link tip \(2 of 2\): \w+$", run.stderr, re.MULTILINE)
    run = CliRunner().invoke(app, ["decompose", str(ear), "-o", str(ear.with_name("o.urdf")), "--quiet"])
    assert run.stderr == ""


def test_what_a_urdf_shows_is_found_from_elsewhere(tmp_path: Path) -> None:
    (tmp_path / "in").mkdir()
    (tmp_path / "out").mkdir()
    ear, near = write_ear(tmp_path / "in"), tmp_path / "in" / "out.urdf"
    far = rlacd.rewrite_robot(ear, tmp_path / "out" / "out.urdf", threads=1).path
    rlacd.rewrite_robot(ear, near, threads=1)
    looks = etree.parse(str(far)).xpath("//visual//mesh/@filename")
    assert looks
    assert {(far.parent / name).resolve() for name in looks} == {(ear.parent / "meshes" / "table.stl").resolve()}
    assert far.read_text().replace('"../in/', '"') == near.read_text(), "all else stays"
