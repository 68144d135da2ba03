"""Rewriting MJCF: MuJoCo finds hulls where the meshes were, the same masses, and every other byte."""

from __future__ import annotations

import difflib
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import trimesh

import rlacd
from rlacd.errors import MeshFileError
from rlacd.io.robots.read import read_robot
from rlacd.io.robots.robot import turned
from tests.assets import png
from tests.models import fall_in_mujoco, inside, mujoco_model, points_of_geom, table

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


@pytest.mark.parametrize("seed", range(6))
def test_primitives_are_where_mujoco_puts_them(tmp_path: Path, seed: int) -> None:
    """Of random kinds, sizes and places, stated in every way: by classes, within frames, from one end to the other."""
    pytest.importorskip("mujoco", reason="the extra sim is not installed")
    rng = np.random.default_rng(seed)
    kinds = ["box", "sphere", "capsule", "cylinder", "ellipsoid"]

    def numbers(count: int) -> str:
        return " ".join(map(repr, rng.normal(size=count).round(3).tolist()))

    def turned() -> str:
        ways = {"quat": 4, "axisangle": 4, "xyaxes": 6, "zaxis": 3, "euler": 3}
        way = rng.choice([*ways, "none"])
        return "" if way == "none" else f'{way}="{numbers(ways[way])}"'

    def geom() -> str:
        kind, size = rng.choice(kinds), " ".join(map(str, rng.uniform(0.1, 1, 3).round(3)))
        how = rng.choice(["", 'class="c"', 'class="d"', 'contype="0"', 'contype="0" conaffinity="0"'])
        if kind != "sphere" and rng.random() < 0.3:
            return f'<geom type="{kind}" size="{size.split()[0]}" fromto="{numbers(6)}" class="e"/>'
        own = f'<geom type="{kind}" size="{size}" pos="{numbers(3)}" {turned()} {how}/>'
        return own if rng.random() < 0.5 else f'<frame pos="{numbers(3)}" {turned()}>{own}</frame>'

    def body(depth: int) -> str:
        inner = "".join(body(depth - 1) for _ in range(2)) if depth else ""
        return f'<body pos="{numbers(3)}" {turned()}><joint/>{"".join(geom() for _ in range(3))}{inner}</body>'

    given = """<default><geom friction="1"/><default class="c"><geom size=".3 .3 .3" zaxis="1 2 3"/></default>
    <default class="d"><geom contype="0" conaffinity="0"/></default><default class="e"/></default>"""
    (tmp_path / "r.xml").write_text(f"<mujoco>{given}<worldbody>{geom()}{body(3)}</worldbody></mujoco>")
    robot = read_robot(tmp_path / "r.xml")
    motion = robot.motion(0, 0)
    assert list(motion.links) == [one.name for one in robot.bodies], "all that MuJoCo finds to collide"
    for one, pose, own in zip(robot.bodies, motion.poses[0], motion.solids, strict=True):
        assert pose == pytest.approx(one.pose, abs=1e-6)
        both = [sorted(each, key=lambda p: (p.kind, *p.sizes.round(9))) for each in (one.primitives, own.primitives)]
        for ours, theirs in zip(*both, strict=True):
            assert ours.kind == theirs.kind
            assert ours.sizes == pytest.approx(theirs.sizes)
            assert np.abs(ours.place - theirs.place).max() < 1e-6


BARE = """<mujoco><default><default class="v"><geom type="mesh" contype="0" conaffinity="0" group="2"/></default>
</default><asset><mesh name="t" file="table.stl"/><mesh name="u" file="table.stl" scale="0.5 0.5 0.5"/></asset>
<worldbody><geom class="v" mesh="t"/>
<body name="a"><joint range="-1 1" limited="true"/><geom name="n" class="v" mesh="t"/>
  <geom class="v" mesh="u" pos="0 0 1"/>
  <frame pos="0 0 2"><geom name="ball" class="v" type="sphere" size=".1"/></frame>
  <body name="b" pos="0 0 4"><joint range="-1 1" limited="true"/><geom type="sphere" size=".1"/>
    <geom class="v" mesh="t"/></body>
</body></worldbody></mujoco>"""


