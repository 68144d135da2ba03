"""Rewriting robots: every collision mesh becomes its hulls, every other byte stays, and simulators read the result."""

from __future__ import annotations

import difflib
import json
import os
import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import trimesh
from click.testing import CliRunner
from lxml import etree

import rlacd
from rlacd.cli.main import app
from rlacd.errors import MeshFileError, OptionError, OutputError
from rlacd.io.robots import decomposed
from tests.models import fall_in_mujoco, inside, mujoco_model, points_of_geom, table

EAR = """<?xml version="1.0"?>
<!-- made by hand -->
<robot name='ear'   >
\t<link name="base">
\t\t<inertial><mass value="1"/><inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/></inertial>
\t\t<visual>
\t\t\t<geometry><mesh filename="meshes/table.stl"/></geometry>
\t\t</visual>
\t\t<collision name="a &gt; b">
\t\t\t<origin xyz="0 0 1"/><!-- kept > -->
\t\t\t<geometry>
\t\t\t\t<mesh scale="0.5 0.5 2"
\t\t\t\t      filename = 'meshes/table.stl' />
\t\t\t</geometry>
\t\t</collision>
\t\t<collision><geometry><box size="1 1 1"/></geometry></collision>
\t</link>
\t<joint name="j" type="fixed"><parent link="base"/><child link="tip"/></joint>
\t<link name="tip"><inertial><mass value="1"/><inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/></inertial>
\t\t<collision><geometry><mesh filename="meshes/table.stl" scale="-1 1 1"/></geometry></collision>
\t\t<collision><geometry><mesh filename="meshes/table.stl" scale="0.5 0.5 2"/></geometry></collision></link>
</robot>   
<!-- the end -->"""


def part(*attributes: str) -> str:
    """A robot of one link, which collides as meshes of these attributes."""
    each = "".join(f"<collision><geometry><mesh {words}/></geometry></collision>" for words in attributes)
    return f"<robot name='r'><link name='l'>{each}</link></robot>"


def urdf(folder: Path, *attributes: str) -> Path:
    (folder / "r.urdf").write_text(part(*attributes))
    return folder / "r.urdf"


@pytest.fixture
def ear(tmp_path: Path) -> Path:
    """A robot with the awkward parts real ones have, its mesh beside it."""
    (tmp_path / "meshes").mkdir()
    table().export(tmp_path / "meshes" / "table.stl")
    (tmp_path / "ear.urdf").write_text(EAR)
    return tmp_path / "ear.urdf"


def without_collision_meshes(text: str) -> str:
    """Take out every collision that is a mesh, and the white space before all but the first of a run of them."""
    blocks = re.compile(r"<collision\b(?:(?!</collision>).)*?<mesh.*?</collision>", re.DOTALL)
    return re.sub(r"(?:@\s*)*@", "@", blocks.sub("@", text))


def collisions(path: Path) -> list[trimesh.Trimesh]:
    """Read the collision meshes of a URDF, scaled as it says."""
    found = []
    for mesh in etree.parse(str(path)).iterfind(".//collision/geometry/mesh"):
        read = trimesh.load_mesh(path.parent / mesh.get("filename"), process=False)
        scale = np.array([float(word) for word in mesh.get("scale", "1 1 1").split()])
        faces = read.faces if scale.prod() > 0 else read.faces[:, ::-1]
        found.append(trimesh.Trimesh(read.vertices * scale, faces, process=False))
    return found


