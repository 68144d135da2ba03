"""Draw every picture of README and docs anew: what ``make pictures`` runs.

    python examples/pictures.py docs MESHES

MESHES holds V-HACD's and CoACD's examples, as `test/vhacd` and `test/coacd_examples`. Needs the extras ``view`` and
``sim``, the packages coacd and playwright, and Chromium (on the path, or RLACD_CHROMIUM). No picture shows a time.
"""

from __future__ import annotations

import io
import json
import os
import shutil
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from tempfile import TemporaryDirectory

import furnished_room
import gallery
import mug
import numpy as np
import tight_fits
import trimesh
from PIL import Image, ImageDraw, ImageFont
from playwright.sync_api import sync_playwright
from sample import sample

import rlacd
from rlacd.result import Result
from rlacd.viewer.picture import picture_bytes


def main(docs: Path, meshes: Path) -> None:
    """Draw them all into the folder of the documentation."""
    with step("the chair of make demo, and its boxes"), TemporaryDirectory() as folder:
        mesh = Path(folder) / "chair.glb"
        sample().export(mesh)
        hulls, boxes = rlacd.decompose(mesh), rlacd.decompose(mesh, primitives="all")
        (docs / "demo.png").write_bytes(picture_bytes(hulls, clear=True))
        (docs / "primitives.png").write_bytes(picture_bytes(boxes, width=1200, clear=True))
    with step("a mug on a peg"), TemporaryDirectory() as folder:
        mug.draw(mug.main(Path(folder)), docs / "mug.png")
    with step("furnished rooms"), TemporaryDirectory() as folder:
        furnished_room.main(Path(folder))
        for picture in Path(folder).glob("*.png"):
            shutil.copy(picture, docs)
    with step("a tight fit"):
        tight_fits.main(docs / "tight_fits.webp")
    with step("open bodies"):
        stacked([panels(rlacd.decompose(body)) for body in open_bodies()]).save(docs / "open_bodies.webp", quality=80)
    with step("a kettle by CoACD and by rlacd"):
        stacked(kettles(meshes / "test/coacd_examples/Kettle.ply")).save(docs / "side_by_side.webp", quality=80)
    with step("what two threads do"):
        traced(meshes / "test/vhacd/beshon.ply").save(docs / "threads.png", optimize=True)
    with step("the viewer"):
        shoot_viewer(docs)
    with step("the gallery"):
        gallery.main(meshes, docs / "gallery_objects")


@contextmanager
def step(what: str) -> Iterator[None]:
    """Print a line for what is drawn."""
    print(f"drawing {what} ...", flush=True)
    yield


def panels(result: Result, up: str = "z") -> Image.Image:
    """The input, its hulls, and the hulls pulled apart, on white."""
    drawn = Image.open(io.BytesIO(picture_bytes(result, width=900, up=up, clear=True)))
    return Image.alpha_composite(Image.new("RGBA", drawn.size, "white"), drawn).convert("RGB")


def stacked(rows: list[Image.Image]) -> Image.Image:
    """Pictures of one width, one above the other."""
    sheet = Image.new("RGB", (rows[0].width, sum(row.height for row in rows)), "white")
    for number, row in enumerate(rows):
        sheet.paste(row, (0, sum(above.height for above in rows[:number])))
    return sheet


def open_bodies() -> Iterator[trimesh.Trimesh]:
    """A ball with holes, a box without its lid, a bottle, a cup and a lampshade."""
    ball = trimesh.creation.icosphere(3)
    ball.update_faces(np.arange(len(ball.faces)) % 97 != 0)
    yield ball
    box = trimesh.creation.box((1.6, 1.0, 1.0)).subdivide().subdivide()
    yield box.submesh([np.flatnonzero(box.triangles_center[:, 2] < 0.49)], append=True)
    for profile in (
        [(0.0, 0.0), (0.3, 0.0), (0.3, 0.7), (0.1, 0.95), (0.1, 1.2)],
        [(0.0, 0.0), (0.35, 0.0), (0.45, 0.9)],
        [(0.5, 0.0), (0.25, 0.6)],
    ):
        turned = trimesh.creation.revolve(np.array(profile), sections=32)
        turned.merge_vertices()
        yield turned