def test_bodies_none_of_whose_geoms_collides_get_hulls_of_what_they_show(tmp_path: Path) -> None:
    mujoco = pytest.importorskip("mujoco", reason="the extra sim is not installed")
    table().export(tmp_path / "table.stl")
    (tmp_path / "in.xml").write_text(BARE)
    done = rlacd.rewrite_robot(tmp_path / "in.xml", tmp_path / "out.xml", from_visual=True, threads=1, samples=20)
    assert [(link.name, link.primitives) for link in done.links] == [("a", 1), ("b", 1)]
    assert [(pair.first, pair.second, pair.adjacent, pair.loose) for pair in done.pairs] == [("a", "b", True, False)]
    before, after = mujoco_model(tmp_path / "in.xml"), mujoco_model(done.path)
    assert after.body_mass == pytest.approx(before.body_mass, rel=1e-6)
    collide = [(model.geom_contype | model.geom_conaffinity) != 0 for model in (before, after)]
    count = len(done.links[0].hulls)
    assert [flags.sum() for flags in collide] == [1, 1 + count + 1]
    new = after.geom_bodyid[collide[1]]
    assert (new == after.body("a").id).sum() == count + 1
    names = [mujoco.mj_id2name(after, mujoco.mjtObj.mjOBJ_GEOM, g) for g in range(after.ngeom)]
    assert {"n", "n_000", "ball", "ball_collision"} <= {*names}
    shown = [(model.geom_group < 3).sum() for model in (before, after)]
    assert shown[0] == shown[1]
    corners = []
    for model, chosen in ((before, before.geom_bodyid == before.body("a").id), (after, collide[1])):
        data = mujoco.MjData(model)
        mujoco.mj_forward(model, data)
        meshes = np.flatnonzero(chosen & (model.geom_type == mujoco.mjtGeom.mjGEOM_MESH))
        corners.append([points_of_geom(model, data, geom) for geom in meshes])
    hulls = [trimesh.convex.convex_hull(points) for points in corners[1]]
    assert inside(hulls, np.concatenate(corners[0]), 1e-5).all()


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


TURNS = {"quat": 4, "euler": 3, "axisangle": 4, "xyaxes": 6, "zaxis": 3}


def random_model(rng: np.random.Generator) -> str:
    """Nested classes, bodies and frames, each placed and turned in some way or none, with geoms of one mesh."""

    def placed() -> str:
        way = rng.choice([*TURNS, ""])
        turn = f' {way}="{" ".join(map(str, rng.normal(size=TURNS[way]).round(3)))}"' if way else ""
        return f'pos="{" ".join(map(str, rng.normal(size=3).round(3)))}"{turn}' if rng.random() < 0.6 else turn

    def said() -> str:
        flags = [f'{name}="{rng.integers(2)}"' for name in ("contype", "conaffinity") if rng.random() < 0.3]
        return " ".join([placed(), *flags, "type='mesh'" if rng.random() < 0.5 else ""])

    def content(depth: int) -> str:
        text = ""
        for tag in rng.choice(["geom", "geom", "body", "frame"], rng.integers(1, 4)):
            known = f' childclass="{rng.choice(["a", "b", "c"])}"' if rng.random() < 0.4 and tag != "geom" else ""
            own = f' class="{rng.choice(["a", "b", "c"])}"' if rng.random() < 0.4 else ""
            if tag == "geom":
                text += f'<geom mesh="m" {own} {said()}/>'
            elif depth < 3:
                mass = '<inertial pos="0 0 0" mass="1" diaginertia="1 1 1"/>' if tag == "body" else ""
                text += f"<{tag} {placed()}{known}>{mass}{content(depth + 1)}</{tag}>"
        return text

    angle, order = rng.choice(["radian", "degree"]), "".join(rng.choice([*"xyzXYZ"], 3))
    classes = f'<default class="a"><geom {said()}/><default class="b"><geom {said()}/></default></default>'
    return f"""<mujoco><compiler angle="{angle}" eulerseq="{order}"/><default><geom {said()}/>{classes}
    <default class="c"><geom {said()}/></default></default>
    <asset><mesh name="m" file="m.obj" refpos="0.1 0 0"/></asset><worldbody>{content(0)}</worldbody></mujoco>"""


@pytest.mark.promise("robot-hulls")
def test_meshes_are_placed_as_mujoco_places_them(tmp_path: Path) -> None:
    """Of 300 random models: how many collide in each body, and how they are turned."""
    mujoco = pytest.importorskip("mujoco", reason="extra sim")
    trimesh.creation.box((0.2, 0.4, 0.8)).export(tmp_path / "m.obj")
    rng, compared = np.random.default_rng(0), 0
    for _ in range(300):
        (tmp_path / "r.xml").write_text(random_model(rng))
        model = mujoco_model(tmp_path / "r.xml")
        data = mujoco.MjData(model)
        mujoco.mj_forward(model, data)
        expected: dict[str, list[Any]] = {}
        is_mesh = model.geom_type == mujoco.mjtGeom.mjGEOM_MESH
        for geom in np.flatnonzero(is_mesh & ((model.geom_contype | model.geom_conaffinity) > 0)).tolist():
            body = int(model.geom_bodyid[geom])
            name = f"body_{body}" if body else "world"
            expected.setdefault(name, []).append(np.ptp(points_of_geom(model, data, geom), axis=0))
        robot = read_robot(tmp_path / "r.xml", apart=True)
        found = {
            body.name: [
                np.ptp(turned(body.pose, turned(each.meshes[0].to_body, each.mesh())).vertices, axis=0)
                for each in body.colliders
            ]
            for body in robot.bodies
        }
        assert found.keys() == expected.keys()
        for name, sizes in expected.items():
            assert np.sort(found[name], axis=0) == pytest.approx(np.sort(sizes, axis=0), abs=1e-4)
            compared += len(sizes)
    assert compared > 500