# --- URDF -------------------------------------------------------------------------------------------------------------


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
    size = np.ptp(np.concatenate([mesh.vertices for mesh in collision_meshes(lever)]), axis=0).max()
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
    with pytest.raises(OptionError, match=r"matches the regular expression 'han': arm, hand"):
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
    assert without_collision_meshes(after) == without_collision_meshes(text)
    # Looks are named relative to the file, which moved: without them, what collides is what is read.
    lean = re.sub(r"<visual.*?</visual>", "", after, flags=re.DOTALL)
    done.path.write_text(lean)
    client = bullet.connect(bullet.DIRECT)
    try:
        arm = bullet.loadURDF(str(done.path), useFixedBase=True, physicsClientId=client)
        joints = bullet.getNumJoints(arm, physicsClientId=client)
        shapes = [bullet.getCollisionShapeData(arm, link, physicsClientId=client) for link in range(-1, joints)]
        assert sum(map(len, shapes)) == lean.count("<mesh")
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
    whole = decomposed.decompose

    def watched(*words: object, **options: object) -> object:
        given.append(options["timeout"])
        return whole(*words, **options)  # type: ignore[arg-type]

    monkeypatch.setattr(decomposed, "decompose", watched)
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
    assert "Y_UP" in done.warnings[0]


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
    assert re.search(r"tip +2 meshes +\d+ hulls? +farthest [\d.e-]+ mm", run.stderr)
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
    """Rings whose holes close, in another number and size each, from files whose y axis points up."""
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
    assert said[0].startswith("ring1 and 2 others: 3 passages narrow by over half, 3 to nothing: near")
    assert sum("Y_UP" in warning for warning in done.warnings) == 1
    assert len(done.warnings) == 4, "one more about the threshold, and one about the links, which stand in each other"


def test_going_elsewhere_says_which_files_will_be_missed(ear: Path, tmp_path: Path) -> None:
    (tmp_path / "far").mkdir()
    done = rlacd.rewrite_robot(ear, tmp_path / "far" / "out.urdf", threads=1)
    (warning,) = done.warnings
    assert "meshes/table.stl" in warning


# --- MJCF -------------------------------------------------------------------------------------------------------------

ARM = """<mujoco model="arm">
  <compiler angle="radian" meshdir="assets"/>
  <default>
    <default class="arm">
      <geom type="mesh"/>
      <default class="visual"><geom contype="0" conaffinity="0" group="2"/></default>
      <default class="collision"><geom group="3" mass="3"/></default>
    </default>
    <mesh scale="0.5 0.5 0.5"/>
  </default>
  <asset>
    <mesh file="table.stl"/>
    <mesh name="big" file="table.stl" scale="1 1 1"/>
    <mesh name="tetrahedron" vertex="0 0 0 1 0 0 0 1 0 0 0 1"/>
  </asset>
  <worldbody>
    <body name="upper" childclass="arm">
      <freejoint/>
      <geom class="visual" mesh="table"/>
      <geom name="elbow" class="collision" mesh="table" pos="0 0 0.1"/> <!-- kept -->
    </body>
    <body name="lower" pos="2 0 0">
      <freejoint/>
      <geom name="both" type="mesh" mesh="big" rgba="1 0 0 1"/>
      <geom type="mesh" mesh="tetrahedron" pos="0 0 1"/>
      <geom type="sphere" size="0.1"/>
    </body>
  </worldbody>
  <contact><exclude body1="upper" body2="lower"/></contact>
  <sensor><user name="s" dim="1" objtype="geom" objname="elbow"/></sensor>
</mujoco>
"""


@pytest.fixture
def arm(tmp_path: Path) -> Path:
    (tmp_path / "assets").mkdir()
    table().export(tmp_path / "assets" / "table.stl")
    (tmp_path / "arm.xml").write_text(ARM)
    return tmp_path / "arm.xml"


