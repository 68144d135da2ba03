"""Pages of results: what they show, and the commands that make them, on meshes small enough to be quick."""

from __future__ import annotations

import csv
import json
import re
import subprocess
import sys
from html.parser import HTMLParser
from pathlib import Path
from typing import Any

import pytest
import trimesh
from benchmarks.__main__ import app
from benchmarks.arms import ARMS, LARGEST_WEIGHT, _options, train_arms
from benchmarks.charts import Curve, curves_chart, pareto_chart, pareto_front
from benchmarks.page import Code, Figure, Heading, Page, Text
from benchmarks.sheets import draw_sheet
from benchmarks.tables import Table
from typer.testing import CliRunner

from rlacd.errors import OptionError
from tests.shapes import box, from_manifold

CROSS = box((-1, -0.2, -0.2), (1, 0.2, 0.2)) + box((-0.2, -1, -0.2), (0.2, 1, 0.2))
ELL = box((0, 0, 0), (2, 0.3, 1)) + box((0, 0, 0), (0.3, 1.5, 1))


@pytest.fixture
def meshes(tmp_path: Path) -> Path:
    folder = tmp_path / "meshes"
    folder.mkdir()
    for name, solid in {"cross.stl": CROSS, "ell.obj": ELL}.items():
        mesh = from_manifold(solid)
        trimesh.Trimesh(mesh.vertices, mesh.faces, process=False).export(folder / name)
    return folder


def bench(*words: object, code: int = 0) -> str:
    result = CliRunner().invoke(app, [*map(str, words)])
    assert result.exit_code == code, result.output
    return result.output


class Balanced(HTMLParser):
    """Checks that every tag is closed."""

    def __init__(self) -> None:
        super().__init__()
        self.open: list[str] = []
        self.seen: list[str] = []

    def handle_starttag(self, tag: str, attrs: Any) -> None:
        self.seen.append(tag)
        if tag not in ("meta", "img"):
            self.open.append(tag)

    def handle_endtag(self, tag: str) -> None:
        assert self.open.pop() == tag


class TestPage:
    PAGE = Page(
        "A < B",
        [
            Text("one & two"),
            Text("- a\n- b"),
            Heading("Part"),
            Code("rlacd <x>"),
            Table(["a", "b"], [["<b>", 1]], "note"),
            Figure("p.svg", b"<svg/>", 'says "x"'),
        ],
    )

    def test_markdown_and_html_hold_everything(self, tmp_path: Path) -> None:
        written = {path.name for path in self.PAGE.save(tmp_path, "page")}
        assert written == {"page.md", "page.html", "p.svg"}
        text = (tmp_path / "page.md").read_text()
        assert "# A < B" in text
        assert "| <b> | 1 |" in text
        assert '![says "x"](p.svg)' in text
        assert (tmp_path / "p.svg").read_bytes() == b"<svg/>"

    def test_html_is_one_file_and_well_formed(self, tmp_path: Path) -> None:
        self.PAGE.save(tmp_path, "page")
        text = (tmp_path / "page.html").read_text()
        parser = Balanced()
        parser.feed(text)
        assert not parser.open
        assert "b" not in parser.seen, "cells are text"
        assert "data:image/svg+xml;base64," in text
        assert "script" not in parser.seen
        assert "http" not in text


class TestCharts:
    def test_front(self) -> None:
        assert pareto_front([(1, 5), (2, 2), (3, 3), (5, 1), (2, 2)]) == [0, 1, 3, 4]

    def test_the_same_bytes_every_time(self) -> None:
        def drawn() -> tuple[bytes, bytes]:
            points = [("a", 1.0, 2.0), ("b", 2.0, 1.0)]
            return curves_chart([Curve("a", [3, 1], [1, 2])], "x", "y", log_y=True), pareto_chart(points, "x", "y")

        assert drawn() == drawn()
        assert all(b"<svg" in picture for picture in drawn())


def test_a_sheet_has_a_panel_for_the_input_and_each_method(meshes: Path) -> None:
    pytest.importorskip("mitsuba")
    from io import BytesIO

    from PIL import Image

    row = {"parts": 1, "hausdorff": 0.1, "faces": 12, "cpu": 0.5}
    hull = from_manifold(CROSS.hull())
    content = draw_sheet(meshes / "cross.stl", [("one", [(hull.vertices, hull.faces)], row)] * 2, samples=1)
    image = Image.open(BytesIO(content)).convert("RGB")
    assert image.width == 3 * 340
    panels = [image.crop((i * 340, 60, (i + 1) * 340, 340)) for i in range(3)]
    colours = [len(panel.getcolors(1 << 20) or []) for panel in panels]
    assert min(colours) > 10, "something is drawn in each"


