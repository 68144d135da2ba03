"""Whatever comes in: valid hulls, or one clear typed error. Never a traceback, a crash or half a file."""

from __future__ import annotations

import io
import json
import os
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import trimesh
from click.testing import CliRunner, Result
from trimesh import creation

import rlacd
from rlacd.cli.main import app
from rlacd.errors import EmptyMeshError, MeshDataError, MeshFileError, OptionError, RlacdError
from rlacd.repair import steps as repairing
from tests.hulls import assert_convex_hull, strict_json
from tests.shapes_bad import arrays, ell

ELL, FACES = ell()
BOX = arrays(creation.box())
NO_FACES = np.zeros((0, 3), dtype=int)


def check(mesh: Any, **options: Any) -> rlacd.Decomposition:
    result = rlacd.decompose(mesh, threads=1, **options)
    assert len(result) >= 1
    for hull in result:
        assert np.isfinite(hull.vertices).all()
        assert_convex_hull(hull)
    strict_json(result.report)
    return result


def is_one_sentence(text: str) -> bool:
    return len(text.strip().splitlines()) == 1 and len(text) > 20


# --- meshes that give hulls -------------------------------------------------------------------------------------------


@pytest.mark.parametrize("exponent", [-300, -160, -100, -9, 9, 100, 150, 300, 307])
@pytest.mark.promise("frame")
def test_any_scale_gives_the_hulls_of_scale_one(exponent: int) -> None:
    expected = check((ELL, FACES))
    result = check((ELL * 10.0**exponent, FACES))
    assert len(result) == len(expected)
    assert result.report.concavity.max == pytest.approx(expected.report.concavity.max, rel=1e-2)


def test_the_largest_and_the_smallest_numbers_there_are() -> None:
    largest = check((np.sign(BOX[0]) * np.finfo(float).max, BOX[1]))
    assert np.abs(largest.hulls[0].vertices).max() == np.finfo(float).max
    denormal = check((BOX[0] * 1e-310, BOX[1]))
    assert 0 < np.abs(denormal.hulls[0].vertices).max() < 1e-300
    points = [[1e308, 0, 4], [-23, 0, 13], [-14, 0, 4], [-14, 0, 13], [-14, 0.1, 13], [1e308, 1.7e308, -1e308]]
    faces = [[3, 1, 2], [0, 2, 1], [3, 4, 1], [5, 0, 1], [5, 4, 0]]
    for limits in ({}, {"max_faces": 8}, {"max_vertices": 4}, {"preset": "unreal"}):
        result = rlacd.decompose((points, faces), threshold=0.2, quality="fast", threads=1, **limits)
        assert all(np.isfinite(hull.vertices).all() for hull in result)


@pytest.mark.parametrize("size", [1.0, 1e-3, 1e-7])
def test_a_far_offset_costs_precision_and_nothing_else(size: float) -> None:
    result = check((ELL * size + 1e9, FACES))
    bounds = np.stack([hull.bounds for hull in result])
    assert bounds[:, 0].min() == pytest.approx(1e9 - size, abs=5e-7)
    assert bounds[:, 1].max() == pytest.approx(1e9 + size, abs=5e-7)