@pytest.mark.promise("robot-hulls")
def test_mujoco_reads_the_rewritten_mjcf_and_hulls_lie_where_the_mesh_lay(arm: Path) -> None:
    """MuJoCo moves every mesh into its own frame of inertia; placed by it, mesh and hulls still coincide."""
    before = mujoco_model(arm)
    done = rlacd.rewrite_robot(arm, arm.with_name("out.xml"), threads=1)
    after = mujoco_model(done.path)
    for body in ("upper", "lower"):
        assert bounds_of(after, body) == pytest.approx(bounds_of(before, body), abs=1e-5)
    table_hulls, big_hulls = (len(link.files) for link in done.links)
    # "upper" keeps its collision geom for its mass, "lower" the red one to look at too, with hulls beside them.
    assert after.ngeom == before.ngeom + table_hulls + big_hulls
    assert after.geom("elbow_mass").rgba[3] == 0.0, "what stays for its mass is not drawn"
    assert int(after.geom_contype.astype(bool).sum()) == table_hulls + big_hulls + 2, "and tetrahedron and sphere"
    red = after.geom("both_visual")
    assert red.contype == red.conaffinity == 0
    assert red.rgba.tolist() == [1.0, 0.0, 0.0, 1.0]
    assert np.isfinite(fall_in_mujoco(done.path, 0.05).speed)


def bounds_of(model: Any, body: str | int) -> np.ndarray:
    points = points_of_body(model, body)
    return np.array([points.min(axis=0), points.max(axis=0)])


def geoms_of_body(model: Any, body: str | int) -> list[np.ndarray]:
    """The points of each mesh that a body collides with, in the world."""
    import mujoco

    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    own = (model.geom_bodyid == model.body(body).id) & (model.geom_dataid >= 0) & (model.geom_contype > 0)
    return [points_of_geom(model, data, geom) for geom in np.flatnonzero(own)]


def points_of_body(model: Any, body: str | int) -> np.ndarray:
    return np.concatenate(geoms_of_body(model, body))


def hulls_of_body(model: Any, body: str | int) -> list[trimesh.Trimesh]:
    return [trimesh.Trimesh(points).convex_hull for points in geoms_of_body(model, body)]


@pytest.mark.promise("robots")
def test_an_mjcf_keeps_every_byte_but_meshes_and_their_geoms(arm: Path) -> None:
    done = rlacd.rewrite_robot(arm, arm.with_name("out.xml"), threads=1)
    before, after = ARM.splitlines(), done.path.read_text().splitlines()
    changed = [line for line in difflib.ndiff(before, after) if line.startswith("- ")]
    assert [line for line in changed if 'name="elbow"' not in line and 'name="both"' not in line] == []
    new = [line[2:].strip() for line in difflib.ndiff(before, after) if line.startswith("+ ")]
    assert all(line.startswith(("<mesh ", "<geom ")) for line in new)
    assert sum(line.endswith("<!-- kept -->") for line in new) == 1
    assert "<sensor> names" not in " ".join(done.warnings)
    assert any("elbow" in warning and "<user>" in warning for warning in done.warnings)
    assert any("tetrahedron" in warning and "no file" in warning for warning in done.warnings)


def mjcf(folder: Path, assets: str, geoms: str, more: str = "") -> Path:
    """A model of one free body."""
    body = f"<worldbody><body name='b' pos='0 0 3'><freejoint/>{geoms}</body></worldbody>"
    (folder / "in.xml").write_text(f"<mujoco>{more}<asset>{assets}</asset>{body}</mujoco>")
    return folder / "in.xml"


GEOMS = "{inertial}<frame pos='1 0 0' euler='10 20 30'><geom class='c' type='mesh' mesh='t' group='{group}' {geom}/>\
</frame><geom size='0.2' density='300'/><replicate count='2' offset='1 0 0'><geom class='c' type='mesh' mesh='t'\
 pos='0 1 0' group='3'/></replicate>"
MESH = "<mesh name='t' file='table.stl' scale='1 -1 2' refpos='0.1 0 0' refquat='1 1 0 0' {asset}/>"
SETTINGS = "<compiler {compiler}/><default><default class='c'><geom {default}/></default></default>"


