"""The report: one file that holds everything and fetches nothing; its heat map agrees with the certified distance."""

from __future__ import annotations

import base64
import gzip
import json
import re
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import trimesh
from click.testing import CliRunner
from lxml import html

import rlacd
from rlacd.cli.main import app
from rlacd.decomposition import Decomposition
from rlacd.errors import OptionError
from rlacd.plain_json import to_json
from rlacd.report import Hausdorff
from rlacd.viewer.heat import FINEST, INNER, HeatMesh, frame_of, heat_map
from rlacd.viewer.report import report_page, save_report_page
from rlacd.viewer.scene import scene
from tests.hulls import hull_of
from tests.shapes import elbow


@pytest.fixture(scope="module")
def result() -> Decomposition:
    return rlacd.decompose(elbow(1.0), threshold=0.05)


def payload(page: str) -> dict[str, Any]:
    return json.loads(gzip.decompress(base64.b64decode(html.fromstring(page).get_element_by_id("data").text)))


def points(text: str) -> np.ndarray:
    return np.frombuffer(base64.b64decode(text), dtype="<f4").reshape(-1, 3)


def triangles(text: str) -> np.ndarray:
    return np.frombuffer(base64.b64decode(text), dtype="<u4").reshape(-1, 3)


def test_the_page_holds_every_hull_every_number_and_the_input(result: Decomposition) -> None:
    data = payload(report_page(result, up="z", picture=False))
    assert data["report"] == json.loads(to_json(result.report))
    assert len(data["parts"]) == len(result)
    for part, hull, concavity in zip(data["parts"], result, result.report.concavity.per_part, strict=True):
        drawn = trimesh.Trimesh(points(part["vertices"]), triangles(part["faces"]), process=False)
        assert drawn.volume == pytest.approx(part["volume"], rel=1e-4)
        assert part["volume"] == pytest.approx(hull.volume * result.report.scale**3, rel=1e-9)
        assert part["error"] == concavity
        assert re.fullmatch("#[0-9a-f]{6}", part["color"])
    assert len(triangles(data["input"][0]["faces"])) == len(elbow(1.0).faces)
    assert np.ptp(points(data["input"][0]["vertices"]), axis=0).max() == pytest.approx(2.0, rel=1e-6)
    assert len(data["heat"]["parts"]) == len(result)


def test_the_scene_lies_about_the_origin_and_knows_its_up(result: Decomposition) -> None:
    far = elbow(1.0)
    far.apply_translation([1e6, -2e6, 3e6])
    for drawn in (scene(result, "x"), scene(rlacd.decompose(far, threshold=0.05), "x")):
        assert drawn["up"] == "x"
        corners = np.concatenate([points(part["vertices"]) for part in drawn["parts"]])
        assert corners.max(axis=0) == pytest.approx([1.0, 0.2, 0.5], abs=1e-6)
        assert corners.min(axis=0) == pytest.approx([-1.0, -0.2, -0.5], abs=1e-6)


@pytest.mark.promise("no-network")
def test_nothing_is_fetched(result: Decomposition) -> None:
    page = html.fromstring(report_page(result, picture=False))
    (policy,) = page.xpath("//meta[@http-equiv='Content-Security-Policy']/@content")
    assert "default-src 'none'" in policy
    assert "connect-src 'none'" in policy
    assert "http" not in policy
    assert all(address.startswith("data:") for address in page.xpath("//@src | //@href | //@action"))


@pytest.mark.parametrize(
    "name", ["</script><script>alert(1)</script>", "<img src=x onerror=alert(1)>", "{{main}}", "ünï☃"]
)
def test_a_name_stays_a_name(name: str) -> None:
    cube = trimesh.creation.box()
    hulls = [hull_of(cube.vertices)]
    pages = [report_page(Decomposition.of(hulls, cube, name=n), picture=False) for n in (name, "cube")]
    named, usual = map(html.fromstring, pages)
    assert [element.tag for element in named.iter()] == [element.tag for element in usual.iter()]
    assert payload(pages[0])["name"] == name
    assert named.findtext(".//title") == f"{name}: convex hulls"


def test_the_same_result_gives_the_same_bytes(result: Decomposition, tmp_path: Path) -> None:
    one, two = (save_report_page(result, tmp_path / name, picture=False) for name in ("a.html", "b.htm"))
    assert one.read_bytes() == two.read_bytes()


def test_numbers_that_json_does_not_know_become_null() -> None:
    cube = trimesh.creation.box()
    distances = Hausdorff(float("inf"), float("nan"))
    data = payload(report_page(Decomposition.of([hull_of(cube.vertices)], cube, hausdorff=distances), picture=False))
    assert data["report"]["hausdorff"] == {"added": None, "missed": None}


def test_a_cloud_of_points_and_balls_can_be_shown() -> None:
    corners = np.array(trimesh.creation.box().vertices)
    cloud = payload(report_page(rlacd.decompose((corners, np.empty((0, 3), dtype=np.int32))), picture=False))
    assert cloud["input"] == []
    assert cloud["heat"]["parts"] == []
    space = rlacd.NavigableSpace(radius=0.1, tolerance=0.04)
    free = rlacd.decompose(elbow(1.0), criterion=space)
    balls = payload(report_page(free, picture=False))["balls"]
    assert 0 < balls["shown"] <= balls["of"] == len(free.balls)
    assert len(points(balls["centres"])) == balls["shown"]