class TestCommands:
    @pytest.mark.nightly
    def test_compare(self, meshes: Path, tmp_path: Path) -> None:
        out = tmp_path / "run"
        bench("compare", meshes, "--out", out, "--methods", "greedy,navacd", "--pictures", 0)
        text = (out / "compare.md").read_text()
        assert "| greedy @ 0.05 |" in text
        assert "| 2 meshes | #P |" in text
        rows = list(csv.DictReader((out / "results.csv").open()))
        assert {(row["mesh"], row["method"]) for row in rows} == {
            (mesh, method) for mesh in ("cross.stl", "ell.obj") for method in ("greedy", "navacd")
        }
        assert all(float(row["hausdorff"]) < 0.06 for row in rows)
        before = (out / "results.jsonl").read_text()
        bench("compare", meshes, "--out", out, "--methods", "greedy,navacd", "--pictures", 0)
        assert (out / "results.jsonl").read_text() == before

    @pytest.mark.nightly
    def test_equal_accuracy(self, meshes: Path, tmp_path: Path) -> None:
        out = tmp_path / "run"
        bench("paper-table-1", meshes, "-o", out, "--first", 1, "--methods", "navacd", "--at", 0.3)
        text = (out / "paper-table-1.md").read_text()
        assert "Mean D_h 0.3" in text
        assert (out / "curves.svg").exists()
        assert "44.2" in text, "the paper's numbers stand beside ours"

    @pytest.mark.nightly
    def test_vhacd_gets_as_many_hulls(self, meshes: Path, tmp_path: Path) -> None:
        pytest.importorskip("vhacdx")
        out = tmp_path / "run"
        bench("paper-vhacd", meshes, "-o", out, "--reference", "greedy")
        rows = [json.loads(line) for line in (out / "results.jsonl").read_text().splitlines()]
        ours = {row["mesh"]: row["parts"] for row in rows if row["method"] == "greedy"}
        theirs = {row["mesh"]: row for row in rows if row["method"] == "vhacdx:hulls"}
        assert len(theirs) == 2
        assert all(row["setting"] == ours[mesh] and row["parts"] <= ours[mesh] for mesh, row in theirs.items())

    @pytest.mark.nightly
    def test_tables_2_and_3(self, meshes: Path, tmp_path: Path) -> None:
        out = tmp_path / "run"
        bench("paper-table-2", meshes, "-o", out, "--first", 1, "--ranking", "excess")
        assert "without PCA planes" in (out / "paper-table-2.md").read_text()
        bench("paper-table-3", meshes, "-o", out, "--first", 1, "--planes", "1,150", "--edges", "0")
        text = (out / "paper-table-3.md").read_text()
        assert all(f"| {label} |" in text for label in ("#AP 1, #CE 4", "#AP 150, #CE 4", "#AP 10, #CE 0"))

    @pytest.mark.parametrize(
        ("words", "says"),
        [
            (["compare", "nowhere", "-o", "run"], "is not a folder"),
            (["compare", ".", "-o", "run", "--list", "nowhere.txt"], "does not exist"),
            (["compare", ".", "-o", "run"], "there are no meshes"),
            (["paper-table-3", "meshes", "-o", "run", "--planes", "a,b"], "whole numbers"),
            (["compare", "meshes", "-o", "run", "--methods", "gredy"], "there is no method"),
            (["compare", "meshes", "-o", "run", "--methods", ","], "name at least one"),
            (["paper-rewards", "meshes", "-o", "run", "--preset", "x"], "preset"),
            (["paper-discounts", "nowhere", "-o", "run"], "is not a folder"),
        ],
    )
    def test_wrong_options_are_one_sentence(
        self, words: list[str], says: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        monkeypatch.chdir(tmp_path)
        (tmp_path / "meshes").mkdir()
        mesh = from_manifold(CROSS)
        if says != "there are no meshes":
            trimesh.Trimesh(mesh.vertices, mesh.faces, process=False).export(tmp_path / "meshes" / "cross.stl")
        told = bench(*words, code=2)
        assert says in told
        assert len(told.strip().splitlines()) == 1

    def test_a_listed_mesh_that_is_missing(self, meshes: Path, tmp_path: Path) -> None:
        (tmp_path / "list.txt").write_text("cross.stl\nno.stl\n")
        assert "no.stl" in bench("compare", meshes, "-o", tmp_path / "run", "--list", tmp_path / "list.txt", code=2)


class TestResultsInTheDocs:
    """docs/research/results.md shows tables that commands printed, and no others."""

    ROOT = Path(__file__).resolve().parents[1]

    def test_every_table_says_where_it_comes_from(self) -> None:
        document = (self.ROOT / "docs" / "research" / "results.md").read_text()
        places = re.compile(r"<!-- \S+\.md, table \d+ -->\n.*?<!-- end -->", re.DOTALL)
        assert len(places.findall(document)) > 5
        assert "|---" not in places.sub("", document)

    def test_tables_are_put_in_their_place(self, tmp_path: Path) -> None:
        (tmp_path / "run" / "quick").mkdir(parents=True)
        pages = {"compare.md": "# A\n\n| a |\n|---|\n| 1 |\n\ntext\n\n| b |\n|---|\n| 2 |\n", "curves.svg": "<svg/>"}
        for name, text in pages.items():
            (tmp_path / "run" / "quick" / name).write_text(text)
        document = tmp_path / "results.md"
        document.write_text("before\n<!-- quick/compare.md, table 2 -->\nold\n<!-- end -->\nafter\n")
        command = [sys.executable, self.ROOT / "benchmarks" / "results.py", tmp_path / "run", document]
        for _ in range(2):  # the second time nothing changes
            subprocess.run(command, check=True)
            expected = "before\n<!-- quick/compare.md, table 2 -->\n\n| b |\n|---|\n| 2 |\n\n<!-- end -->\nafter\n"
            assert document.read_text() == expected
        document.write_text("<!-- quick/compare.md, table 3 -->\n<!-- end -->\n")
        told = subprocess.run(command, capture_output=True, text=True)
        assert told.returncode == 1
        assert "has 2 tables, not 3" in told.stderr


class TestArms:
    @pytest.mark.parametrize("experiment", ARMS)
    def test_arms_differ_in_what_they_say_only(self, experiment: str) -> None:
        for preset in ("quick", "counting"):
            arms = [_options(preset, 100, 1, changes) for changes in ARMS[experiment].values()]
            assert len(set(arms)) == len(arms)
        assert {(a.iterations, a.seed, a.warmup, a.validate_every) for a in arms} == {(100, 1, 20, 50)}

    def test_weights_have_the_ratio(self) -> None:
        for label, changes in ARMS["paper-rewards"].items():
            if label.startswith("λ1/λ2"):
                options = _options("quick", 100, 0, changes)
                ratio = options.volume_reward / options.finish_reward
                assert ratio == pytest.approx(float(label.rpartition("=")[2]))
                assert max(options.volume_reward, options.finish_reward) == LARGEST_WEIGHT

    def test_without_the_hull_the_features_do_not_depend_on_it(self) -> None:
        torch = pytest.importorskip("torch")
        from rlacd.learn.encoders import make_encoder

        points, directions = torch.rand(3, 2, 64, 3) * 2 - 1, torch.eye(3).repeat(3, 2, 1)
        other = points.clone()
        other[:, 1] = torch.rand(3, 64, 3) * 2 - 1
        alone, both = make_encoder("profile-without-hull"), make_encoder("profile")
        assert torch.equal(alone.encode(points, directions), alone.encode(other, directions))
        assert not torch.equal(both.encode(points, directions), both.encode(other, directions))
        assert alone.dim == both.dim

    def test_too_short(self, tmp_path: Path) -> None:
        with pytest.raises(OptionError, match="at least 2"):
            train_arms("paper-curves", tmp_path, tmp_path, "quick", 1)

    @pytest.mark.nightly
    def test_arms_are_trained_once(self, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
        pytest.importorskip("torch")
        folder = tmp_path / "meshes"
        folder.mkdir()
        for number in range(6):
            mesh = from_manifold(CROSS + box((0, 0, 0), (0.3 + 0.1 * number, 0.4, 1)))
            trimesh.Trimesh(mesh.vertices, mesh.faces, process=False).export(folder / f"{number}.stl")
        said: list[str] = []
        page = train_arms("paper-curves", folder, tmp_path / "run", "quick", 40, seeds=2, say=said.append)
        table = next(block for block in page.blocks if isinstance(block, Table))
        assert [line[0] for line in table.lines] == list(ARMS["paper-curves"])
        assert all(float(str(line[1]).partition(" ± ")[0]) > 0 for line in table.lines)
        assert len({(tmp_path / "run" / f"paper-curves-1-seed-{s}" / "curves.jsonl").read_text() for s in (0, 1)}) == 2
        monkeypatch.setattr("rlacd.learn.paper.train.train", None)  # would fail if called
        again = train_arms("paper-curves", folder, tmp_path / "run", "quick", 40, seeds=2, say=said.append)
        assert again.markdown() == page.markdown()
