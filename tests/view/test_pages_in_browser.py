"""The viewer and the report in a real browser: what is clicked is seen and true, and nothing is fetched."""

from __future__ import annotations

import io
import itertools
import os
import re
import shutil
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import trimesh
from click.testing import CliRunner

import rlacd
from rlacd.cli.main import app
from rlacd.viewer.server import ViewServer
from tests.view.viewing import open_viewer

Image = pytest.importorskip("PIL.Image", reason="the extra view is not installed")

NAMES = ("chromium", "chromium-browser", "google-chrome", "google-chrome-stable", "chrome")
WITHOUT_GPU = ["--use-gl=angle", "--use-angle=swiftshader", "--enable-unsafe-swiftshader"]
PATIENCE = 60_000  # milliseconds


def chromium() -> str:
    """Path of Chromium: $RLACD_CHROMIUM, or one on the path; skips where there is none."""
    found = os.environ.get("RLACD_CHROMIUM") or next(filter(None, map(shutil.which, NAMES)), None)
    if found is None:
        pytest.skip("no Chromium is installed (set RLACD_CHROMIUM to its path)")
    return found


class Watched:
    """A page with everything it complained of and asked for."""

    def __init__(self, context: Any) -> None:
        self.page = context.new_page()
        self.page.set_default_timeout(PATIENCE)
        self.complaints: list[str] = []
        self.requests: list[str] = []
        self.page.on("pageerror", lambda error: self.complaints.append(str(error)))
        self.page.on("console", self._on_console)
        self.page.on("request", lambda request: self.requests.append(request.url))

    def _on_console(self, message: Any) -> None:
        # Chromium itself warns of slow pixel reads, which only a test makes.
        if message.type in ("error", "warning") and "GPU stall" not in message.text:
            self.complaints.append(message.text)

    def outside(self, *own: str) -> list[str]:
        """What was asked of anyone but `own` addresses."""
        return [url for url in self.requests if not url.startswith((*own, "data:", "blob:"))]


@contextmanager
def open_browser(driver: Any, *arguments: str) -> Iterator[Any]:
    """Start Chromium, drawing in software unless told otherwise; skips where there is none."""
    path = chromium()
    # Containers run as root, where Chromium's sandbox does not start.
    alone = ["--no-sandbox"] if hasattr(os, "geteuid") and os.geteuid() == 0 else []
    browser = driver.chromium.launch(executable_path=path, args=[*(arguments or WITHOUT_GPU), *alone])
    try:
        yield browser
    finally:
        browser.close()


@contextmanager
def open_page(browser: Any, **options: Any) -> Iterator[Watched]:
    """Open an empty page that shares nothing with others; `options` are those of a browser context."""
    context = browser.new_context(viewport={"width": 1366, "height": 768}, **options)
    try:
        yield Watched(context)
    finally:
        context.close()


def pixels(page: Any) -> Any:
    """What the 3-D view shows, uint8 [H, W, 4]."""
    return np.asarray(Image.open(io.BytesIO(page.locator("#canvas").screenshot())).convert("RGBA"), dtype=np.int16)


def change(before: Any, after: Any) -> float:
    """Share of the pixels that look different."""
    return float((abs(before - after).max(axis=2) > 12).mean())


