"""The benchmarks: methods in processes of their own, limits, results that survive, tables, equal accuracy."""

from __future__ import annotations

import inspect
import json
from importlib import import_module
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import numpy as np
import pytest
import trimesh
from benchmarks import compare, curves, robots, worst
from benchmarks.boxes import write_boxes
from benchmarks.methods import make_method, rlacd_options
from benchmarks.playback import seconds_on
from benchmarks.runner import Bench, Limits, find_meshes
from benchmarks.store import Task, save_row
from benchmarks.tables import Ratio, failures, managed, ratio_of
from click.testing import CliRunner

import rlacd
from rlacd.criteria import Concavity
from rlacd.cut import CutTree
from rlacd.pool import ProcessLimits
from rlacd.run import Run
from rlacd.solid.component import Component
from tests.shapes import box, from_manifold, trimesh_of

CROSS = box((-1, -0.2, -0.2), (1, 0.2, 0.2)) + box((-0.2, -1, -0.2), (0.2, 1, 0.2))
ROOT = Path(__file__).resolve().parents[1]


@pytest.fixture
def meshes(tmp_path: Path) -> Path:
    folder = tmp_path / "meshes"
    for name, solid in {"a/cross.stl": CROSS, "box.ply": box((0, 0, 0), (3, 1, 1))}.items():
        (folder / name).parent.mkdir(parents=True, exist_ok=True)
        trimesh_of(solid).export(folder / name)
    return folder


def bench_of(meshes: Path, folder: Path, **limits: Any) -> Bench:
    return Bench(meshes, find_meshes(meshes), folder, Limits(**limits), say=lambda _: None)


def run(app: Any, *words: object, code: int = 0) -> str:
    result = CliRunner().invoke(app, [*map(str, words)])
    assert result.exit_code == code, result.output
    return result.output


class TestMethods:
    def test_default_is_the_default(self) -> None:
        """What the tables call default is ``rlacd.decompose(mesh)``, with nothing but the number of threads."""
        assert rlacd_options("default") == {}
        mesh = from_manifold(CROSS.rotate((10, 20, 30)) + box((0, 0, 0), (0.3, 0.8, 1.2)))
        given = mesh.vertices, mesh.faces
        method = make_method("default")
        made, usual = method.run(*given, method.default, 1), rlacd.decompose(given)
        assert len(made) == len(usual) > 2
        for (vertices, faces), hull in zip(made, usual, strict=True):
            assert np.array_equal(vertices, hull.vertices)
            assert np.array_equal(faces, hull.faces)

    @pytest.mark.slow
    @pytest.mark.parametrize("name", ["coacd", "vhacd", "fast", "fast:policy=random-10+edges", "fast:space"])
    def test_all_find_the_parts_of_a_cross(self, name: str) -> None:
        pytest.importorskip({"coacd": "coacd", "vhacd": "vhacdx"}.get(name, "rlacd"))
        method, mesh = make_method(name), from_manifold(CROSS)
        hulls = method.run(mesh.vertices, mesh.faces, method.default, 1)
        assert len(hulls) >= 2  # two bars may overlap
        points = np.concatenate([v for v, _ in hulls])
        assert np.allclose(points.min(axis=0), (-1, -1, -0.2), atol=0.06)
        assert np.allclose(points.max(axis=0), (1, 1, 0.2), atol=0.06)
        assert all(f.shape[1] == 3 and f.max() < len(v) for v, f in hulls)


def test_other_tools_run_at_their_own_defaults(monkeypatch: pytest.MonkeyPatch) -> None:
    """Nothing is passed but the setting compared, at the default it has there, and the input."""
    coacd = pytest.importorskip("coacd", reason="the group bench is not installed")
    vhacdx = pytest.importorskip("vhacdx", reason="the group bench is not installed")
    threshold = inspect.signature(coacd.run_coacd).parameters["threshold"].default
    hulls = int(vhacdx.compute_vhacd.__doc__.split("maxConvexHulls")[1].split(" = ")[1].split(",")[0])
    passed: list[dict[str, Any]] = []
    hull = trimesh.creation.box()

    def seen(*_: Any, **options: Any) -> list[Any]:
        passed.append(options)
        return [(hull.vertices, hull.faces)]

    monkeypatch.setattr(coacd, "run_coacd", seen)
    monkeypatch.setattr(vhacdx, "compute_vhacd", seen)
    for name in ("coacd", "vhacd"):
        method = make_method(name)
        method.run(np.array(hull.vertices), np.array(hull.faces, dtype=np.int32), method.default, 1)
    assert passed == [{"threshold": threshold}, {"maxConvexHulls": hulls, "asyncACD": False}]


