"""The result: its frame, what it says about itself and where it lets itself be written."""

from __future__ import annotations

import shutil
import webbrowser
from pathlib import Path

import numpy as np
import pytest
import trimesh
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp

import rlacd
from fuzz.geometry import Polytope
from rlacd.decompose_mesh import decompose
from rlacd.decomposition import Decomposition
from rlacd.errors import OptionError
from rlacd.finish.finish import in_input
from rlacd.fit import LengthFit
from rlacd.options.presets import HullLimits
from rlacd.solid.frame import Frame
from rlacd.solid.hull import Hull
from tests.hulls import random_hull

SOURCE = trimesh.creation.box()


def result(count: int = 2, **report: object) -> Decomposition:
    hulls = [random_hull(seed) for seed in range(count)]
    return Decomposition.of(hulls, SOURCE, **{"name": "cup", "concavity": LengthFit(None, 0.0312, 0.05), **report})


def test_hulls_are_got_by_index_and_slice() -> None:
    cup = result(3)
    assert len(cup) == 3
    assert list(cup) == cup.hulls
    assert cup[0] is cup.hulls[0]
    assert cup[-1] is cup.hulls[2]
    assert cup[1:] == cup.hulls[1:]
    with pytest.raises(IndexError):
        cup[3]


def test_the_scene_has_a_node_per_hull_in_colours() -> None:
    cup = result(3)
    scene = cup.scene()
    assert list(scene.geometry) == list(scene.graph.nodes_geometry) == ["hull_000", "hull_001", "hull_002"]
    for hull, geometry in zip(cup, scene.geometry.values(), strict=True):
        assert (geometry.vertices == hull.vertices).all()
        assert (geometry.faces == hull.faces).all()
    assert len({tuple(geometry.visual.face_colors[0]) for geometry in scene.geometry.values()}) == 3


@pytest.fixture(scope="module")
def real() -> Decomposition:
    return decompose(SOURCE, quality="fast")


def test_a_notebook_shows_the_view_in_a_frame(real: Decomposition) -> None:
    page = real._repr_html_()
    assert page.startswith('<iframe srcdoc="')
    assert page.count('"') == 4, "the page is one attribute"
    assert "&lt;script" in page


@pytest.mark.slow
def test_show_opens_a_page_in_the_browser(real: Decomposition, monkeypatch: pytest.MonkeyPatch) -> None:
    opened: list[str] = []
    monkeypatch.setattr(webbrowser, "open", opened.append)
    page = real.show(up="y")
    assert opened == [page.as_uri()]
    assert page.read_text(encoding="utf-8").startswith("<!")
    shutil.rmtree(page.parent)


def test_it_describes_itself_in_one_line() -> None:
    cup = result(2)
    faces = sum(len(hull.faces) for hull in cup)
    fit = "concavity at most 0.07533 units (threshold 0.1207 units)"
    assert repr(cup) == f"<Decomposition: 2 hulls of cup, {faces} triangles, {fit}>"
    assert "1 hull of" in repr(result(1))
    assert "stopped early by timeout" in repr(result(2, complete=False, stopped_by="timeout"))
    assert repr(Decomposition.of([], SOURCE)) == "<Decomposition: 0 hulls of mesh, 0 triangles>"


def test_its_report_shows_itself_in_one_line_and_as_json_in_full(real: Decomposition) -> None:
    shown = repr(real.report)
    assert len(shown) < 300
    assert "\n" not in shown
    assert f"{len(real)} hull" in shown
    assert real.report.fit_words() in shown
    assert real.report.as_dict()["hulls"] == len(real)


def test_hulls_know_their_unit_and_what_trimesh_read_its_file(tmp_path: Path) -> None:
    trimesh.creation.box((80, 30, 200)).export(tmp_path / "brick.stl")
    mesh = trimesh.load(tmp_path / "brick.stl", force="mesh", process=False)
    mesh.metadata["file_name"] = "brick.stl"  # as trimesh 4 does
    plain, converted = decompose(mesh, threads=1), decompose(mesh, threshold="5mm", unit="mm", threads=1)
    assert plain.name == "brick"
    assert plain[0].units is None
    assert converted[0].units == converted.source.units == "m"
    assert converted[0].extents == pytest.approx((0.08, 0.03, 0.2))
    with pytest.raises(OptionError, match=r"threshold is 5mm, but brick\.stl does not say its unit"):
        decompose(mesh, threshold="5mm")