@pytest.mark.parametrize("group", ["0", "3"])
@pytest.mark.parametrize(
    "how",
    [
        {"geom": "mass='3'"},
        {"geom": "density='7'"},
        {"default": "mass='2'"},
        {"default": "density='40'"},
        *({"asset": f"inertia='{inertia}'"} for inertia in ("exact", "shell", "legacy", "convex")),
        {"compiler": "inertiagrouprange='0 2'"},
        {"compiler": "inertiagrouprange='3 5'"},
        {"compiler": "inertiafromgeom='true'", "inertial": "<inertial pos='0 0 0' mass='1' diaginertia='1 1 1'/>"},
        {"inertial": "<inertial pos='1 0 0' mass='1' diaginertia='1 1 1'/>"},
        {"compiler": "settotalmass='9' balanceinertia='true' boundmass='0.1' boundinertia='0.1'"},
    ],
    ids=str,
)
@pytest.mark.promise("robot-mass")
def test_no_body_changes_its_mass_centre_or_inertia(tmp_path: Path, how: dict[str, str], group: str) -> None:
    table().export(tmp_path / "table.stl")
    blank = dict.fromkeys(("compiler", "default", "asset", "inertial", "geom"), "")
    given = {**blank, **how, "group": group}
    source = mjcf(tmp_path, *(text.format(**given) for text in (MESH, GEOMS, SETTINGS)))
    done = rlacd.rewrite_robot(source, tmp_path / "out.xml", quality="fast", threads=1)
    before, after = (mujoco_model(path) for path in (source, done.path))
    assert after.ngeom > before.ngeom
    for name, size in (("body_mass", 1e-6), ("body_ipos", 1e-6)):
        assert getattr(after, name) == pytest.approx(getattr(before, name), rel=size, abs=1e-9)
    assert tensors(after) == pytest.approx(tensors(before), rel=1e-6, abs=1e-6 * before.body_inertia.max())


def tensors(model: Any) -> np.ndarray:
    """The inertia of each body along the axes of its frame."""
    turns = [trimesh.transformations.quaternion_matrix(turn)[:3, :3] for turn in model.body_iquat]
    return np.array([turn * inertia @ turn.T for turn, inertia in zip(turns, model.body_inertia, strict=True)])


HAND = """<mujoco>
<compiler angle="{angle}" eulerseq="xZy" autolimits="true"/>
<default><default class="c"><geom type="mesh" group="3" quat="1 0 0.2 0"/></default></default>
<asset><mesh name="t" file="table.stl" scale="1 -1 2" refpos="0.1 0 0" refquat="1 1 0 0"/>
<mesh name="u" file="table.stl" scale="0.5 0.5 0.5"/></asset>
<worldbody><geom class="c" mesh="u" pos="4 0 0"/><geom class="c" mesh="u" pos="5 0 0"/>
<body name="palm" pos="1 2 3" axisangle="1 2 0 {turn}"><joint/>
  <geom class="c" mesh="t" pos="0.3 0 0" density="500"/>
  <frame pos="0 1 0" euler="{turn} {turn} {turn}"><geom class="c" mesh="u" xyaxes="1 1 0 0 0 2"/></frame>
  <geom class="c" mesh="u" zaxis="1 2 -3" friction="0.1"/><!-- slippery -->
  <geom name="pad" class="c" mesh="u" pos="0 0 1"/>
  <replicate count="2" offset="2 0 0"><geom class="c" mesh="u" pos="0 3 0"/><geom class="c" mesh="u"/></replicate>
  <body euler="0 {turn} 0" pos="0 0 1"><geom class="c" mesh="u"/><geom class="c" mesh="u" pos="0.1 0 0"/></body>
</body></worldbody></mujoco>"""


