"""The viewer's server as a browser meets it, without one: pages, progress, downloads, and who is turned away."""

from __future__ import annotations

import base64
import hashlib
import http.client
import io
import json
import re
import shlex
import socket
import sys
import tempfile
import threading
import time
import urllib.parse
import zipfile
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import trimesh
from click.testing import CliRunner

import rlacd
from rlacd.cli.main import app
from rlacd.errors import OptionError, OutputError
from rlacd.options import Options
from rlacd.options.navigable import NavigableSpace
from rlacd.viewer.controls import read_controls
from rlacd.viewer.downloads import offered
from rlacd.viewer.server import ViewServer
from tests.shapes import elbow
from tests.view.viewing import PATIENCE, Answer, ask, open_viewer, port_of

NAME = "an elbow 'n ümläut"


@pytest.fixture(scope="module")
def mesh(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("view") / f"{NAME}.stl"
    elbow().export(path)
    return path


@pytest.fixture
def viewer(mesh: Path) -> Iterator[ViewServer]:
    with open_viewer(mesh, {"threshold": 0.05}, port=0) as viewer:
        yield viewer


def events(viewer: ViewServer) -> Iterator[dict[str, Any]]:
    """States as the page gets them."""
    connection = http.client.HTTPConnection("127.0.0.1", port_of(viewer), timeout=PATIENCE)
    connection.request("GET", "/events")
    response = connection.getresponse()
    assert response.headers["Content-Type"] == "text/event-stream"
    end = time.monotonic() + PATIENCE
    try:
        for line in response:  # also where nothing changes: signs of life
            assert time.monotonic() < end, "what is waited for does not come"
            if line.startswith(b"data: "):
                yield json.loads(line.removeprefix(b"data: "))
    finally:
        connection.close()


def settled(viewer: ViewServer, run: int) -> dict[str, Any]:
    return next(state for state in events(viewer) if state["state"] == "idle" and state["run"] == run)


def test_the_page_comes_with_its_controls(viewer: ViewServer) -> None:
    answer = ask(viewer, "GET", "/")
    page = answer.body.decode()
    assert answer.status == 200
    assert answer.headers["Content-Type"].startswith("text/html")
    assert "<title>an elbow &#x27;n ümläut</title>" in page
    assert '"threshold":0.05' in page.replace(" ", "")
    assert "connect-src 'self'" in page
    for script in re.findall(r"\./page/\w+\.js", page):
        assert ask(viewer, "GET", script.removeprefix(".")).headers["Content-Type"].startswith("text/javascript")


def test_every_answer_is_hardened_and_the_policy_names_every_script_by_its_hash(viewer: ViewServer) -> None:
    settled(viewer, run=1)
    for path in ("/", "/page/list.js", "/scene", "/download?format=glb", "/nothing"):
        headers = ask(viewer, "GET", path).headers
        assert headers["X-Content-Type-Options"] == "nosniff"
        assert headers["X-Frame-Options"] == "DENY"
        assert headers["Referrer-Policy"] == "no-referrer"
        assert headers["Cross-Origin-Resource-Policy"] == "same-origin"
        assert "Python" not in headers["Server"]
    answer = ask(viewer, "GET", "/")
    policy, page = answer.headers["Content-Security-Policy"], answer.body.decode()
    assert "default-src 'none'" in policy
    assert "frame-ancestors 'none'" in policy
    assert "unsafe" not in policy
    assert "data:" not in policy.split("script-src")[1].split(";")[0]
    inside = re.findall(r'<(script|style)(?: type="(importmap|module)")?>(.*?)</\1>', page, re.DOTALL)
    assert len(inside) == 4
    for _, _, text in inside:
        assert base64.b64encode(hashlib.sha256(text.encode()).digest()).decode() in policy


def test_hulls_and_heat_come_again_with_other_options(viewer: ViewServer) -> None:
    settled(viewer, run=1)
    assert len(ask(viewer, "GET", "/scene").json["parts"]) == 2
    assert ask(viewer, "GET", "/heat").json["max"] == pytest.approx(0.0, abs=1e-6)
    assert ask(viewer, "POST", "/decompose", {"threshold": 1.9}).status == 202
    assert settled(viewer, run=2)["error"] is None
    scene, heat = (ask(viewer, "GET", path).json for path in ("/scene", "/heat"))
    assert len(scene["parts"]) == len(heat["parts"]) == 1
    assert scene["report"]["options"]["threshold"] == 1.9
    assert heat["max"] > 0.5


@pytest.mark.slow
def test_everything_offered_can_be_downloaded_and_read(viewer: ViewServer) -> None:
    settled(viewer, run=1)
    volume = sum(hull.volume for hull in viewer.session.result[1])  # type: ignore[index]
    names = set()
    for offer in offered():
        name = offer.name
        if offer.missing or name == "balls.csv":  # an extra; not with this criterion
            continue
        answer = ask(viewer, "GET", f"/download?format={urllib.parse.quote(name)}")
        assert answer.status == 200, (name, answer.body[:200])
        assert offer.label
        assert offer.hint.endswith(".")
        disposition = answer.headers["Content-Disposition"]
        assert disposition.startswith("attachment; ")
        exact = urllib.parse.unquote(disposition.split("filename*=UTF-8''")[1])
        assert exact.startswith(NAME)
        assert exact not in names, "no two downloads have one name"
        names.add(exact)
        if name in ("glb", "obj", "ply", "stl"):
            read = trimesh.load(io.BytesIO(answer.body), file_type=name, force="mesh")
            assert read.volume == pytest.approx(volume, rel=1e-5)
        elif name.endswith(".zip"):
            with zipfile.ZipFile(io.BytesIO(answer.body)) as archive:
                hulls = [member for member in archive.namelist() if member.endswith(name.removesuffix(".zip"))]
                assert len(hulls) == 2
        elif name == "mjcf":
            with zipfile.ZipFile(io.BytesIO(answer.body)) as archive:
                model = archive.read(f"{NAME}.xml").decode()
                assert model.count('class="collision"') >= 2
        elif name == "report.json":
            assert answer.json["hulls"] == 2
        elif name == "report.html":
            assert b"connect-src 'none'" in answer.body


def test_a_report_under_way_holds_up_no_decomposition(viewer: ViewServer, monkeypatch: pytest.MonkeyPatch) -> None:
    settled(viewer, run=1)
    begun, done = threading.Event(), threading.Event()

    def slow(*_: Any, **__: Any) -> bytes:
        begun.set()
        assert done.wait(PATIENCE)
        raise OutputError("the picture could not be drawn: its process died of SIGKILL.")

    monkeypatch.setattr("rlacd.viewer.report.picture_bytes", slow)
    with ThreadPoolExecutor(3) as pool:
        reports = [pool.submit(ask, viewer, "GET", "/download?format=report.html") for _ in range(3)]
        assert begun.wait(PATIENCE)
        ask(viewer, "POST", "/decompose", {"threshold": 0.3, "quality": "fast"})
        settled(viewer, run=2)
        assert ask(viewer, "GET", "/scene").status == 200
        assert not any(report.done() for report in reports)
        done.set()
        for report in reports:
            assert report.result(PATIENCE).status == 400
            assert "could not be drawn" in report.result().json["error"]


def test_bad_options_are_answered_in_a_sentence_and_change_nothing(viewer: ViewServer) -> None:
    settled(viewer, run=1)
    for options, says in (
        ({"threshold": -1}, "threshold is -1"),
        ({"threshold": "tight"}, "threshold is 'tight'"),
        ({"criterion": []}, "distance, volume or navigable"),
        ({"criterion": "navigable", "radius": 0}, "radius"),
        ({"primitives": ["cone"]}, "primitives is"),
        ({"mesh": "/etc/passwd"}, "'mesh' is not an option of the viewer"),
        ([], "not a JSON object"),
        (b"{", "not a JSON object"),
    ):
        answer = ask(viewer, "POST", "/decompose", options)
        assert answer.status == 400
        assert says in answer.json["error"]
        assert answer.json["error"].endswith(".")
        assert (viewer.session.state.state, viewer.session.state.run) == ("idle", 1)


def test_a_mesh_that_has_gone_is_told_by_its_name(tmp_path: Path) -> None:
    path = tmp_path / "cube.stl"
    trimesh.creation.box().export(path)
    with open_viewer(path, port=0) as viewer:
        settled(viewer, run=1)
        path.unlink()
        assert ask(viewer, "POST", "/decompose", {}).status == 202
        assert next(state["error"] for state in events(viewer) if state["error"]).startswith("cube.stl does not exist")


def test_the_input_is_there_before_any_hull(mesh: Path) -> None:
    go = threading.Event()

    def late(*words: Any, **options: Any) -> rlacd.Decomposition:
        assert go.wait(PATIENCE)
        return rlacd.decompose(*words, **options)

    with open_viewer(mesh, {"quality": "fast"}, decompose=late, port=0) as viewer:
        scene = ask(viewer, "GET", "/scene").json
        go.set()
        assert (scene["report"], scene["parts"], scene["name"]) == (None, [], NAME)
        assert scene["input"][0]["faces"]
        assert scene["scale"] == pytest.approx(1.0)
        settled(viewer, run=1)


def post_file(viewer: ViewServer, name: str, content: bytes, **headers: str) -> Answer:
    kind = {"Content_Type": "application/octet-stream", **headers}
    return ask(viewer, "POST", f"/open?{urllib.parse.urlencode({'name': name})}", content, **kind)


def test_another_mesh_is_opened(viewer: ViewServer) -> None:
    settled(viewer, run=1)
    assert ask(viewer, "POST", "/decompose", {"threshold": -1}).status == 400
    content = trimesh.creation.icosphere(1).export(file_type="glb")
    assert post_file(viewer, "../../a ball.glb", content).status == 202, "a refused option is in no file's way"
    settled(viewer, run=2)
    assert viewer.session.result[1].report.options["threshold"] == 0.05
    scene = ask(viewer, "GET", "/scene").json
    assert (scene["name"], scene["up"], scene["unit"]["name"], len(scene["parts"])) == ("a ball", "y", "m", 1)
    folder = viewer.subject.path.parent
    assert [path.name for path in folder.iterdir()] == ["a ball.glb"]
    command = shlex.split(ask(viewer, "POST", "/command", {}).json["command"])
    assert command[2] == "a ball.glb", "the folder goes with the viewer"
    assert post_file(viewer, "cube.stl", trimesh.creation.box().export(file_type="stl")).status == 202
    assert not folder.exists(), "one file is kept at a time"
    settled(viewer, run=3)
    assert (
        ask(viewer, "GET", "/download?format=glb")
        .headers["Content-Disposition"]
        .startswith('attachment; filename="cube_hulls.glb"')
    )


def test_a_file_that_is_no_mesh_is_refused_and_nothing_is_lost(viewer: ViewServer) -> None:
    settled(viewer, run=1)
    for name, content, says in (
        ("cube.stl", b"", "empty"),
        ("cube.stl", b"no mesh at all", "cube.stl"),
        ("page.html", b"<html>", "html"),
        ("", b"solid", "mesh"),
    ):
        answer = post_file(viewer, name, content)
        assert answer.status == 400
        assert says in answer.json["error"]
        assert tempfile.gettempdir() not in answer.json["error"]
    assert viewer.session.state.run == 1
    assert len(ask(viewer, "GET", "/scene").json["parts"]) == 2


def test_the_options_are_a_command(viewer: ViewServer, mesh: Path) -> None:
    for wanted, said in (
        ({}, ""),
        ({"threshold": 0.02, "quality": "best"}, "--threshold 0.02 --quality best"),
        ({"preset": "mujoco", "max_hulls": 9}, "--preset mujoco --max-hulls 9"),
        ({"criterion": "navigable", "radius": 0.07}, "--criterion navigable --radius 0.07"),
        ({"primitives": ["box", "sphere"], "overlap": 0.0}, "--primitives box,sphere"),
        ({"criterion": "volume", "volume_tolerance": 0.02}, "--criterion volume --tolerance 0.02"),
        ({"openings": "solid", "keep_cavities": True}, "--openings solid --keep-cavities"),
        ({"criterion": None, "threshold": None, "quality": None}, ""),
    ):
        words = shlex.split(ask(viewer, "POST", "/command", wanted).json["command"])
        assert words[:3] == ["rlacd", "decompose", str(mesh)]
        assert words[-2:] == ["-o", f"{NAME}_hulls.glb"]
        assert sorted(words[3:-2]) == sorted(said.split())


SPACE = {"criterion": "navigable", "radius": 0.05, "tolerance": 0.02, "quality": "fast"}


@pytest.mark.parametrize(
    ("wanted", "shown"),
    [
        ({"threshold": 1.9, "quality": "fast", "max_vertices": 12}, lambda scene: len(scene["parts"]) == 1),
        ({"criterion": "volume", "volume_tolerance": 5.0}, lambda scene: scene["report"]["volume"]["tolerance"] == 5.0),
        ({"primitives": True}, lambda scene: [part["primitive"] for part in scene["parts"]] == ["box", "box"]),
        ({"overlap": 0.04, "quality": "fast"}, lambda scene: scene["report"]["overlap"]["seams"] == 1),
        (SPACE, lambda scene: scene["report"]["navigable"]["balls"] == scene["balls"]["of"] > 0),
    ],
)
def test_what_is_asked_for_is_shown_and_is_what_the_command_gives(
    viewer: ViewServer, tmp_path: Path, wanted: dict[str, Any], shown: Callable[[Any], bool]
) -> None:
    settled(viewer, run=1)
    assert ask(viewer, "POST", "/decompose", wanted).status == 202
    settled(viewer, run=2)
    scene = ask(viewer, "GET", "/scene").json
    assert shown(scene)
    words = shlex.split(ask(viewer, "POST", "/command", wanted).json["command"])
    place = tmp_path / words[-1]
    run = CliRunner().invoke(app, [*words[1:-1], str(place)])
    assert run.exit_code == 0, run.output
    assert ask(viewer, "GET", "/download?format=glb").body == place.read_bytes()
    if wanted is SPACE:
        lines = ask(viewer, "GET", "/download?format=balls.csv").body.decode().splitlines()
        assert len(lines) == 1 + scene["balls"]["of"]


def test_what_is_not_there_is_reported(viewer: ViewServer, monkeypatch: pytest.MonkeyPatch) -> None:
    settled(viewer, run=1)
    assert "no balls" in ask(viewer, "GET", "/download?format=balls.csv").json["error"]
    monkeypatch.setitem(sys.modules, "pxr", None)
    (missing,) = (offer for offer in offered() if offer.missing)
    assert missing.name == "usd"
    for said in (str(missing.missing), ask(viewer, "GET", "/download?format=usd").json["error"]):
        assert "pip install 'rlacd[usd] @ git+https://github.com/rlacd/rlacd'" in said
    assert ask(viewer, "GET", "/nothing").status == 404
    assert ask(viewer, "POST", "/scene", {}).status == 404
    answer = ask(viewer, "GET", "/download?format=../../etc/passwd")
    assert answer.status == 400
    assert "choose one of glb" in answer.json["error"]


@pytest.mark.promise("viewer-private")
def test_pages_of_other_sites_are_turned_away(viewer: ViewServer) -> None:
    own = urllib.parse.urlsplit(viewer.address).netloc
    options = {"threshold": 1.9}
    settled(viewer, run=1)
    for method, path, headers, status in (
        ("GET", "/scene", {"Host": "evil.example"}, 403),
        ("POST", "/decompose", {"Host": "evil.example:80"}, 403),
        ("POST", "/decompose", {"Origin": "http://evil.example"}, 403),
        ("POST", "/decompose", {"Origin": "null"}, 403),
        ("POST", "/decompose", {"Content_Type": "text/plain"}, 415),
        ("GET", "/download?format=glb", {"Sec_Fetch_Site": "cross-site"}, 403),
        ("GET", "/scene", {"Sec_Fetch_Site": "same-site"}, 403),
        ("GET", "/scene", {"Origin": "http://localhost:1"}, 403),
        ("GET", "/", {"Sec_Fetch_Site": "cross-site", "Sec_Fetch_Mode": "navigate"}, 200),
    ):
        assert ask(viewer, method, path, options if method == "POST" else None, **headers).status == status, headers
    for headers, status in (
        ({"Origin": "http://evil.example"}, 403),
        ({"Content_Type": "text/plain"}, 415),
        ({"Content_Length": str(2**29)}, 413),
    ):
        assert post_file(viewer, "cube.stl", b"solid", **headers).status == status
    assert viewer.session.state.run == 1
    assert ask(viewer, "POST", "/decompose", options, Origin=f"http://{own}").status == 202


@pytest.mark.promise("viewer-private")
def test_no_other_machine_can_reach_it(viewer: ViewServer) -> None:
    port = port_of(viewer)
    assert viewer.address == f"http://127.0.0.1:{port}/"
    assert viewer.socket.getsockname() == ("127.0.0.1", port)
    outward = [info[4][0] for info in socket.getaddrinfo(socket.gethostname(), port, socket.AF_INET)]
    for address in outward:
        if not address.startswith("127."):
            with pytest.raises(OSError, match=r"refused|timed out|unreachable"):
                socket.create_connection((address, port), timeout=2.0).close()


def test_a_long_search_is_cancelled_and_keeps_what_it_has(mesh: Path, tmp_path: Path) -> None:
    rough = trimesh.creation.icosphere(3)
    rough.vertices *= 1 + 0.25 * np.random.default_rng(0).random((len(rough.vertices), 1))
    rough.export(tmp_path / "rough.ply")
    with open_viewer(tmp_path / "rough.ply", {"threshold": 0.3, "quality": "fast"}, port=0) as viewer:
        settled(viewer, run=1)
        states = events(viewer)
        ask(viewer, "POST", "/decompose", {"threshold": 0.06, "quality": "best"})
        assert next(state for state in states if state["state"] == "working" and state["parts"] > 1)["stage"]
        assert ask(viewer, "POST", "/cancel", {}).status == 202
        settled(viewer, run=2)
        report = ask(viewer, "GET", "/scene").json["report"]
        assert report["stopped_by"] == "cancel"
        assert report["seconds"]["total"] < 60


def test_closing_ends_every_thread_and_page(mesh: Path) -> None:
    before = threading.active_count()
    with open_viewer(mesh, port=0) as viewer:
        states = events(viewer)
        next(states)
    assert [state["state"] for state in states][-1] == "closed"
    for _ in range(100):
        if threading.active_count() <= before:
            break
        threading.Event().wait(0.05)
    assert threading.active_count() <= before


def test_a_port_in_use_is_one_sentence_and_without_one_a_free_one_is_found(viewer: ViewServer, mesh: Path) -> None:
    port = port_of(viewer)
    with (
        pytest.raises(OptionError, match=f"port {port} is in use; choose another with --port"),
        open_viewer(mesh, port=port),
    ):
        pass
    with open_viewer(mesh) as one, open_viewer(mesh) as two:
        assert one.address != two.address
        assert ask(two, "GET", "/").status == 200


def test_the_controls_hold_the_defaults_of_the_command_line() -> None:
    controls, usual, space = read_controls({}), Options(), NavigableSpace()
    shared = (vars(usual).keys() & controls.keys()) - {"primitives"}
    assert len(shared) > 7
    for name in shared:
        assert controls[name] == getattr(usual, name)
    assert bool(controls["primitives"]) == bool(usual.primitives)
    assert (controls["radius"], controls["tolerance"]) == (space.radius, space.tolerance)