@pytest.mark.nightly
class TestRunner:
    def test_a_row_a_mesh_and_nothing_twice(self, meshes: Path, tmp_path: Path) -> None:
        """Nor if the rows are lost: hulls that are there are only measured, and keep their seconds."""
        bench = bench_of(meshes, tmp_path / "run", fresh=False)
        rows = bench.run("fast")
        assert [(row["mesh"], row["parts"]) for row in rows] == [("a/cross.stl", 2), ("box.ply", 1)]
        assert all(row["cpu"] > 0 and row["peak_mb"] > 10 and row["invalid"] == 0 for row in rows)
        files = sorted((tmp_path / "run" / "tasks").iterdir())
        written = [file.stat().st_mtime_ns for file in files]
        assert bench.run("fast") == rows
        for file in files[::2]:
            assert file.suffix == ".json"
            file.unlink()
        again = bench.run("fast")
        assert [{**row, "seconds": 0} for row in again] == [{**row, "seconds": 0} for row in rows]
        assert [file.stat().st_mtime_ns for file in files[1::2]] == written[1::2]

    @pytest.mark.parametrize(
        ("limits", "says"), [({"seconds": 0.05}, "more than 0.05 s"), ({"memory": 2**25}, "more than 0.03125 GB")]
    )
    def test_a_hang_and_a_lack_of_memory_are_recorded(
        self, meshes: Path, tmp_path: Path, limits: Any, says: str, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        monkeypatch.setattr("rlacd.pool.local.LOOK_EVERY", 0.001)  # boxes are done before the usual first look
        rows = bench_of(meshes, tmp_path / "run", process=ProcessLimits(**limits)).run("fast")
        assert all(says in row["error"] for row in rows)
        assert len(rows) == 2, "the run goes on"

    def test_a_broken_mesh_is_recorded_and_what_another_version_made_is_made_again(
        self, meshes: Path, tmp_path: Path
    ) -> None:
        (meshes / "broken.obj").write_text("this is no mesh")
        bench = bench_of(meshes, tmp_path / "run", fresh=False)
        first, *_, broken = rows = bench.run("fast")
        assert "Error" in broken["error"]
        assert "broken.obj" in failures(rows)
        task = Task(first["mesh"], "fast", 0.05)
        save_row(bench.folder, task, {**first, "version": "0.0.0", "parts": 99})
        written = bench.hulls_of(task).stat().st_mtime_ns
        again = bench.run("fast")
        assert [row.get("parts") for row in again] == [row.get("parts") for row in rows]
        assert again[1] == rows[1], "only that one"
        assert bench.hulls_of(task).stat().st_mtime_ns > written


def test_data_sets_are_read_as_distributed(tmp_path: Path) -> None:
    """Meshes lie between textures, voxels, labels and notes, as in ShapeNetCore, COSEG and HumanBody."""
    model = "02691156/10155655850468db78d106ce0a280f87/models/model_normalized"
    meshes = [f"{model}.obj", "chairs/shapes/1.off", "meshes/train/faust/tr_reg_000.ply"]
    others = [f"{model}.mtl", f"{model}.solid.binvox", "chairs/gt/1.seg", "taxonomy.json"]
    for name in meshes + others:
        (tmp_path / name).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / name).touch()
    assert find_meshes(tmp_path) == sorted(meshes)
    (tmp_path / "list.txt").write_text("# one\nchairs/shapes/1.off\n\n")
    assert find_meshes(tmp_path, tmp_path / "list.txt") == ["chairs/shapes/1.off"]


