"""Robots that are refused: in one sentence, before any work, and without a look at what lies outside."""

from __future__ import annotations

import os
import re
from pathlib import Path

import pytest
import trimesh
from click.testing import CliRunner

import rlacd
from rlacd.cli.main import app
from rlacd.errors import MeshFileError, OptionError, OutputError
from tests.io.urdf_files import part, urdf, write_ear


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
        ("r.urdf", "<!DOCTYPE robot><robot/>", r"^rlacd: \S+ has a document type \(<!DOCTYPE>\)"),
        ("r.xml", "<!DOCTYPE mujoco><mujoco/>", r"^rlacd: \S+ has a document type \(<!DOCTYPE>\)"),
        (
            "r.urdf",
            '<robot><link name="a"/><joint name="j" type="fixed"><parent link="a"/><child link="b"/></joint></robot>',
            "the joint j of .* names the link b, which is not in the file",
        ),
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


def test_places_are_checked_before_the_work(tmp_path: Path) -> None:
    ear = write_ear(tmp_path)
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