@pytest.mark.parametrize(("angle", "turn"), [("degree", "20"), ("radian", "0.34906585")])
@pytest.mark.promise("robot-hulls", "robot-mass")
def test_geoms_of_a_body_become_one_solid_where_they_collide_alike(tmp_path: Path, angle: str, turn: str) -> None:
    """Placed, turned, mirrored and scaled in every way that MJCF has; compared where MuJoCo puts them."""
    table().export(tmp_path / "table.stl")
    (tmp_path / "in.xml").write_text(HAND.format(angle=angle, turn=turn))
    done = rlacd.rewrite_robot(tmp_path / "in.xml", tmp_path / "out.xml", threshold_abs=0.02, threads=1)
    before, after = mujoco_model(tmp_path / "in.xml"), mujoco_model(done.path)
    world, _, tip = done.links
    assert [len(link.results) for link in done.links] == [2, 4, 1], "world apart; slippery, named, replicated apart"
    assert (world.results[0], tip.name) == (world.results[1], "body_2")
    assert "<!-- slippery -->" in done.path.read_text()
    assert after.body_mass == pytest.approx(before.body_mass, rel=1e-6)
    assert tensors(after) == pytest.approx(tensors(before), rel=1e-6, abs=1e-6 * before.body_inertia.max())
    for body in ("palm", 2):
        assert bounds_of(after, body) == pytest.approx(bounds_of(before, body), abs=1e-5)
        corners, hulls = points_of_body(before, body), hulls_of_body(after, body)
        assert inside(hulls, corners, 1e-5).all()
    shape = trimesh.util.concatenate(tip.hulls).apply_transform(pose_of_body(after, 2))
    assert shape.bounds == pytest.approx(bounds_of(before, 2), abs=1e-5), "in Python they are in the body's frame"


def pose_of_body(model: Any, body: str | int) -> np.ndarray:
    import mujoco

    data, pose = mujoco.MjData(model), np.eye(4)
    mujoco.mj_forward(model, data)
    place = data.body(body)
    pose[:3, :3], pose[:3, 3] = place.xmat.reshape(3, 3), place.xpos
    return pose


@pytest.mark.parametrize("inertia", ["", "inertia='exact'", "inertia='convex'"])
def test_a_mesh_without_volume_compiles_once_it_is_rewritten(tmp_path: Path, inertia: str) -> None:
    trimesh.Trimesh([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]], [[0, 1, 2], [0, 2, 3]]).export(tmp_path / "flat.stl")
    weight = "<inertial pos='0 0 0' mass='1' diaginertia='1 1 1'/>"
    source = mjcf(tmp_path, f"<mesh file='flat.stl' {inertia}/>", f"{weight}<geom type='mesh' mesh='flat'/>")
    done = rlacd.rewrite_robot(source, tmp_path / "out.xml", threads=1)
    assert mujoco_model(done.path).body_mass[1] == 1.0
    assert any("no volume" in warning for warning in done.warnings)


@pytest.mark.parametrize("ending", ["dae", "ply", "stl"])
def test_a_mesh_that_mujoco_cannot_read_is_copied_for_it(tmp_path: Path, ending: str) -> None:
    table().export(tmp_path / f"table.{ending}", file_type="stl_ascii" if ending == "stl" else ending)
    asset = f"<mesh name='t' file='table.{ending}' scale='1 1 -2' inertia='exact'/>"
    source = mjcf(tmp_path, asset, "<geom type='mesh' mesh='t' density='7'/>")
    with pytest.raises(ValueError, match="decoder"):
        mujoco_model(source)
    done = rlacd.rewrite_robot(source, tmp_path / "out.xml", quality="fast", threads=1)
    assert mujoco_model(done.path).body_mass[1] == pytest.approx(table().volume * 2 * 7, rel=0.01)