@pytest.mark.parametrize(
    ("vertices", "faces"),
    [
        pytest.param([[0, 0, 0], [1, 0, 0], [0, 1, 0]], [[0, 1, 2]], id="one triangle"),
        pytest.param([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]], [[0, 1, 2], [0, 2, 3]], id="flat card"),
        pytest.param([[0, 0, 0], [1, 0, 0], [2, 0, 0]], [[0, 1, 2]], id="line"),
        pytest.param([[0, 0, 0], [1, 1, 1], [2, 2, 2]], [[0, 1, 2]], id="slanted line"),
        pytest.param([[0, 0, 0], [1, 1, 1]], NO_FACES, id="two points"),
        pytest.param([[1, 2, 3]], NO_FACES, id="one point"),
        pytest.param([[1, 2, 3]] * 5, [[0, 1, 2], [2, 3, 4]], id="all points equal"),
        pytest.param([[1e9, 2e300, 3]] * 3, [[0, 1, 2]], id="one point, coordinates far apart"),
        pytest.param([[-1e300, 1e9, 3]] * 3, [[0, 1, 2]], id="one far point"),
        pytest.param([[np.finfo(float).max] * 3] * 3, [[0, 1, 2]], id="the farthest point"),
        pytest.param(ELL, np.stack([FACES[:, 0], FACES[:, 0], FACES[:, 1]], axis=1), id="faces without area"),
        pytest.param(np.random.default_rng(0).random((50, 3)), NO_FACES, id="cloud"),
        pytest.param(np.random.default_rng(0).random((50, 3)) * [1, 1, 0], NO_FACES, id="flat cloud"),
        pytest.param(BOX[0] * [1, 1, 0], BOX[1], id="box pressed flat"),
        pytest.param(BOX[0] * [1, 1, 1e-12], BOX[1], id="box pressed nearly flat"),
        pytest.param(BOX[0] * [1, 1e-9, 1e-9], BOX[1], id="hair"),
    ],
)
@pytest.mark.promise("any-mesh")
def test_what_has_no_volume_gives_one_thin_hull_around_it(vertices: Any, faces: Any) -> None:
    result = check((vertices, faces))
    points, size = np.asarray(vertices, dtype=float), 1e-9
    with np.errstate(over="ignore"):
        size = max(float(np.ptp(points, axis=0).max()), 1e-9)
    (hull,) = result.hulls
    assert (hull.vertices.min(axis=0) <= points.min(axis=0) + 1e-2 * size).all()
    assert (hull.vertices.max(axis=0) >= points.max(axis=0) - 1e-2 * size).all()
    assert result.report.repair[0].step in ("slab", "hull", "closed")


def test_closed_bodies_that_hide_each_other_count_once() -> None:
    for bodies in ([ELL, ELL], [ELL, 0.99 * ELL], [BOX[0], 0.5 * BOX[0], 0.2 * BOX[0]]):
        faces = FACES if bodies[0] is ELL else BOX[1]
        one = check((bodies[0], faces))
        stacked = np.concatenate([faces + i * len(bodies[0]) for i in range(len(bodies))])
        all_of_them = check((np.concatenate(bodies), stacked))
        assert len(all_of_them) == len(one)
        assert sum(hull.volume for hull in all_of_them) == pytest.approx(sum(hull.volume for hull in one), rel=1e-3)


@pytest.mark.promise("loss-named")
def test_a_triangle_that_ends_far_away_is_kept_or_reported(monkeypatch: pytest.MonkeyPatch) -> None:
    far = np.vstack([ELL, [[1e6, 0, 0]]]), np.vstack([FACES, [[0, 1, len(ELL)]]])
    assert check(far).report.hausdorff.missed < 1e-3
    monkeypatch.setattr(repairing, "MOST_PATCHES", 0)
    report = check(far).report
    assert report.hausdorff.missed > 1
    assert any("outside the hulls, farthest near (1e+06, 0, 0)" in sentence for sentence in report.warnings)


# --- meshes that give an error ----------------------------------------------------------------------------------------


class BytesPath:
    def __fspath__(self) -> bytes:
        return b"box.obj"