def test_it_saves_to_a_file_and_to_a_folder_named_after_the_mesh(tmp_path: Path) -> None:
    cup = result(2)
    assert cup.save(tmp_path / "cup.glb") == tmp_path / "cup.glb"
    assert len(trimesh.load_scene(tmp_path / "cup.glb").geometry) == 2
    folder = cup.save(f"{tmp_path}/parts/", file_type="ply")
    assert sorted(path.name for path in folder.glob("*.ply")) == ["cup_000.ply", "cup_001.ply"]
    with pytest.raises(OptionError):
        cup.save(tmp_path / "cup.doc")


finite = st.floats(-1e3, 1e3, allow_nan=False, width=64)


@given(
    hnp.arrays(np.float64, st.tuples(st.integers(1, 30), st.just(3)), elements=finite), st.sampled_from([1e-9, 1, 1e9])
)
def test_frame_is_centred_and_two_long_and_reversible(points, unit):
    points = points * unit
    frame = Frame.of(points)
    inside = frame.to_frame(points)
    size = np.ptp(points, axis=0).max()
    if size > 1e-9 * unit:
        np.testing.assert_allclose(np.ptp(inside, axis=0).max(), 2, rtol=1e-9)
        np.testing.assert_allclose(inside.min(axis=0) + inside.max(axis=0), 0, atol=1e-4)
    np.testing.assert_allclose(frame.to_input(inside), points, rtol=1e-12, atol=1e-12 * max(size, np.abs(points).max()))


@pytest.mark.parametrize("size", [1e-300, 1e300, 1.7e308])
def test_extreme_sizes_stay_finite(size):
    frame = Frame.of(np.array([[-size, 0, 0], [size, 0, 0]]))
    assert np.isfinite(frame.to_frame(np.array([[size, 0, 0]]))).all()
    assert Frame.of([[size, 4.0, 5.0]]).scale == 1, "a single point keeps the unit"


@pytest.mark.parametrize("turn", [0, 1, 2])
def test_a_hull_thinner_than_the_coordinates_resolve_keeps_its_outline(turn):
    corners = np.array([(0, 0, 0), (1, 0, 0), (0, 1, 0), (0, 0, 1e-9)], dtype=float)
    hull = Hull.of(np.roll(corners, turn, axis=1))
    frame = Frame(center=np.full(3, 1e9), scale=1.0)
    there = in_input(hull, frame)
    outline = there.vertices - 1e9
    assert there.is_watertight
    assert 0 < trimesh.Trimesh(outline, there.faces).volume < 1e-6
    assert outline.min() >= -1e-6
    assert outline.sum(axis=1).max() <= 1 + 1e-6
    few = in_input(hull, frame, HullLimits(max_vertices=4))
    assert len(few.vertices) == 4


@pytest.mark.parametrize("limits", [{"max_vertices": 4}, {"max_faces": 4}, {"max_vertices": 5}, {"max_faces": 8}])
def test_a_flat_hull_within_limits_stays_near_its_outline(limits):
    corners = np.array([(0, 0, 0), (1, 0, 0), (1, 1, 0), (0.2, 0.9, 0), (0, 0, 1e-9)], dtype=float)
    there = in_input(Hull.of(corners), Frame(center=np.full(3, 1e9), scale=1.0), HullLimits(**limits))
    assert len(there.vertices) <= limits.get("max_vertices", 9)
    assert len(there.faces) <= limits.get("max_faces", 99)
    assert np.ptp(there.vertices, axis=0).max() <= 4 + 1e-5
    assert Polytope(there.vertices - 1e9, there.faces).height(corners).max() <= 1e-6


def test_what_is_delivered_is_what_is_measured():
    """Far from the origin, rounding moves corners: the report's distances are those of the hulls in the result."""
    vertices = np.array([[2133474.422051975, -1227970.982897935, -2822809.689823566]] * 3)
    vertices[1:] += [[-2.8e-10, -1.04e-9, -9.1e-10], [-2.1e-10, -4.7e-11, -9.8e-10]]
    mesh = trimesh.Trimesh(vertices, [[0, 1, 2]], process=False)
    result = rlacd.decompose(mesh, max_vertices=4)
    lower, upper = vertices.min(axis=0), vertices.max(axis=0)
    scale = 2 / (upper - lower).max()
    beyond = max((hull.vertices - upper).max() for hull in result) * scale
    assert result.report.hausdorff.added >= beyond - 1e-5