def test_a_model_split_over_files_is_rewritten_into_one(tmp_path: Path) -> None:
    """Assets, defaults, settings and bodies each in a file, found from the main file's folder or from their own."""
    (tmp_path / "parts" / "meshes").mkdir(parents=True)
    table().export(tmp_path / "parts" / "table.stl")
    table().export(tmp_path / "parts" / "other.stl")
    parts = {
        "in.xml": '<mujoco>\n <!-- scene -->\n <include file="parts/robot.xml"/>'
        '\n <include file="floor.xml"/>\n</mujoco>',
        "floor.xml": '<mujocoinclude><worldbody><geom type="plane" size="1 1 1"/></worldbody></mujocoinclude>',
        "parts/robot.xml": '<?xml version="1.0"?><mujoco><!-- für --><compiler meshdir="nowhere"/>'
        '<include file="assets.xml"/><worldbody><body name="b"><freejoint/><include file="parts/body.xml"/></body>'
        "</worldbody></mujoco>",
        "parts/assets.xml": '<mujoco><compiler meshdir="."/><asset><mesh file="table.stl"/><mesh file="other.stl"/>'
        '</asset><default><default class="c"><geom mesh="table" type="mesh" mass="2"/></default></default></mujoco>',
        "parts/body.xml": '<x><geom class="c" name="g" group="3"/></x>',
    }
    for name, text in parts.items():
        (tmp_path / name).write_text(text, encoding="utf-8")
    before = mujoco_model(tmp_path / "in.xml")
    done = rlacd.rewrite_robot(tmp_path / "in.xml", tmp_path / "out.xml", threads=1)
    after = mujoco_model(done.path)
    assert after.ngeom == before.ngeom + len(done.links[0].files)
    assert after.body_mass == pytest.approx(before.body_mass)
    text = done.path.read_text(encoding="utf-8")
    assert text.startswith("<mujoco>\n <!-- scene -->\n <!-- für -->")
    assert text.endswith('\n <include file="floor.xml"/>\n</mujoco>'), "what does not change stays included"
    assert 'file="parts/other.stl"' in text, "paths of inlined files follow"
    assert {path: (tmp_path / path).read_text(encoding="utf-8") for path in parts} == parts
    (tmp_path / "floor.xml").write_text('<mujoco><include file="parts/robot.xml"/></mujoco>')
    with pytest.raises(MeshFileError, match="twice"):
        rlacd.rewrite_robot(tmp_path / "in.xml", tmp_path / "again.xml")


def test_a_model_whose_paths_are_stripped_is_rewritten_with_the_paths_that_count(tmp_path: Path) -> None:
    (tmp_path / "meshes").mkdir()
    for name in ("table", "other"):
        table().export(tmp_path / "meshes" / f"{name}.stl")
    source = mjcf(
        tmp_path,
        '<mesh file="C:\\robot/x/table.stl"/><mesh file="no/where/other.stl"/>',
        '<geom type="mesh" mesh="table"/><geom type="mesh" mesh="other" contype="0" conaffinity="0"/>',
        '<compiler strippath="true" meshdir="meshes"/>',
    )
    before = mujoco_model(source)
    done = rlacd.rewrite_robot(source, tmp_path / "out.xml", quality="fast", threads=1)
    after = mujoco_model(done.path)
    assert after.ngeom == before.ngeom + len(done.links[0].files)
    assert after.body_inertia == pytest.approx(before.body_inertia, rel=1e-6)


def test_a_robot_of_primitives_is_copied(tmp_path: Path) -> None:
    text = "<robot name='r'><link name='l'/></robot>"
    (tmp_path / "r.urdf").write_text(text)
    run = CliRunner().invoke(app, ["decompose", str(tmp_path / "r.urdf"), "-o", str(tmp_path / "out.urdf")])
    assert run.exit_code == 0, run.output
    assert "no collision mesh" in run.stderr
    assert (tmp_path / "out.urdf").read_text() == text


