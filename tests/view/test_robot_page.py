"""Robots in the viewer and in the report: joints move links as yourdfpy and MuJoCo do, and links that touch are red."""

from __future__ import annotations

import pickle
import re
import tempfile
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import trimesh

import rlacd
from rlacd.clear import mjcf_motion, urdf_motion
from rlacd.io.robots.viewed import USUAL, decompose_viewed, read_viewed
from rlacd.plain_json import to_json
from rlacd.viewer.robot import RobotResult
from rlacd.viewer.scene import scene
from rlacd.viewer.server import ViewServer
from tests.view.test_pages_in_browser import Watched, browser, change, driver, open_page, pixels, settle, watched
from tests.view.viewing import ask, open_viewer

pytest.importorskip("coal", reason="the extra clear is not installed")
pytest.importorskip("yourdfpy", reason="the extra clear is not installed")
pytest.importorskip("mujoco", reason="the extra clear is not installed")

__all__ = ["browser", "driver"]

LINK = '<link name="{}"><collision><geometry><mesh filename="box.obj" scale="{}"/></geometry></collision></link>'
URDF = f"""<robot name="press">
{LINK.format("base", "2 2 0.2")}{LINK.format("post", "0.2 0.2 0.2")}{LINK.format("ram", "0.4 0.4 0.4")}
{LINK.format("flag", "0.1 0.4 0.1")}<link name="eye"/>
<joint name="turn" type="revolute"><parent link="base"/><child link="post"/><origin xyz="0.3 0 1.2" rpy="0.1 0.2 0.3"/>
  <axis xyz="0 1 3"/><limit lower="-1" upper="2" effort="1" velocity="1"/></joint>
<joint name="drop" type="prismatic"><parent link="post"/><child link="ram"/><origin xyz="0 0.5 0"/>
  <axis xyz="0 0 -1"/><limit lower="0" upper="1.2" effort="1" velocity="1"/></joint>
<joint name="wave" type="continuous"><parent link="ram"/><child link="flag"/><origin xyz="0 0.6 0"/><axis xyz="1 0 0"/>
  <mimic joint="turn" multiplier="-2" offset="0.5"/></joint>
<joint name="see" type="fixed"><parent link="ram"/><child link="eye"/></joint>
</robot>"""
MJCF = """<mujoco><asset><mesh name="m" file="box.obj"/></asset><worldbody><geom type="mesh" mesh="m" pos="0 0 -3"/>
<body name="a" pos="0 0 1" euler="10 20 30"><geom type="mesh" mesh="m"/>
  <joint name="x" axis="1 0 0" pos="0.1 0 0.2" range="-90 90" ref="20"/>
  <joint name="y" type="slide" axis="0 1 1" range="-1 1"/>
  <joint axis="0 0 1" range="-50 50"/>
  <body name="b" pos="0 2 0"><joint name="q" axis="0 1 1"/><geom type="mesh" mesh="m"/></body></body></worldbody>
<equality><joint joint1="q" joint2="x" polycoef="0.1 1.5 0.2 0 0"/></equality></mujoco>"""