def kettles(path: Path) -> list[Image.Image]:
    """CoACD's kettle by CoACD and by rlacd, both with their default options."""
    import coacd  # only here, since Mitsuba does not find its plugins in a process that has loaded it

    own = rlacd.decompose(path)
    coacd.set_log_level("error")
    theirs = coacd.run_coacd(coacd.Mesh(own.source.vertices, own.source.faces), seed=0)
    hulls = [trimesh.Trimesh(vertices, faces, process=False) for vertices, faces in theirs]
    rows = []
    for name, result in (("CoACD", replace(Result.of(hulls, own.source), input=own.input)), ("rlacd", own)):
        row = panels(result, up="y")
        text = f"{name}: {len(result)} hulls, {sum(len(hull.faces) for hull in result):,} triangles"
        ImageDraw.Draw(row).text((24, 20), text, font=ImageFont.load_default(size=22), fill="black")
        rows.append(row)
    return rows


def traced(path: Path) -> Image.Image:
    """A row for each thread of a decomposition and a colour for each stage, grey where the first thread waits."""
    with TemporaryDirectory() as folder:
        os.environ["RLACD_TRACE"] = file = str(Path(folder) / "trace.json")
        rlacd.decompose(path, threads=2)
        del os.environ["RLACD_TRACE"]
        spans = sorted(json.loads(Path(file).read_text())["traceEvents"], key=lambda span: span["ts"])
    whole, others = spans[0], sorted({span["tid"] for span in spans} - {spans[0]["tid"]})
    stages = list(dict.fromkeys(span["name"] for span in spans if span["cat"] == "stage"))
    colours = {stage: f"hsl({i * 300 // len(stages)}, 65%, 55%)" for i, stage in enumerate(stages)}
    image = Image.new("RGB", (1600, 50 * (2 + len(others))), "white")
    draw, font = ImageDraw.Draw(image), ImageFont.load_default(size=22)
    for span in spans:
        if span["cat"] in ("stage", "item", "begun", "wait"):
            row = [whole["tid"], *others].index(span["tid"])
            left, right = (1600 * (at - whole["ts"]) / whole["dur"] for at in (span["ts"], span["ts"] + span["dur"]))
            colour = "lightgrey" if span["cat"] == "wait" else colours.get(span["name"], "white")
            draw.rectangle((left, 50 * row, max(left, right - 1), 50 * row + 40), fill=colour)
    for i, stage in enumerate(stages):
        draw.text((20 + i * 1580 // len(stages), image.height - 40), stage, font=font, fill=colours[stage])
    return image


def shoot_viewer(docs: Path) -> None:
    """The viewer with the chair: pulled apart, its error, the balls that fit between its hulls."""
    with TemporaryDirectory() as folder, sync_playwright() as driver:
        mesh = Path(folder) / "chair.glb"
        sample().export(mesh)
        path = os.environ.get("RLACD_CHROMIUM") or shutil.which("chromium")
        browser = driver.chromium.launch(executable_path=path, args=["--no-sandbox", "--use-angle=swiftshader"])
        for name, options, key in (
            ("viewer", {}, "]"),
            ("viewer_error", {"threshold": 0.15, "quality": "fast"}, "h"),
            ("viewer_balls", {"criterion": "navigable", "quality": "fast"}, "b"),
        ):
            with rlacd.view(mesh, port=0, **options) as viewer:
                page = browser.new_page(viewport={"width": 1440, "height": 900})
                page.goto(viewer.address)
                page.wait_for_selector("body[data-run='1']", timeout=120_000)
                for _ in range(6 if key == "]" else 1):
                    page.keyboard.press(key)
                page.evaluate(WITHOUT_TIME)
                page.wait_for_timeout(500)
                page.screenshot(path=docs / f"{name}.png")
                page.close()
        browser.close()


WITHOUT_TIME = "const words = document.querySelector('#summary'); words.lastChild.remove(); words.lastChild.remove()"
"""Takes how long it took, and the dot before it, off the page."""


if __name__ == "__main__":
    main(Path(sys.argv[1]), Path(sys.argv[2]))