def test_pairs_of_geoms_collide_as_all_their_hulls(tmp_path: Path) -> None:
    """Geoms of no contact type collide only with those that a pair names."""
    mujoco = pytest.importorskip("mujoco", reason="extra sim")
    table().export(tmp_path / "table.stl")
    ball, off = (
        '<body name="ball" pos="{} 0.02 0.5"><freejoint/><geom name="ball" size="0.02"{}/></body>',
        ' contype="0"',
    )
    geom = f'<geom name="t" type="mesh" mesh="t"{off} conaffinity="0"/>'
    (tmp_path / "in.xml").write_text(
        f"""<mujoco><asset><mesh name="t" file="table.stl"/></asset><worldbody><body name="table">{geom}</body>
        {ball.format(0.02, f"{off} conaffinity='0'")}</worldbody>
        <contact><pair name="p" geom1="ball" geom2="t" condim="1"/></contact></mujoco>"""
    )
    done = rlacd.rewrite_robot(tmp_path / "in.xml", tmp_path / "out.xml", threshold_abs=0.01, threads=1)
    before, after = (mujoco_model(path) for path in (tmp_path / "in.xml", done.path))
    assert (before.npair, after.npair) == (1, len(done.links[0].hulls)) == (1, 5)
    assert set(after.pair_dim) == {1}
    assert not [warning for warning in done.warnings if "<pair>" in warning]
    for model in (before, after):
        data = mujoco.MjData(model)
        data.qpos[2] = 0.205
        mujoco.mj_forward(model, data)
        assert data.ncon > 0


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


@pytest.mark.parametrize("strip", ["false", "true"])
def test_a_model_that_is_written_elsewhere_finds_its_files(tmp_path: Path, strip: str) -> None:
    """Meshes, height fields, pictures and included files, in their folders or beside the file that names them."""
    for folder in ("in/meshes", "in/looks", "in/parts", "out"):
        (tmp_path / folder).mkdir(parents=True)
    near = "parts" if strip == "false" else "meshes"  # stripped names are looked for in the folder of meshes only
    for name in ("meshes/table.stl", "meshes/seen.stl", f"{near}/near.stl"):
        table().export(tmp_path / "in" / name)
    for name in ("looks/wood.png", "looks/side.png", "meshes/hills.png"):
        (tmp_path / "in" / name).write_bytes(png())
    sides = " ".join(f'file{side}="side.png"' for side in ("right", "left", "up", "down", "front", "back"))
    parts = {
        "in.xml": f'<mujoco><compiler meshdir="meshes" texturedir="looks" strippath="{strip}"/><asset>'
        f'<mesh file="table.stl"/><mesh file="seen.stl"/><texture name="sky" type="skybox" {sides}/>'
        '<texture name="wood" type="2d" file="wood.png"/><hfield name="hills" file="hills.png" size="1 1 1 1"/></asset>'
        '<include file="parts/plain.xml"/><include file="parts/outer.xml"/></mujoco>',
        "parts/plain.xml": "<mujoco><option timestep='0.004'/></mujoco>",
        "parts/outer.xml": '<mujoco><include file="inner.xml"/><worldbody><geom type="hfield" hfield="hills"/>'
        '<body name="b"><freejoint/><geom type="mesh" mesh="table"/>'
        '<geom type="mesh" mesh="seen" contype="0" conaffinity="0"/></body></worldbody></mujoco>',
        "parts/inner.xml": '<mujoco><asset><mesh file="near.stl"/></asset><worldbody><body name="c"><freejoint/>'
        '<geom type="mesh" mesh="near"/></body></worldbody></mujoco>',
    }
    for name, text in parts.items():
        (tmp_path / "in" / name).write_text(text)
    before = mujoco_model(tmp_path / "in" / "in.xml")
    done = rlacd.rewrite_robot(tmp_path / "in" / "in.xml", tmp_path / "out" / "out.xml", samples=0, threads=1)
    after = mujoco_model(done.path)
    assert after.ngeom == before.ngeom + sum(len(link.files) for link in done.links)
    assert after.opt.timestep == 0.004
    for what in ("tex_data", "hfield_data"):
        assert (getattr(after, what) == getattr(before, what)).all()
    assert after.body_inertia == pytest.approx(before.body_inertia, rel=1e-6)
    again = rlacd.rewrite_robot(done.path, tmp_path / "again.xml", package_dirs=[str(tmp_path)], threads=1)
    assert mujoco_model(again.path).ngeom >= after.ngeom


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