@pytest.mark.slow
def test_the_picture_is_inside_and_its_absence_is_reported(
    result: Decomposition, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    pytest.importorskip("mitsuba", reason="the extra view is not installed")
    address = payload(result.save_report(tmp_path / "with.html").read_text(encoding="utf-8"))["picture"]
    assert base64.b64decode(address.removeprefix("data:image/png;base64,")).startswith(b"\x89PNG")
    monkeypatch.setitem(sys.modules, "mitsuba", None)
    without = payload(result.save_report(tmp_path / "without.html").read_text(encoding="utf-8"))
    assert "picture" not in without
    assert "pip install 'rlacd[view] @ git+https://github.com/rlacd/rlacd'" in without["note"]


@pytest.mark.parametrize(
    ("name", "starts"), [pytest.param("r.HTM", "<!doctype html>", marks=pytest.mark.slow), ("r.json", "{")]
)
def test_the_ending_tells_the_command_what_kind_of_report_is_meant(tmp_path: Path, name: str, starts: str) -> None:
    elbow(1.0).export(tmp_path / "elbow.stl")
    run = CliRunner().invoke(app, ["decompose", str(tmp_path / "elbow.stl"), "-q", "--report", str(tmp_path / name)])
    assert (run.exit_code, run.output) == (0, "")
    assert (tmp_path / name).read_text(encoding="utf-8").startswith(starts)


def test_bad_places_and_axes_are_refused(result: Decomposition, tmp_path: Path) -> None:
    with pytest.raises(OptionError, match=r"must end in \.json, \.html"):
        save_report_page(result, tmp_path / "out.pdf")
    with pytest.raises(OptionError, match="x, y or z"):
        save_report_page(result, tmp_path / "out.html", up="w")
    assert list(tmp_path.iterdir()) == []


def test_a_report_as_json_is_what_the_result_says(result: rlacd.Decomposition, tmp_path: Path) -> None:
    for name in ("a.json", "b.JSON"):
        written = json.loads(result.save_report(tmp_path / name).read_text(encoding="utf-8"))
        assert written == json.loads(json.dumps(result.report.as_dict()))


# --- the heat map -----------------------------------------------------------------------------------------------------


MEASURED_WITHIN = 2e-3  # width of the interval that the report's distance comes from


def box(lower: tuple[float, float, float], upper: tuple[float, float, float]) -> trimesh.Trimesh:
    return trimesh.creation.box(bounds=[lower, upper])


def hottest(heat: list[HeatMesh]) -> float:
    return max(float(part.distance.max()) for part in heat)


@pytest.mark.slow
@pytest.mark.parametrize("threshold", [0.05, 0.3, 2.0])
@pytest.mark.parametrize("place", [(0.0, 1.0), (1e5, 1e-2), (-3.0, 1e4)])
def test_the_hottest_spot_is_as_far_as_the_report_says(threshold: float, place: tuple[float, float]) -> None:
    mesh = elbow()
    mesh.apply_scale(place[1])
    mesh.apply_translation([place[0], 0, -place[0]])
    result = rlacd.decompose(mesh, threshold=threshold)
    over = result.report.hausdorff.added
    # Distance is 1-Lipschitz: the farthest point of a triangle lies within an edge of a corner.
    assert over - FINEST - MEASURED_WITHIN <= hottest(heat_map(result)) <= over + MEASURED_WITHIN


def test_one_hull_of_an_elbow_is_hot_where_it_bridges_the_corner() -> None:
    mesh = elbow()
    result = rlacd.decompose(mesh, threshold=2.0, detail="full")
    (part,) = heat_map(result)
    frame = frame_of(result)
    # The bridge runs from the tip (2, ., 0.4) to (0.4, ., 2); its middle, (1.2, ., 1.2), is 0.8 away from either beam.
    middle = frame.to_frame([[1.2, 0.2, 1.2]])[0]
    nearest = np.linalg.norm(part.vertices - middle, axis=1).argmin()
    assert part.distance[nearest] == pytest.approx(0.8 * frame.scale, abs=2 * FINEST)
    ground = part.vertices[:, 2] < frame.to_frame([[0, 0, 1e-9]])[0, 2]
    assert part.distance[ground].max() == pytest.approx(0.0, abs=1e-9)


def test_a_perfect_fit_is_cold_and_inner_walls_are_marked() -> None:
    halves = [box((0, 0, 0), (1, 1, 1)), box((1, 0, 0), (2, 1, 1))]
    result = Decomposition.of([hull_of(half.vertices) for half in halves], box((0, 0, 0), (2, 1, 1)))
    for part in heat_map(result):
        wall = np.isclose(part.vertices[:, 0], 0.0)
        assert wall.any()
        assert (part.distance[wall] == INNER).all()
        assert np.abs(part.distance[~wall]).max() < 1e-12