@pytest.fixture(scope="module")
def mesh(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A table: five boxes, five hulls."""
    boxes = [((-1, -0.6, 0.9), (1, 0.6, 1))]
    boxes += [((x, y, 0), (x + 0.12, y + 0.12, 0.9)) for x in (-1, 0.88) for y in (-0.6, 0.48)]
    path = tmp_path_factory.mktemp("pages") / "table.stl"
    trimesh.util.concatenate([trimesh.creation.box(bounds=bounds) for bounds in boxes]).export(path)
    return path


@contextmanager
def watched(browser: Any, viewer: ViewServer) -> Iterator[Watched]:
    """The viewer's page with its first hulls; in the end it complained of nothing, and asked nobody else."""
    with open_page(browser) as seen:
        seen.page.goto(viewer.address)
        wait_for_run(seen.page, 1)
        yield seen
        assert seen.complaints == []
        assert seen.outside(viewer.address) == []


@pytest.fixture
def viewer(mesh: Path) -> Iterator[ViewServer]:
    with open_viewer(mesh, {"quality": "fast"}, port=0) as viewer:
        yield viewer


@pytest.fixture(scope="module")
def driver() -> Iterator[Any]:
    playwright = pytest.importorskip("playwright.sync_api", reason="playwright is not installed")
    with playwright.sync_playwright() as driver:
        yield driver


@pytest.fixture(scope="module")
def browser(driver: Any) -> Iterator[Any]:
    with open_browser(driver) as browser:
        yield browser


@pytest.fixture
def seen(viewer: ViewServer, browser: Any) -> Iterator[Watched]:
    with watched(browser, viewer) as seen:
        yield seen


def wait_for_run(page: Any, run: int) -> None:
    page.wait_for_selector(f"body[data-run='{run}']")
    settle(page)


def settle(page: Any) -> None:
    """Wait until what was asked for is drawn."""
    page.evaluate("new Promise(done => requestAnimationFrame(() => requestAnimationFrame(done)))")


@contextmanager
def shown(browser: Any, mesh: trimesh.Trimesh, path: Path) -> Iterator[Watched]:
    """A page that shows another mesh."""
    mesh.export(path)
    with open_viewer(path, {"quality": "fast"}, port=0) as viewer, watched(browser, viewer) as seen:
        yield seen


def rows(page: Any) -> int:
    return int(page.locator("#parts tbody tr").count())


@pytest.mark.slow
def test_the_hulls_are_seen_listed_and_downloaded(seen: Watched, viewer: ViewServer, tmp_path: Path) -> None:
    page = seen.page
    faces = viewer.session.result[1].report.triangles
    assert page.title() == "table: 5 hulls"
    assert page.locator("#name").inner_text() == "table"
    assert page.locator("#summary").inner_text().startswith(f"5 hulls · {faces} triangles · concavity")
    assert page.locator("#notes").is_hidden()
    assert re.fullmatch(r"[\d.]+\sunits", page.locator("#scalebar span").inner_text())
    assert rows(page) == 5
    assert page.locator(":is(#openings, #cavities):visible").count() == 0, "nothing is asked of closed meshes"
    colors = {tuple(color) for color in pixels(page).reshape(-1, 4)[::7].tolist()}
    assert len(colors) > 50
    with page.expect_download() as found:
        page.click("button[data-format='glb']")
    assert found.value.suggested_filename == "table_hulls.glb"
    found.value.save_as(tmp_path / "hulls.glb")
    assert len(trimesh.load_scene(tmp_path / "hulls.glb").geometry) == 5


@pytest.mark.nightly
def test_every_control_decomposes_again_and_a_bad_value_is_said(seen: Watched, viewer: ViewServer) -> None:
    page = seen.page

    def pressed(place: str, key: str) -> None:
        page.locator(place).focus()
        page.keyboard.press(key)

    def typed(place: str, text: str) -> None:
        page.fill(place, text)
        pressed(place, "Enter")

    assert page.locator(":is(#volume_tolerance, #radius, #balls, #openings):visible").count() == 0
    steps: list[tuple[Callable[[], Any], str, Any, str, str]] = [
        (lambda: page.select_option("#preset", "mujoco"), "preset", "mujoco", "#preset-note", "64 vertices"),
        (lambda: page.check("#shapes input[value=primitives]"), "preset", "mujoco", "#summary", "5 primitives"),
        (lambda: pressed("#overlap", "End"), "overlap", 0.1, "#summary", "5 primitives"),
        (lambda: pressed("#overlap", "Home"), "overlap", 0, ".length:has(#overlap)", "none"),
        (lambda: page.check("#shapes input[value=hulls]"), "preset", "mujoco", "#summary", "5 hulls"),
        (lambda: typed("#threshold-number", "1.9"), "threshold", 1.9, "#summary", "1 hull"),
        (lambda: pressed("#threshold", "Home"), "threshold", 0.01, "#summary", "5 hulls"),
        (lambda: page.check("#criterion input[value=volume]"), "criterion", "volume", "#summary", "of volume added"),
        (lambda: typed("#volume_tolerance-number", "5"), "criterion", "volume", "#summary", "2 hulls"),
        (lambda: page.check("#criterion input[value=navigable]"), "preset", "mujoco", "#summary", "left free"),
    ]
    for run, (act, option, value, place, text) in enumerate(steps, start=2):
        act()
        wait_for_run(page, run)
        assert viewer.session.result[1].report.options[option] == (value and pytest.approx(value)), option
        assert text in page.locator(place).inner_text()
    assert page.locator("#download .suited").inner_text() == "MJCF"
    assert page.locator("#threshold").is_hidden()
    plain = pixels(page)
    page.locator("#balls").click()
    settle(page)
    assert change(plain, pixels(page)) > 0.005
    before = rows(page)
    typed("#radius-number", "-3")
    page.wait_for_selector("#trouble:not([hidden])")
    assert "radius is -3" in page.locator("#trouble").inner_text()
    assert rows(page) == before
    assert "400" in seen.complaints.pop(), "the browser itself notes the refusal"


@pytest.mark.nightly
def test_another_mesh_is_dropped_and_shown(seen: Watched, viewer: ViewServer, tmp_path: Path) -> None:
    page = seen.page
    ball = trimesh.creation.icosphere(1).export(file_type="glb")
    sent = page.evaluate_handle(
        """bytes => {
          const files = new DataTransfer();
          files.items.add(new File([new Uint8Array(bytes)], "ball.glb"));
          return files;
        }""",
        list(ball),
    )
    page.dispatch_event("body", "dragenter", {"dataTransfer": sent})
    assert page.locator("#drop").is_visible()
    page.dispatch_event("body", "drop", {"dataTransfer": sent})
    assert page.locator("#drop").is_hidden()
    wait_for_run(page, 2)
    assert page.title() == "ball: 1 hull"
    assert page.locator("#up input:checked").get_attribute("value") == "y"
    assert re.fullmatch(r"[\d.]+\sm", page.locator("#scalebar span").inner_text())
    (tmp_path / "words.stl").write_text("no mesh")
    page.set_input_files("#file", tmp_path / "words.stl")
    page.wait_for_selector("#trouble:not([hidden])")
    assert "words.stl" in page.locator("#trouble").inner_text()
    assert rows(page) == 1
    assert "400" in seen.complaints.pop()


@pytest.mark.nightly
def test_the_command_is_copied(viewer: ViewServer, mesh: Path, browser: Any) -> None:
    with open_page(browser, permissions=["clipboard-read", "clipboard-write"]) as watched:
        page = watched.page
        page.goto(viewer.address)
        wait_for_run(page, 1)
        page.click("#copy")
        page.wait_for_selector("#copy:has-text('Copied')")
        copied = page.evaluate("navigator.clipboard.readText()")
        assert copied == f"rlacd decompose {mesh} --quality fast -o table_hulls.glb"


@pytest.mark.nightly
def test_nothing_covers_the_model_on_a_phone_and_no_button_stands_alone(seen: Watched) -> None:
    page = seen.page
    page.evaluate("document.getElementById('balls').hidden = false")  # the widest that it gets
    each = "[...document.getElementById('toolbar').children]"
    bottoms = f"{each}.map(one => Math.round(one.getBoundingClientRect().bottom))"
    for width, one_row in [(1440, True), (1280, True), (1180, False), (1024, False), (900, False), (390, False)]:
        page.set_viewport_size({"width": width, "height": 800})
        settle(page)
        found = page.evaluate(bottoms)
        assert min(map(found.count, found)) > 1, width
        assert not one_row or len(set(found)) == 1, width
    stage, toolbar = page.locator("#stage").bounding_box(), page.locator("#toolbar").bounding_box()
    assert toolbar["y"] >= stage["y"] + stage["height"] - 1
    assert page.evaluate("document.documentElement.scrollWidth") <= 390


@pytest.mark.nightly
def test_hulls_that_share_a_face_do_not_flicker(browser: Any, tmp_path: Path) -> None:
    beams = [trimesh.creation.box(size) for size in ((2, 0.5, 0.2), (0.5, 2, 0.2))]
    with shown(browser, trimesh.boolean.union(beams, engine="manifold"), tmp_path / "cross.ply") as watched:
        page = watched.page
        assert rows(page) == 2, "two beams that lie in each other"
        page.locator("#edges").click()
        page.locator("#canvas").focus()
        for _ in range(8):
            page.keyboard.press("ArrowLeft")
            settle(page)
            seen = pixels(page)
            high, wide = seen.shape[0] // 2, seen.shape[1] // 2
            shared = seen[high - 55 : high - 35, wide - 20 : wide + 20].reshape(-1, 4)
            assert (abs(shared - shared[0]).max(axis=1) < 12).all()


@pytest.mark.nightly
def test_rows_and_hulls_point_at_each_other(seen: Watched) -> None:
    page = seen.page
    plain = pixels(page)
    page.hover("[data-part='0']")
    settle(page)
    assert change(plain, pixels(page)) > 0.001
    frame = page.locator("#canvas").bounding_box()
    page.mouse.move(frame["x"] + frame["width"] / 2, frame["y"] + frame["height"] * 0.42)
    page.wait_for_selector("#tooltip:not([hidden])")
    part = re.match(r"hull (\d+)", page.locator("#tooltip").inner_text())
    assert page.locator("tr.hover").get_attribute("data-part") == str(int(part[1]))
    page.mouse.down()
    page.mouse.up()
    assert page.locator("tr[aria-selected='true']").get_attribute("data-part") == str(int(part[1]))
    settle(page)
    assert change(plain, pixels(page)) > 0.02, "the others are ghosts"
    page.keyboard.press("Escape")
    assert page.locator("tr[aria-selected='true']").count() == 0


@pytest.mark.nightly
def test_the_list_is_walked_and_sorted_by_keyboard(seen: Watched) -> None:
    page = seen.page
    page.locator("#parts tbody tr").first.focus()
    page.keyboard.press("ArrowDown")
    page.keyboard.press("End")
    page.keyboard.press("Enter")
    assert page.locator("tr[aria-selected='true']").get_attribute("data-part") == "4"
    page.get_by_role("button", name="Volume").click()
    shares = [float(text.split()[0]) for text in page.locator("#parts tbody td:nth-child(3)").all_inner_texts()]
    assert shares == sorted(shares, reverse=True)
    assert page.locator("th[aria-sort='descending']").inner_text().startswith("Volume")


def test_a_laptop_shows_ten_rows(browser: Any, tmp_path: Path) -> None:
    """Also of what has open bodies and closed cavities, about which there are controls."""
    inner, tray = trimesh.creation.box(extents=(0.8, 0.8, 0.8)), trimesh.creation.box().apply_translation((2, 0, 0))
    inner.invert()
    tray.update_faces(tray.face_normals[:, 2] < 0.5)
    with shown(browser, trimesh.creation.box() + inner + tray, tmp_path / "both.ply") as watched:
        page = watched.page
        assert page.locator("#openings").is_visible()
        assert page.locator("#cavities").is_visible()
        page.set_viewport_size({"width": 1366, "height": 800})
        height = page.locator("#list tbody tr").first.bounding_box()["height"]
        place = page.locator("#list").bounding_box()
        head = page.locator("#list thead").bounding_box()
        assert min(place["y"] + place["height"], 800) - (head["y"] + head["height"]) >= 10 * height
        assert rows(page) >= 6
        assert page.locator("#notes").inner_text() == "1 open body became a thin shell"
        page.check("#openings input[value=solid]")
        wait_for_run(page, 2)
        assert rows(page) == 2
        page.check("#cavities input[value=keep]")
        wait_for_run(page, 3)
        assert rows(page) == 7


@pytest.mark.slow
def test_figures_are_those_of_the_command_and_all_stays_in_the_frame(seen: Watched, mesh: Path, tmp_path: Path) -> None:
    page = seen.page
    page.fill("#threshold-number", "0.4")
    page.keyboard.press("Enter")
    wait_for_run(page, 2)
    words = ["decompose", str(mesh), "-o", str(tmp_path / "hulls.glb"), "--quality", "fast", "--threshold", "0.4"]
    said = re.search(r"concavity at most ([\d.]+)", CliRunner().invoke(app, words).output)
    assert said is not None
    figure = page.locator("#summary").inner_text().split("concavity at most\u00a0")[1].split()[0]
    listed = page.locator("#parts tbody td:nth-child(4)").all_inner_texts()
    assert float(figure) == pytest.approx(float(said[1]), rel=0.006) == pytest.approx(max(map(float, listed)), rel=0.06)
    page.set_viewport_size({"width": 900, "height": 1000})  # the sides are nearest
    page.wait_for_function("innerWidth === 900")
    settle(page)
    page.locator("#explode").focus()
    page.keyboard.press("End")
    page.locator("#explode").blur()
    settle(page)
    scene = pixels(page)
    assert abs(np.diff(scene[:, [0, -1]], axis=0)).max() <= 3, "the sides show nothing but the background"
    assert len({tuple(color) for color in scene.reshape(-1, 4)[::7].tolist()}) > 50


@pytest.mark.nightly
def test_the_view_is_turned_pulled_apart_and_made_of_glass(seen: Watched) -> None:
    page = seen.page
    looks = [pixels(page)]
    # Turned, pulled apart, hulls off and the input solid, hulls of glass.
    for place, keys in (("#canvas", ["ArrowLeft"] * 6), ("#explode", ["ArrowRight"] * 60), ("body", ["g", "i"])):
        page.locator(place).focus()
        for key in keys:
            page.keyboard.press(key)
        settle(page)
        looks.append(pixels(page))
    page.keyboard.press("g")
    settle(page)
    looks.append(pixels(page))
    assert float(page.locator("#explode").input_value()) == pytest.approx(0.6)
    assert min(change(a, b) for a, b in itertools.pairwise(looks)) > 0.01
    assert page.locator("#up legend").inner_text() == "Up (a guess)"
    page.check("#up input[value=x]")
    settle(page)
    assert change(looks[-1], pixels(page)) > 0.05
    page.keyboard.press("?")
    assert page.locator("#help").is_visible()
    assert "pull apart" in page.locator("#help").inner_text()
    page.keyboard.press("Escape")
    assert page.locator("#help").is_hidden()


@pytest.mark.nightly
def test_a_server_that_stops_is_reported(browser: Any, mesh: Path) -> None:
    with open_page(browser) as watched:
        with open_viewer(mesh, port=0) as viewer:
            watched.page.goto(viewer.address)
            wait_for_run(watched.page, 1)
        watched.page.wait_for_selector("#trouble:not([hidden])")
        assert "rlacd view" in watched.page.locator("#trouble").inner_text()


@pytest.mark.nightly
def test_a_browser_without_3d_graphics_still_lists_and_says_so(report: Path, driver: Any) -> None:
    with open_browser(driver, "--disable-3d-apis") as poor, open_page(poor) as watched:
        watched.page.goto(report.as_uri())
        watched.page.wait_for_selector("body[data-ready]")
        assert "cannot show 3-D graphics" in watched.page.locator("#trouble").inner_text()
        assert rows(watched.page) == 1


@pytest.fixture(scope="module")
def report(mesh: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    pytest.importorskip("mitsuba", reason="the extra view is not installed")
    return rlacd.decompose(mesh, threshold=1.0).save_report(tmp_path_factory.mktemp("report") / "a report.html")


@pytest.mark.nightly
def test_the_report_opens_from_disk_without_a_network(browser: Any, report: Path) -> None:
    with open_page(browser, offline=True) as watched:
        page = watched.page
        page.goto(report.as_uri())
        page.wait_for_selector("body[data-ready]")
        settle(page)
        assert page.locator("#name").inner_text() == "table"
        assert rows(page) == 1
        assert page.locator("#controls").count() == page.locator("#download").count() == 0
        for title in ("Fit", "Repair", "Time", "Options"):
            assert page.get_by_role("heading", name=title, exact=True).is_visible()
        assert page.evaluate("document.querySelector('figure img').naturalWidth") > 1000
        plain = pixels(page)
        page.locator("#heat").click()
        page.wait_for_selector("#legend:not([hidden])")
        settle(page)
        assert change(plain, pixels(page)) > 0.05
        assert watched.complaints == []
        assert watched.outside(report.as_uri()) == []