class TestTables:
    NUMBERS = (
        "faces hausdorff over under uncovered concavity exceeding volume overlap added invalid empty cpu peak_mb "
        "input_faces"
    )

    def rows(self, *parts: int, failed: str | None = None) -> list[dict[str, Any]]:
        rows: list[dict[str, Any]] = [
            {"mesh": f"m{i}", "method": "x", "setting": 0.1, **dict.fromkeys(self.NUMBERS.split(), 1), "parts": n}
            for i, n in enumerate(parts)
        ]
        return rows + ([{"mesh": failed, "method": "x", "setting": 0.1, "error": "died"}] if failed else [])

    def test_a_mesh_that_one_fails_on_counts_for_none(self) -> None:
        a, b = self.rows(2, 4, 100), self.rows(3, 5, failed="m2")
        assert [len(rows) for rows in managed({"a": a, "b": b}).values()] == [2, 2]
        text = str(compare.comparison({"a": a, "b": b}))
        assert "| 2 meshes | a | b |" in text
        assert "| hulls; a mesh | 6; 3.0 | 8; 4.0 |" in text
        assert "| failed | 0 of 3 | 1 of 3 |" in text
        nothing = {"a": self.rows(2), "b": self.rows(failed="m0")}
        assert all(
            "no mesh that all managed" in str(table(nothing)) for table in (compare.comparison, compare.published)
        )

    def test_the_first_table_has_the_form_of_the_page(self) -> None:
        """Rows whose numbers are those of the page make the page's table."""
        page = (ROOT / "docs" / "benchmarks.md").read_text(encoding="utf-8")
        shown = [[c.strip() for c in line.strip("|").split("|")] for line in page.splitlines() if line.startswith("|")]
        groups = {}
        for number, method in enumerate(("coacd", compare.AS_MANY, "fast", "default"), 1):
            cells = (row[number].replace("*", "") for row in shown[2:10])
            hulls, faces, away, added, left, invalid, faster, sure = cells
            average, worst = map(float, away.split(", "))
            row = {
                **{"method": method, "version": "1.0.14", "setting": 0.05, "parts": int(hulls.replace(",", "")) / 60},
                **{"faces": int(faces.replace(",", "")), "uncovered": float(left.rstrip("%")) / 100, "invalid": 0},
                **{"added": float(added.rstrip("%")) / 100},
                **{"cpu": 1 / float(faster), "exceeding": None if method == compare.AS_MANY else int("up to" in sure)},
                "concavity": float(sure.split()[-1]) if "up to" in sure else 0.05,
                "hausdorff": average - (worst - average) / 59,
            }
            groups[method] = [{**row, "mesh": i} for i in range(60)]
            groups[method][0] |= {"hausdorff": worst, "invalid": int(invalid)}
        made = [line.strip("|").split("|") for line in str(compare.published(groups)).splitlines()]
        assert [[cell.strip() for cell in line] for line in made][2:] == shown[2:10]
        assert [cell.strip() for cell in made[0]] == [cell.replace("unseen ", "") for cell in shown[0]]

    def test_an_interval_covers_the_truth_as_often_as_it_says(self) -> None:
        """Of pairs with a true geometric mean of 0.9, in 95 of 100 draws or so."""
        random = np.random.default_rng(0)
        ratios = [Ratio.of(0.9 * np.exp(random.normal(0, 0.2, 50)), np.ones(50)) for _ in range(100)]
        assert 88 <= sum(ratio.low <= 0.9 <= ratio.high for ratio in ratios) <= 99
        assert ratio_of(self.rows(2, 8), self.rows(4, 4)).startswith("1.000 (0.500 to 2.000")
        assert ratio_of(self.rows(failed="m0"), self.rows(4)) == "–"


