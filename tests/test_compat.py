"""Stand-ins: called as the originals are, they give what the originals give, as far as a program can tell."""

from __future__ import annotations

import inspect
import re
import shutil
import subprocess
import sys
import warnings
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import trimesh

import rlacd
from rlacd.compat import UnusedOptionWarning
from rlacd.compat import coacd as our_coacd
from rlacd.compat.pybullet import vhacd
from rlacd.compat.trimesh import convex_decomposition
from rlacd.compat.vhacd import compute_vhacd
from rlacd.errors import MeshDataError, OptionError
from tests.hulls import assert_convex_hull
from tests.models import table


@pytest.fixture(autouse=True)
def nothing_said_yet(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("rlacd.compat._WARNED", set())


def triangles_with_threes(mesh: trimesh.Trimesh) -> np.ndarray:
    return np.column_stack([np.full(len(mesh.faces), 3), mesh.faces]).ravel()


# --- CoACD ------------------------------------------------------------------------------------------------------------


@pytest.mark.promise("drop-in")
def test_run_coacd_has_the_originals_signature() -> None:
    coacd = pytest.importorskip("coacd", reason="the group bench is not installed")
    theirs, ours = (inspect.signature(function).parameters for function in (coacd.run_coacd, our_coacd.run_coacd))
    assert [(p.name, p.default) for p in ours.values()] == [(p.name, p.default) for p in theirs.values()]


@pytest.mark.slow
def test_run_coacd_gives_the_originals_kind_of_result() -> None:
    coacd = pytest.importorskip("coacd", reason="the group bench is not installed")
    mesh = table()
    coacd.set_log_level("error")
    our_coacd.set_log_level("error")
    theirs = coacd.run_coacd(coacd.Mesh(mesh.vertices, mesh.faces), threshold=0.1)
    for given in (coacd.Mesh(mesh.vertices, mesh.faces), our_coacd.Mesh(mesh.vertices, mesh.faces)):
        ours = our_coacd.run_coacd(given, threshold=0.1)
        assert type(ours) is type(theirs)
        assert [type(part) for part in ours[0]] == [type(part) for part in theirs[0]]
        assert [part.dtype for part in ours[0]] == [part.dtype for part in theirs[0]]
        assert len(ours) <= len(theirs)
        for vertices, faces in ours:
            assert_convex_hull(trimesh.Trimesh(vertices, faces, process=False))


def test_options_of_coacd_that_mean_something_are_obeyed() -> None:
    ball = trimesh.creation.icosphere(subdivisions=3)
    mesh = our_coacd.Mesh(ball.vertices, ball.faces)
    with warnings.catch_warnings():
        warnings.simplefilter("error", UnusedOptionWarning)
        ((vertices, _),) = our_coacd.run_coacd(mesh, decimate=True, max_ch_vertex=40, threshold=0.2)
        assert len(vertices) <= 40
        four = our_coacd.Mesh(table().vertices, table().faces)
        assert len(our_coacd.run_coacd(four, max_convex_hull=3)) <= 3
        assert len(our_coacd.run_coacd(four, threshold=0.15, real_metric=True)) < len(our_coacd.run_coacd(four))
        for vertices, faces in our_coacd.run_coacd(four, apx_mode="box"):
            box = trimesh.Trimesh(vertices, faces, process=False)
            assert box.volume == pytest.approx(np.prod(box.extents))
    with pytest.raises(OptionError, match="apx_mode"):
        our_coacd.run_coacd(four, apx_mode="sphere")


def test_options_without_meaning_are_reported_once_each() -> None:
    mesh = our_coacd.Mesh(table().vertices, table().faces)
    given: dict[str, Any] = {"mcts_iterations": 500, "preprocess_mode": "off", "pca": True}
    with pytest.warns(UnusedOptionWarning) as said:
        our_coacd.run_coacd(mesh, **given)
    assert sorted(str(warning.message).split()[3].rstrip(":") for warning in said) == sorted(given)
    assert {warning.filename for warning in said} == {__file__}, "it points to the caller's line"
    with warnings.catch_warnings():
        warnings.simplefilter("error", UnusedOptionWarning)
        our_coacd.run_coacd(mesh, **given)


@pytest.mark.promise("drop-in")
def test_the_command_has_the_originals_flags() -> None:
    pytest.importorskip("coacd", reason="the group bench is not installed")
    theirs, ours = (
        subprocess.run([*command, "--help"], capture_output=True, text=True).stdout
        for command in (
            [shutil.which("coacd") or pytest.skip("its command is not installed")],
            [sys.executable, "-m", "rlacd.compat.coacd"],
        )
    )
    flags = [set(re.findall(r"(?<![\w-])--?[a-z][a-z-]*", text)) for text in (theirs, ours)]
    assert flags[0] <= flags[1] or not flags[0]
    assert {"-t", "--threshold", "-c", "-mi", "--split"} <= flags[1]


def test_the_command_writes_a_hull_an_object_and_says_what_has_no_effect(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    table().export(tmp_path / "in.obj")
    place = tmp_path / "new" / "out.obj"
    words = ["-i", str(tmp_path / "in.obj"), "-o", str(place), "-t", "0.1", "-c", "3", "--split"]
    with pytest.warns(UnusedOptionWarning, match="mcts_iterations"):
        our_coacd.main([*words, "-mi", "200"])
    parts = sorted((tmp_path / "new" / "out_parts").iterdir())
    assert len(parts) <= 3
    assert place.read_text().count("\no ") == len(parts)
    for more, says in (
        (["-i", "nowhere.obj"], "nowhere.obj does not exist"),
        (["-o", "x.xyz"], "must end in .obj"),
        (["-d", "-dt", "3"], "max_ch_vertex is 3"),
    ):
        with pytest.raises(SystemExit):
            our_coacd.main([*words, *more])
        assert says in capsys.readouterr().err


# --- V-HACD and trimesh -----------------------------------------------------------------------------------------------


@pytest.mark.promise("drop-in")
def test_compute_vhacd_has_the_originals_signature() -> None:
    vhacdx = pytest.importorskip("vhacdx", reason="the group bench is not installed")
    ours = inspect.signature(compute_vhacd).parameters
    said = vhacdx.compute_vhacd.__doc__.splitlines()[0]
    position = 0
    for parameter in ours.values():
        written = parameter.name if parameter.default is parameter.empty else f"{parameter.name}: "
        position = said.index(written, position)
        if parameter.default is not parameter.empty:
            default = said[position:].split(" = ", 1)[1].split(", ")[0].split(")")[0]
            assert default == repr(parameter.default)
    assert said.count(" = ") == sum(p.default is not p.empty for p in ours.values())


def test_compute_vhacd_gives_the_originals_kind_of_result() -> None:
    vhacdx = pytest.importorskip("vhacdx", reason="the group bench is not installed")
    mesh = table()
    faces = triangles_with_threes(mesh).astype(np.uint32)
    theirs = vhacdx.compute_vhacd(mesh.vertices, faces, maxConvexHulls=6, resolution=10_000)
    ours = compute_vhacd(mesh.vertices, faces, maxConvexHulls=6)
    assert len(ours) <= 6
    assert type(ours) is type(theirs)
    assert type(ours[0]) is type(theirs[0])
    assert [part.dtype for part in ours[0]] == [part.dtype for part in theirs[0]]
    assert ours[0][1].shape[1] == theirs[0][1].shape[1] == 3
    for vertices, triangles in ours:
        assert_convex_hull(trimesh.Trimesh(vertices, triangles.astype(np.int64), process=False))


def test_all_forms_of_faces_are_taken() -> None:
    """Rows, and what vhacdx takes and what its README promises: numbers with a 3 before each triangle, or without."""
    mesh = table()
    forms = mesh.faces, triangles_with_threes(mesh), np.array(mesh.faces, dtype=np.uint32).ravel()
    rows, *flat = (compute_vhacd(mesh.vertices, faces) for faces in forms)
    for other in flat:
        assert all(np.array_equal(a, b) for (a, _), (b, _) in zip(rows, other, strict=True))
    with pytest.raises(MeshDataError, match="triangulate"):
        compute_vhacd(mesh.vertices, [4, 0, 1, 2, 3])


def test_trimesh_uses_rlacd_where_it_is_put(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(trimesh.decomposition, "convex_decomposition", convex_decomposition)
    mesh = table()
    parts = mesh.convex_decomposition(threshold=0.1)
    want = rlacd.decompose(mesh, threshold=0.1)
    assert len(parts) == len(want)
    assert all(isinstance(part, trimesh.Trimesh) and part.is_convex for part in parts)
    assert len(mesh.convex_decomposition(maxConvexHulls=3)) <= 3
    with pytest.warns(UnusedOptionWarning, match="resolution"):
        mesh.convex_decomposition(resolution=1000)


# --- PyBullet ---------------------------------------------------------------------------------------------------------


def test_vhacd_has_the_originals_parameters_in_their_order(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """PyBullet has no signature, but its log tells what it was given by position."""
    pybullet = pytest.importorskip("pybullet", reason="the extra sim is not installed")
    monkeypatch.chdir(tmp_path)
    trimesh.creation.box().export("in.obj")
    given = {name: p.default for name, p in inspect.signature(vhacd).parameters.items() if p.default is not p.empty}
    logged = {
        **{"concavity": "max. concavity", "alpha": "alpha", "beta": "beta", "gamma": "gamma"},
        **{"minVolumePerCH": "min. volume to add vertices to convex-hulls", "resolution": "resolution"},
        **{"maxNumVerticesPerCH": "max. vertices per convex-hull", "depth": "max. depth", "mode": "mode"},
        **{"planeDownsampling": "plane down-sampling", "convexhullDownsampling": "convex-hull down-sampling"},
        **{"pca": "pca", "convexhullApproximation": "convex-hull approximation"},
    }
    changed = {"resolution": 10_000, "depth": 7, "planeDownsampling": 3, "pca": 1, "alpha": 0.02}
    client = pybullet.connect(pybullet.DIRECT)
    for values in (given, given | changed):
        words = ("in.obj", "out.obj", "log.txt")
        pybullet.vhacd(*words, *([] if values is given else [*values.values()][:-1]), physicsClientId=client)
        text = Path("log.txt").read_text()
        found = {name: re.search(rf"\t {re.escape(word)}\s+(\S+)\n", text) for name, word in logged.items()}
        said = {name: float(each[1]) for name, each in found.items() if each}
        assert set(said) == set(logged)
        assert said == {name: value for name, value in values.items() if name in said}
    pybullet.disconnect(client)


def test_vhacd_writes_an_object_a_hull_and_a_log(tmp_path: Path) -> None:
    files = [str(tmp_path / name) for name in ("in.obj", "out.obj", "log.txt")]
    table().export(files[0])
    with pytest.warns(UnusedOptionWarning, match="resolution"):
        vhacd(*files, concavity=0.01, resolution=100_000)
    hulls = trimesh.load(files[1], process=False).split(only_watertight=False)
    assert len(hulls) == Path(files[1]).read_text().count("o hull") > 1
    added = sum(hull.volume for hull in hulls) - table().volume
    assert added <= 0.01 * len(hulls) * table().convex_hull.volume
    assert f"{len(hulls)} hulls" in Path(files[2]).read_text()
    vhacd(*files, concavity=1.0)
    assert Path(files[1]).read_text().count("o hull") == 1, "one hull adds less than its own volume"