@pytest.mark.parametrize(
    ("mesh", "error"),
    [
        pytest.param((ELL * np.nan, FACES), MeshDataError, id="nothing but NaN"),
        pytest.param((ELL + np.inf, FACES), MeshDataError, id="nothing but infinity"),
        pytest.param((ELL, np.full((2, 3), 2**62)), MeshDataError, id="index huge"),
        pytest.param((ELL, np.full((2, 3), 2**64 - 1, dtype=np.uint64)), MeshDataError, id="index of 64 bits"),
        pytest.param((ELL, FACES.astype(float)), MeshDataError, id="faces of float"),
        pytest.param((ELL, FACES.astype(bool)), MeshDataError, id="faces of bool"),
        pytest.param((ELL, {}), MeshDataError, id="faces of dict"),
        pytest.param((None, FACES), MeshDataError, id="vertices of None"),
        pytest.param((ELL[:, :2], FACES), MeshDataError, id="vertices in the plane"),
        pytest.param((ELL[None], FACES), MeshDataError, id="vertices of three dimensions"),
        pytest.param((ELL, FACES[:, :2]), MeshDataError, id="faces of two corners"),
        pytest.param((ELL, np.hstack([FACES, FACES])), MeshDataError, id="faces of six corners"),
        pytest.param((ELL, FACES, FACES), MeshDataError, id="three arrays"),
        pytest.param(([[0, 0, 0], [1, 2]], [[0, 1, 0]]), MeshDataError, id="ragged vertices"),
        pytest.param(("abc", FACES), MeshDataError, id="vertices of letters"),
        pytest.param((ELL * 1j, FACES), MeshDataError, id="complex vertices"),
        pytest.param((np.ma.masked_equal(np.eye(3), 1), [[0, 1, 2]]), MeshDataError, id="masked vertices"),
        pytest.param((np.eye(3), np.ma.masked_equal([[0, 1, 2]], 1)), MeshDataError, id="masked faces"),
        pytest.param(BytesPath(), MeshDataError, id="path of bytes"),
        pytest.param(3, MeshDataError, id="int"),
        pytest.param(None, MeshDataError, id="None"),
        pytest.param(b"solid", OptionError, id="bytes of no format"),
        pytest.param(io.StringIO("v 0 0 0"), MeshDataError, id="open as text"),
        pytest.param([], MeshDataError, id="no meshes"),
        pytest.param((trimesh.Trimesh(), 3), MeshDataError, id="not all meshes"),
        pytest.param((np.zeros((0, 3)), NO_FACES), EmptyMeshError, id="no points"),
        pytest.param(trimesh.Trimesh(), EmptyMeshError, id="empty mesh"),
        pytest.param(trimesh.Scene(), EmptyMeshError, id="empty scene"),
        pytest.param(
            trimesh.Scene([trimesh.load_path(np.array([[0.0, 0, 0], [9, 9, 9]]))]), EmptyMeshError, id="only a path"
        ),
    ],
)
@pytest.mark.promise("refused")
def test_what_is_no_mesh_is_one_sentence(mesh: Any, error: type[RlacdError]) -> None:
    with pytest.raises(error) as caught:
        rlacd.decompose(mesh)
    assert is_one_sentence(str(caught.value))


def test_what_is_given_beside_a_mesh_is_told_how_to_give_it() -> None:
    with pytest.raises(
        MeshDataError, match=r"0\.02 is given where faces go.*options by their names, such as threshold"
    ):
        rlacd.decompose(creation.box(), 0.02)
    with pytest.raises(MeshFileError, match="is an address, and nothing is fetched: download the file"):
        rlacd.decompose("https://example.com/chair.stl")
    box = creation.box()
    with pytest.raises(MeshDataError, match=r"vertex 8, but there are 8 .*: count them from 0, not 1"):
        rlacd.decompose((box.vertices, box.faces + 1))
    with pytest.raises(MeshDataError, match=r"vertex -1, but there are 8 .*: the mesh is damaged"):
        rlacd.decompose((box.vertices, box.faces - 1))
    with pytest.raises(OptionError, match="file_type is 'obj'; it has to be left out"):
        rlacd.decompose(creation.box(), file_type="obj")


# --- options ----------------------------------------------------------------------------------------------------------