class TestCommands:
    @pytest.mark.nightly
    def test_compare_writes_a_page_and_does_nothing_twice(self, meshes: Path, tmp_path: Path) -> None:
        out = tmp_path / "run"
        text = run(compare.app, meshes, "--out", out, "--methods", "fast,fast:policy=navacd", "--first", 2)
        assert (out / "compare.md").read_text() in text
        assert "| 2 meshes, threshold 0.05 | rlacd `fast` | rlacd `fast:policy=navacd` |" in text
        before = sorted(file.stat().st_mtime_ns for file in (out / "tasks").iterdir())
        assert "| failed | 0 of 2 |" in run(compare.app, meshes, "--out", out, "--methods", "fast", "--warm")
        assert sorted(file.stat().st_mtime_ns for file in (out / "tasks").iterdir()) == before
        page = run(compare.app, meshes, "--out", out, "--methods", "fast,fast@1.9", "--threads", 2)
        assert "| 2 meshes | fast | fast@1.9 |" in page
        assert "| hulls; a mesh | 3; 1.5 | 2; 1.0 |" in page
        assert "| wall s, 2 threads: median, mean, most, sum |" in page

    @pytest.mark.parametrize(
        ("words", "says"),
        [
            (["nowhere"], "is not a folder"),
            (["meshes", "--list", "nowhere.txt"], "does not exist"),
            (["meshes", "--list", "list.txt"], "no.stl"),
            (["empty"], "there are no meshes"),
            (["meshes", "--methods", "gredy"], "there is no method"),
            (["meshes", "--methods", ","], "name at least one"),
        ],
    )
    def test_wrong_options_are_one_sentence_before_any_work(
        self, words: list[str], says: str, meshes: Path, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        monkeypatch.chdir(meshes.parent)
        Path("empty").mkdir()
        Path("list.txt").write_text("box.ply\nno.stl\n")
        usual = ["--methods", "fast"] if "--methods" not in words else []
        told = run(compare.app, *words, *usual, "-o", "run", code=2)
        assert says in told
        assert len(told.strip().splitlines()) == 1
        assert not Path("run").exists()


def test_curves_are_drawn_or_refused_in_one_sentence(tmp_path: Path) -> None:
    points = [{"env_steps": 100, "loss": 4.0}, {"env_steps": 200, "loss": 1.0, "epsilon": 0.5}]
    path = tmp_path / "two & three" / "curves.jsonl"
    path.parent.mkdir()
    path.write_text("\n".join(map(json.dumps, points)))
    run(curves.app, path.parent, path, "--out", tmp_path / "c.svg")
    drawn = [*ElementTree.parse(tmp_path / "c.svg").iter()]
    assert str(path) in [e.text for e in drawn]
    lines = sorted(len(e.attrib["points"].split()) for e in drawn if "points" in e.attrib)
    assert lines == [1, 1, 2, 2]
    for content in ("[1]", "{", '{"loss": 1}', '{"env_steps": 1, "loss": "x"}'):
        path.write_text(content)
        told = run(curves.app, path, "--out", tmp_path / "c.svg", code=2)
        assert "holds no curves of `rlacd train`" in told
        assert len(told.strip().splitlines()) == 1


def test_planning_leaves_no_more_merged_parts_than_greedy() -> None:
    pytest.importorskip("torch", reason="needs the extra train")
    from benchmarks.learned.whole import GREEDY, THRESHOLD, counts_of, planned

    root = Component(CROSS + CROSS.rotate([20, 30, 40]))
    with Run(1) as run:
        greedy, left = CutTree(root, GREEDY, run).cut_until(Concavity(THRESHOLD))
    found = planned(root)
    assert not left
    assert all(Concavity(THRESHOLD).is_met(part) for part in found)
    assert sum(part.volume for part in found) == pytest.approx(root.volume)
    assert counts_of(found)[-1] <= counts_of(greedy)[-1]


@pytest.mark.parametrize(("cores", "seconds"), [(1, 11.0), (2, 6.0), (3, 13 / 3), (16, 3.0)])
def test_played_back_work_shares_the_cores_and_the_main_thread_waits_for_what_it_needs(
    cores: int, seconds: float
) -> None:
    """Three pieces of 2, 2 and 1 seconds; the main thread works 2 beside them, waits, and shares four items of 1."""
    begin: list[tuple[str, Any]] = [("begin", number) for number in range(3)]
    steps = [*begin, ("alone", 2.0), ("wait", 0), ("wait", 1), ("wait", 2), ("map", [1.0] * 4)]
    assert seconds_on(cores, steps, {0: 2.0, 1: 2.0, 2: 1.0}) == pytest.approx(seconds)


class TestFilm:
    def test_shows_where_single_hulls_touch_in_red(self, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
        """Of a fork between two plates: there and back, the worst position stays, and only single hulls are red."""
        for package in ("coal", "mujoco", "yourdfpy", "mitsuba", "PIL"):
            pytest.importorskip(package)
        for what, value in {"SIZE": 48, "SAMPLES": 4, "FRAMES": 3}.items():
            monkeypatch.setattr(worst, what, value)
        monkeypatch.setattr(robots, "POSITIONS", 5)
        fork = next(path for path in write_boxes(tmp_path / "boxes") if path.stem == "fork")
        ways = {way: robots.rewritten(fork, way, {}, [], tmp_path / "run") for way in ("hull", "whole")}
        assert ways["hull"]["false"] > 0 == ways["whole"]["false"]
        worst.film(tmp_path / "film.gif", [(fork, {way: row["place"] for way, row in ways.items()})], [])
        film = import_module("PIL.Image").open(tmp_path / "film.gif")
        assert film.size == (2 * 48, 48)
        assert film.n_frames == 4, "three there, one between on the way back"
        film.seek(2)
        red = np.asarray(film.convert("RGB"), int)
        is_red = red[..., 0] > 2 * red[..., 1]
        assert film.info["duration"] > 1000
        assert is_red[:, :48].mean() > 0.01
        assert not is_red[:, 48:].any()

    def test_needs_names(self, tmp_path: Path) -> None:
        said = run(robots.app, tmp_path, "--out", tmp_path / "run", "--film", tmp_path / "film.gif", code=2)
        assert "--film shows robots that are named; name some." in said