@pytest.fixture(scope="module")
def robots(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("robots")
    trimesh.creation.box().export(folder / "box.obj")
    (folder / "press.urdf").write_text(URDF)
    (folder / "arm.xml").write_text(MJCF)
    return folder


def open_robot(path: Path) -> Any:
    options = {**USUAL, "quality": "fast"}
    return open_viewer(path, options, decompose=decompose_viewed, read=read_viewed, port=0)


@pytest.fixture
def press(robots: Path) -> Iterator[ViewServer]:
    with open_robot(robots / "press.urdf") as viewer:
        yield viewer


@pytest.fixture
def seen(press: ViewServer, browser: Any) -> Iterator[Watched]:
    with watched(browser, press) as seen:
        yield seen


MATRICES = """async ([robot, scale, rows]) => {
  const { jointMatrices } = await import("page/joints");
  const one = (matrices, joint) => (matrices[joint] ?? new THREE.Matrix4()).elements;
  return rows.map((row) => robot.links.map(({ joint }) => [...one(jointMatrices(robot, row, scale), joint)]));
}"""


@pytest.mark.slow
@pytest.mark.parametrize("name", ["press.urdf", "arm.xml"])
def test_joints_move_links_as_the_robots_own_kinematics_do(seen: Watched, robots: Path, name: str) -> None:
    robot = decompose_viewed(robots / name, **USUAL, quality="fast", threads=1)
    assert isinstance(robot, RobotResult)
    shown = scene(robot)
    read = urdf_motion if name.endswith("urdf") else mjcf_motion
    motion = read(robots / name, 20, seed=1, links=robot.links)
    given = [shown["robot"], shown["scale"], motion.positions.tolist()]
    moved = np.array(seen.page.evaluate(MATRICES, given)).reshape(21, len(robot.links), 4, 4).swapaxes(2, 3)
    corners, frame = trimesh.creation.box().vertices, 1.0 / shown["scale"]
    middle = np.concatenate([robot.source.vertices, *(hull.vertices for hull in robot.hulls)])
    middle = (middle.min(axis=0) + middle.max(axis=0)) / 2
    for row, poses in zip(moved, motion.poses, strict=True):
        for matrix, pose, rest in zip(row, poses, motion.poses[0], strict=True):
            expected = trimesh.transform_points(corners, pose)
            at_rest = (trimesh.transform_points(corners, rest) - middle) / frame
            assert trimesh.transform_points(at_rest, matrix) * frame + middle == pytest.approx(expected, abs=1e-6)


@pytest.mark.slow
def test_a_link_that_is_driven_into_another_turns_red(seen: Watched) -> None:
    page = seen.page
    assert page.title() == "press: 4 hulls"
    assert page.locator("#joints input").count() == 2, "the third follows the first"
    assert "No links touch here" in page.locator("#contacts").inner_text()
    plain = pixels(page)
    page.locator("#joint-1").focus()
    page.keyboard.press("End")
    page.wait_for_selector("#contacts b")
    settle(page)
    assert page.locator("#contacts span").first.inner_text() == "base and ram, as in the input"
    red = pixels(page)
    assert (
        (red[..., 0] > red[..., 1:3].sum(axis=2) + 60).mean()
        > 0.02
        > (plain[..., 0] > plain[..., 1:3].sum(axis=2) + 60).mean()
    )
    page.click("#rest")
    settle(page)
    assert change(plain, pixels(page)) < 0.01
    page.set_viewport_size({"width": 390, "height": 800})
    settle(page)
    assert page.evaluate("document.documentElement.scrollWidth") <= 390
    assert page.locator("#criterion input[value=navigable]").is_disabled()
    assert page.locator("button[data-format=mjcf]").is_hidden()


def test_the_server_tells_contacts_of_joint_positions_only(press: ViewServer) -> None:
    for state in press.session.changes():
        if state is not None and state.run is not None:
            break
    assert ask(press, "POST", "/touching", {"values": [0, 1.2]}).json["contacts"][0] == [0, 2, "as in the input"]
    assert ask(press, "POST", "/touching", {"values": [0, 0.5]}).json == {"contacts": []}
    for bad in ({}, {"values": [0]}, {"values": [0, "1"]}, {"values": {"turn": 1}}):
        assert ask(press, "POST", "/touching", bad).status == 400
    refused = ask(press, "GET", "/download?format=mjcf")
    assert refused.status == 400
    assert "copy the command" in refused.json["error"]
    command = ask(press, "POST", "/command", {**USUAL, "quality": "fast"}).json["command"]
    assert command.startswith(f"rlacd decompose {press.subject.path} --criterion distance --threshold 0.03")
    assert command.endswith("-o press_hulls.urdf")


@pytest.mark.slow
def test_the_report_of_a_robot_shows_the_worst_positions(robots: Path, browser: Any, tmp_path: Path) -> None:
    done = rlacd.rewrite_robot(robots / "press.urdf", tmp_path / "out.urdf", samples=60, quality="fast", threads=1)
    report = pickle.loads(pickle.dumps(done)).save_report(tmp_path / "press.html")
    with open_page(browser) as watched:
        page = watched.page
        page.goto(report.as_uri())
        page.wait_for_selector("body[data-ready]")
        places = page.locator("#place option").all_inner_texts()[1:]
        assert places[0] == "At rest"
        assert any(place.startswith("base and ram: at ") for place in places)
        page.select_option("#place", label=next(place for place in places if place.startswith("base and ram")))
        assert "base and ram, as in the input" in page.locator("#contacts").inner_text()
        page.locator("#joint-0").focus()
        page.keyboard.press("ArrowRight")
        assert "61 positions were looked at" in page.locator("#contacts").inner_text()
        assert watched.complaints == []
        assert watched.outside(report.as_uri()) == []
    assert '"links"' in to_json(done.as_dict())


def test_primitives_are_drawn_beside_the_hulls(robots: Path) -> None:
    """Those of a link with meshes, and a link that has nothing else; with their links they move and turn red."""
    ball = '<collision><origin xyz="0 0 {}"/><geometry><sphere radius="0.3"/></geometry></collision>'
    text = URDF.replace('<link name="ram"><coll', f'<link name="ram">{ball.format(0.5)}<coll')
    path = robots / "fingers.urdf"
    path.write_text(text.replace('<link name="eye"/>', f'<link name="eye">{ball.format(-2)}</link>'))
    robot = decompose_viewed(path, **USUAL, quality="fast", threads=1)
    assert isinstance(robot, RobotResult)
    shown = scene(robot)
    assert [shown["robot"]["links"][each["link"]]["name"] for each in shown["kept"]] == ["ram", "eye"]
    assert len(shown["input"]) == len(robot.links) == 5
    motion = urdf_motion(path, 0, links=robot.links)
    for name, height, own in zip(robot.links, (0, 0, 0.5, 0, -2), robot.kept, strict=True):
        middle = trimesh.transform_points([[0, 0, height]], motion.poses[0, robot.links.index(name)])[0]
        for mesh in own:
            away = np.linalg.norm(mesh.vertices - middle, axis=1)
            assert 0.3 - 1e-9 <= away.min() <= away.max() < 0.32


def test_a_robot_without_collision_meshes_is_refused(robots: Path) -> None:
    (robots / "bare.urdf").write_text('<robot name="r"><link name="a"/></robot>')
    with pytest.raises(rlacd.MeshError, match=r"has no collision mesh, so there is nothing to show\."):
        read_viewed(robots / "bare.urdf")


@pytest.mark.parametrize(
    "reference", ["../{}", "meshes/../../{}", "/{}", "file:///{}", "package://{}", "package://all/{}"]
)
@pytest.mark.promise("hostile-robots")
def test_an_uploaded_robot_names_files_of_its_own_folder_only(
    press: ViewServer, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, reference: str
) -> None:
    """The folder of all temporary files is named all, and holds a package."""
    folder = tmp_path / "all"
    (folder / "mine").mkdir(parents=True)
    (folder / "mine" / "package.xml").write_text("<package><name>mine</name></package>")
    trimesh.creation.box().export(folder / "mine" / "secret.stl")
    monkeypatch.setattr(tempfile, "tempdir", str(folder))
    named = reference.format("mine/secret.stl")
    if reference.startswith(("/", "file")):
        named = named.replace("mine/", f"{folder}/mine/".lstrip("/"))
    mesh = f"<mesh filename='{named}'/>"
    text = f"<robot name='r'><link name='l'><collision><geometry>{mesh}</geometry></collision></link></robot>"
    headers = {"Content-Type": "application/octet-stream"}
    answer = ask(press, "POST", "/open?name=r.urdf", text.encode(), **headers)
    assert answer.status == 400
    assert re.search("outside of|was not found", answer.json["error"])