NAN, INFINITE = float("nan"), float("inf")
WRONG_OPTIONS = {
    "threshold": [0, -1, NAN, INFINITE, 3, 0.0009, "a", True, [0.1]],
    "threshold_abs": [0, -1, NAN, INFINITE, "a", 1e9, 1e-9],
    "max_hulls": [0, -1, 2.5, "2", True, NAN],
    "max_vertices": [3, 0, -8, 4.5, "8"],
    "max_faces": [3, 0, 12.0, "x"],
    "overlap": [-0.01, NAN, 0.6, "a", True],
    "overlap_abs": [0, -1, NAN, INFINITE, "a", 1e9],
    "keep_open": [0, 0.05, 1, NAN, "9", True],
    "keep_open_abs": [0, -1, NAN, INFINITE, "a", 1e9, 1e-9],
    "avoid": ["a.obj", 3, [3], [NAN]],
    "merge": ["no", 0, 2],
    "quality": ["better", 3],
    "budget": [0, INFINITE],
    "search_steps": [-1, 1.5],
    "policy": ["", 3, "GREEDY", "greedy-", ["greedy"]],
    "gap": [0, 0.009, 0.31, NAN, "3", True],
    "resolution": [0, -1, 19, 401, 2.5, "3", 10**6],
    "seed": [-1, 1.5, "a", 2**70],
    "threads": [0, -1, 1.5, "2", True, 10**6],
    "timeout": [0, -1, NAN, INFINITE, "3"],
    "progress": [3, "no"],
}


@pytest.mark.parametrize(("name", "value"), [(name, value) for name, some in WRONG_OPTIONS.items() for value in some])
def test_an_option_out_of_range_is_named_with_its_range(name: str, value: Any) -> None:
    with pytest.raises(OptionError, match=name) as caught:
        rlacd.decompose(BOX, **{name: value})
    assert is_one_sentence(str(caught.value))


# --- stopping ---------------------------------------------------------------------------------------------------------