@pytest.mark.parametrize(
    ("name", "text", "says"),
    [
        ("r.urdf.xacro", "<robot/>", "expand its macros with"),
        ("r.sdf", "<sdf/>", "rewritten as .urdf and .xml"),
        ("r.urdf", part("filename='package:///x.stl'"), "names no package"),
        ("r.urdf", "<robot><link></robot>", "not well-formed"),
        ("r.urdf", "", "not well-formed"),
        ("r.urdf", '<robot xmlns:xacro="x"><xacro:macro name="m"/></robot>', "xacro"),
        ("r.urdf", "<sdf/>", "is not URDF: it starts with <sdf>"),
        ("r.urdf", '<?xml version="1.0" encoding="klingon"?><robot/>', "klingon|encoding"),
        ("r.urdf", part(""), "no filename"),
        *(
            ("r.urdf", part(f"filename='box.stl' scale='{scale}'"), "not three numbers other than zero")
            for scale in ("0 1 1", "a b c", "1 1", "nan nan nan", "inf 1 1", "1e999 1 1")
        ),
        ("r.urdf", part("filename='box.stl' scale='1e-320 1 1'"), "inverted"),
        (
            "r.xml",
            '<mujoco><asset><mesh name="b" file="box.stl"/></asset><worldbody><body>'
            '<geom type="mesh" mesh="b" mass="true"/></body></worldbody></mujoco>',
            "mass",
        ),
    ],
)
@pytest.mark.promise("refused")
def test_robots_that_cannot_be_rewritten_say_what_to_do(tmp_path: Path, name: str, text: str, says: str) -> None:
    (tmp_path / name).write_text(text)
    trimesh.creation.box().export(tmp_path / "box.stl")
    before = sorted(tmp_path.iterdir())
    run = CliRunner().invoke(app, ["decompose", str(tmp_path / name)])
    assert run.exit_code == 2
    assert re.search(says, " ".join(run.stderr.split())), run.stderr
    assert run.stderr.count("\n") == 1
    assert sorted(tmp_path.iterdir()) == before


@pytest.mark.parametrize(
    "reference",
    [
        "../../outside.stl",
        "{outside}",
        "file://{outside}",
        "package://r/../../outside.stl",
        "package://../outside.stl",
        "package://r/%2e%2e/%2e%2e/outside.stl",
        "package:///outside.stl",
        "..\\..\\outside.stl",
        "http://example.org/a.stl",
        "a\x7fb.stl",
        "/dev/zero",
        "pipe.stl",
        "missing.stl",
        "meshes",
    ],
)
@pytest.mark.promise("hostile-robots")
def test_a_robot_cannot_name_what_lies_outside_its_package(tmp_path: Path, reference: str) -> None:
    outside = tmp_path / "outside.stl"
    trimesh.creation.box().export(outside)
    package = tmp_path / "deep" / "r"
    (package / "meshes").mkdir(parents=True)
    (package / "package.xml").write_text("<package><name>r</name></package>")
    os.mkfifo(package / "pipe.stl")
    urdf(package, f"filename='{reference.format(outside=outside)}'")
    with pytest.raises(MeshFileError) as caught:
        rlacd.rewrite_robot(package / "r.urdf", package / "out.urdf")
    assert "\n" not in str(caught.value)
    if "outside" in reference and "package" not in reference:
        done = rlacd.rewrite_robot(package / "r.urdf", package / "out.urdf", package_dirs=[str(tmp_path)], threads=1)
        assert done.links[0].meshes == [outside], "unless the user allows it"


def test_places_are_checked_before_the_work(ear: Path, tmp_path: Path) -> None:
    with pytest.raises(OptionError, match="overwrite the input"):
        rlacd.rewrite_robot(ear, ear)
    with pytest.raises(OptionError, match=r"another \.urdf"):
        rlacd.rewrite_robot(ear, tmp_path / "out.xml")
    (tmp_path / "out_urdf").write_text("mine")
    with pytest.raises(OutputError, match="it is a file"):
        rlacd.rewrite_robot(ear, tmp_path / "out.urdf")
    with pytest.raises(MeshFileError, match="is not a robot"):
        rlacd.rewrite_robot(ear.parent / "meshes" / "table.stl", tmp_path / "out.stl")
    with pytest.raises(OptionError, match="threshold"):
        rlacd.rewrite_robot(ear, tmp_path / "out2.urdf", threshold=-1.0)
    with pytest.raises(OptionError, match="unit"):
        rlacd.rewrite_robot(ear, tmp_path / "mm.urdf", unit="mm")