@pytest.mark.promise("cancel")
def test_cancelled_at_any_step_the_hulls_still_cover_the_solid() -> None:
    torus = arrays(creation.torus(1, 0.3, major_sections=12, minor_sections=6))

    def step(progress: rlacd.Progress) -> tuple[str, int, int]:
        return progress.stage, progress.done, progress.parts

    seen = []
    check(torus, progress=lambda progress: seen.append(step(progress)))
    # Once the parts are found, there is nothing left to stop; and a busy machine calls more often than an idle one.
    steps = list(dict.fromkeys(each for each in seen if each[0] not in ("finish", "measure")))
    for last in steps[:: max(1, len(steps) // 6)]:
        result = check(torus, progress=lambda progress, last=last: step(progress) != last)
        assert result.report.stopped_by == "cancel"
        assert result.report.hausdorff.missed < 2e-3


def test_an_exception_of_the_callback_is_the_callers_own() -> None:
    with pytest.raises(ZeroDivisionError):
        rlacd.decompose((ELL, FACES), progress=lambda progress: bool(1 / 0), threads=2)
    assert len(rlacd.decompose((ELL, FACES), threads=2)) == 2, "the next run is not disturbed"


# --- files, through the command line ----------------------------------------------------------------------------------


def run(*words: object) -> Result:
    return CliRunner().invoke(app, ["decompose", *(str(word) for word in words)])


def test_a_point_cloud_file_gives_the_hull_of_its_points(tmp_path: Path) -> None:
    points = np.random.default_rng(0).random((40, 3))
    trimesh.PointCloud(points).export(tmp_path / "cloud.ply")
    result = run(tmp_path / "cloud.ply")
    assert result.exit_code == 0
    assert "convex hull of all points" in result.stderr
    hull = trimesh.load(tmp_path / "cloud_hulls.glb", force="mesh")
    assert hull.volume == pytest.approx(trimesh.PointCloud(points).convex_hull.volume, rel=1e-4)


NAMES = [
    "kürbis 椅子 🪑.stl",
    "with\nnewline.stl",
    "quote'\" $(x);&.stl",
    "mesh.STL",
    "two.dots.stl",
    "椅" * 80 + ".stl",
    os.fsdecode(b"\xff\xfe.stl"),
]


@pytest.mark.slow
@pytest.mark.parametrize("name", NAMES, ids=ascii)
def test_any_file_name_works(name: str, tmp_path: Path) -> None:
    try:
        creation.box().export(tmp_path / "plain.stl")
        path = (tmp_path / "plain.stl").rename(tmp_path / name)
    except (OSError, UnicodeError):
        pytest.skip("this file system does not take such a name")
    before = {path}
    result = run(path, "-o", tmp_path / "out.glb", "--report", tmp_path / "out.json")
    assert result.exit_code == 0, result.stderr
    assert json.loads((tmp_path / "out.json").read_text(encoding="utf-8"))["hulls"] == 1
    assert run(path, "-o", tmp_path / path.with_suffix(".obj").name).exit_code == 0
    assert run(path, "-o", f"{tmp_path}/folder/").exit_code == 0
    assert CliRunner().invoke(app, ["info", str(path)]).exit_code == 0
    assert CliRunner().invoke(app, ["info", str(path), "--json"]).exit_code == 0
    assert not [p for p in tmp_path.iterdir() if p.name.endswith(".tmp")]
    assert before < set(tmp_path.iterdir())


@pytest.mark.parametrize(
    ("output", "says"),
    [
        ("y" * 300 + ".glb", "too long"),
        ("box.stl/out.glb", "not a folder"),
        ("circle.glb", "cannot write"),
        ("folder.glb", "it is a folder"),
        ("pipe.obj", "not an ordinary file"),
        ("/proc/out.glb", "cannot write"),
    ],
)
def test_an_output_that_cannot_be_written_has_code_3(output: str, says: str, tmp_path: Path) -> None:
    path = tmp_path / "box.stl"
    creation.box().export(path)
    (tmp_path / "circle.glb").symlink_to(tmp_path / "circle.glb")
    os.mkfifo(tmp_path / "pipe.obj")
    (tmp_path / "folder.glb").mkdir()
    if output.startswith("/proc") and not Path("/proc/self").exists():
        pytest.skip("no /proc here")
    before = sorted(tmp_path.iterdir())
    result = run(path, "-o", tmp_path / output)
    assert result.exit_code == 3, result.stderr
    assert says in result.stderr
    assert is_one_sentence(result.stderr)
    assert sorted(tmp_path.iterdir()) == before


@pytest.mark.promise("input-kept")
def test_links_are_followed_and_their_target_is_never_overwritten(tmp_path: Path) -> None:
    real, link = tmp_path / "box.stl", tmp_path / "link.stl"
    creation.box().export(real)
    link.symlink_to(real)
    assert run(link, "-o", tmp_path / "out.obj").exit_code == 0
    before = real.read_bytes()
    for words in (
        [link, "-o", real],
        [real, "-o", link],
        [link, "-o", tmp_path / "out.obj", "--report", real],
        [real, "-o", tmp_path / "out.obj", "--picture", link],
    ):
        refused = run(*words)
        assert refused.exit_code == 2
        assert "overwrite the input" in refused.stderr
    assert real.read_bytes() == before


@pytest.mark.parametrize(
    ("name", "says"),
    [
        ("folder", "is a folder"),
        ("", "is a folder"),
        ("..", "is a folder"),
        ("dangling.stl", "does not exist"),
        ("circle.stl", ""),
        ("pipe.stl", "pipe"),
        ("nowhere.stl", "does not exist"),
        ("blank.glb", "is empty"),
        ("y" * 300 + ".stl", ""),
    ],
)
def test_an_input_that_is_no_file_has_code_2(name: str, says: str, tmp_path: Path) -> None:
    (tmp_path / "folder").mkdir()
    (tmp_path / "dangling.stl").symlink_to(tmp_path / "gone.stl")
    (tmp_path / "circle.stl").symlink_to(tmp_path / "circle.stl")
    os.mkfifo(tmp_path / "pipe.stl")
    (tmp_path / "blank.glb").write_bytes(b"")
    result = run(tmp_path / name, "-o", tmp_path / "out.glb")
    assert result.exit_code == 2, result.stderr
    assert is_one_sentence(result.stderr)
    assert name in result.stderr
    assert says in result.stderr
    assert not (tmp_path / "out.glb").exists()
