"""The benchmarks: methods in processes of their own, limits, results that survive, tables, equal accuracy."""

from __future__ import annotations

import inspect
import json
import math
import signal
import subprocess
import sys
import time
from pathlib import Path
from typing import Any, ClassVar

import numpy as np
import psutil
import pytest
import trimesh
from benchmarks import compare, corpus, paper, tables, tuning, vhacd_set
from benchmarks.__main__ import COMMANDS
from benchmarks.deployed import Deployment, decompose_as_deployed
from benchmarks.methods import make_method, rlacd_options
from benchmarks.runner import Bench, Limits, find_meshes
from benchmarks.store import Store, Task
from benchmarks.tables import PLACE, Ratio, Table, common_meshes, fill, ratio_of
from benchmarks.training import ARMS, _options, train_arms
from benchmarks.tuning import CLOSE, tune
from typer.testing import CliRunner

import rlacd
from rlacd.errors import MissingExtraError, OptionError, OutputError
from rlacd.learn.options import TRAIN_PRESETS
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


def bench_of(meshes: Path, folder: Path, limits: Limits | None = None) -> Bench:
    return Bench(meshes, find_meshes(meshes), Store(folder), limits, say=lambda _: None)


def run(app: Any, *words: object, code: int = 0) -> str:
    result = CliRunner().invoke(app, [*map(str, words)])
    assert result.exit_code == code, result.output
    return result.output


class TestMethods:
    @pytest.mark.parametrize(
        ("name", "setting", "default"),
        [
            ("default", "threshold", 0.05),
            ("fast:policy=navacd", "threshold", 0.05),
            ("default:space", "tolerance", 0.1),
            ("vhacd", "hulls", 64),
            ("planes:ap=20:ce=0:no-principal", "threshold", 0.05),
        ],
    )
    def test_names(self, name: str, setting: str, default: float) -> None:
        method = make_method(name)
        assert (method.name, method.setting, method.default) == (name, setting, default)

    @pytest.mark.parametrize("name", ["", "gredy", "fast:polcy=x", "fast:best", "coacd:best", "planes:ap=x", "space"])
    def test_unknown_names_are_one_sentence(self, name: str) -> None:
        with pytest.raises(OptionError, match=r"has to be|is not known"):
            make_method(name)

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

    def test_a_peer_that_is_not_there_says_how_to_get_it(self, monkeypatch: pytest.MonkeyPatch) -> None:
        from importlib import metadata

        def absent(name: str) -> str:
            raise metadata.PackageNotFoundError(name)

        monkeypatch.setattr(metadata, "version", absent)
        with pytest.raises(MissingExtraError, match="pip install coacd"):
            make_method("coacd")

    @pytest.mark.slow
    @pytest.mark.parametrize("name", ["coacd", "vhacd", "fast", "fast:policy=random-10+edges", "fast:space", "planes"])
    def test_all_find_the_parts_of_a_cross(self, name: str) -> None:
        pytest.importorskip({"coacd": "coacd", "vhacd": "vhacdx"}.get(name, "rlacd"))
        method, mesh = make_method(name), from_manifold(CROSS)
        hulls = method.run(mesh.vertices, mesh.faces, method.default, 1)
        assert len(hulls) >= 2  # two bars may overlap
        points = np.concatenate([v for v, _ in hulls])
        assert np.allclose(points.min(axis=0), (-1, -1, -0.2), atol=0.06)
        assert np.allclose(points.max(axis=0), (1, 1, 0.2), atol=0.06)
        assert all(f.shape[1] == 3 and f.max() < len(v) for v, f in hulls)

    def test_disjoint_hulls_share_no_volume(self) -> None:
        """Two bars of a cross that overlap are more hulls where they must not."""
        mesh = from_manifold(CROSS.rotate((10, 20, 30)))
        hulls = make_method("disjoint").run(mesh.vertices, mesh.faces, 0.05, 1)
        bodies = [trimesh.Trimesh(v, f, process=False) for v, f in hulls]
        assert len(hulls) > len(rlacd.decompose((mesh.vertices, mesh.faces), quality="fast")) == 2
        assert trimesh.boolean.union(bodies).volume == pytest.approx(sum(body.volume for body in bodies), rel=1e-6)


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


class TestDeployment:
    def test_no_planes_at_all_is_an_error(self) -> None:
        with pytest.raises(OptionError, match="no planes are left"):
            Deployment.parse(["no-principal", "no-spatial", "ce=0"])

    def test_more_planes_ranked_is_greedy(self) -> None:
        """With all 150 planes on the shortlist and no edges, what is left is the paper's greedy baseline."""
        mesh = from_manifold(CROSS.rotate((10, 20, 30)))
        deployed = decompose_as_deployed(Deployment("excess", 150, 0), mesh.vertices, mesh.faces, 0.05, 1)
        greedy = rlacd.decompose((mesh.vertices, mesh.faces), quality="fast", policy="greedy-hull-sum", detail="full")
        assert len(deployed) == len(greedy)
        assert sum(len(v) for v, _ in deployed) == sum(len(hull.vertices) for hull in greedy)


class TestStore:
    ROW: ClassVar = {"mesh": "a.ply", "method": "fast", "setting": 0.05, "parts": 3}

    def test_a_line_cut_short_by_a_kill_is_done_again(self, tmp_path: Path) -> None:
        (tmp_path / "results.jsonl").write_text(json.dumps(self.ROW) + '\n{"mesh": "b.pl')
        store = Store(tmp_path)
        assert store.get(Task("a.ply", "fast", 0.05)) == self.ROW
        assert store.get(Task("a.ply", "fast", 0.1)) is None
        store.add({**self.ROW, "mesh": "b.ply"})
        with pytest.raises(OutputError, match="another run"):
            Store(tmp_path)
        store.close()
        assert [row["mesh"] for row in Store(tmp_path).rows()] == ["a.ply", "b.ply"]


@pytest.mark.slow
class TestRunner:
    def test_a_row_a_mesh_and_nothing_twice(self, meshes: Path, tmp_path: Path) -> None:
        """Nor if the rows are lost: hulls that are there are only measured, and keep their seconds."""
        bench = bench_of(meshes, tmp_path / "run", Limits(tasks=2))
        rows = bench.run("fast")
        assert [(row["mesh"], row["parts"]) for row in rows] == [("a/cross.stl", 2), ("box.ply", 1)]
        assert all(row["cpu"] > 0 and row["peak_mb"] > 10 and row["invalid"] == 0 for row in rows)
        bench.store.close()
        lines = (tmp_path / "run" / "results.jsonl").read_text()
        again = bench_of(meshes, tmp_path / "run")
        assert again.run("fast") == rows
        again.store.close()
        assert (tmp_path / "run" / "results.jsonl").read_text() == lines
        (tmp_path / "run" / "results.jsonl").write_text("")
        assert bench_of(meshes, tmp_path / "run").run("fast") == rows

    @pytest.mark.parametrize(("limits", "says"), [({"seconds": 0.05}, "more than 0.05 s"), ({"memory": 2**28}, "")])
    def test_a_hang_and_a_lack_of_memory_are_recorded(
        self, meshes: Path, tmp_path: Path, limits: Any, says: str
    ) -> None:
        rows = bench_of(meshes, tmp_path / "run", Limits(**limits)).run("fast")
        assert all(says in row["error"] for row in rows)
        assert len(rows) == 2, "the run goes on"

    def test_a_crash_is_recorded(self, meshes: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
        crasher = tmp_path / "crasher"
        crasher.write_text("#!/bin/sh\nread line\necho last words >&2\nkill -SEGV $$\n")
        crasher.chmod(0o755)
        monkeypatch.setattr(sys, "executable", str(crasher))
        rows = bench_of(meshes, tmp_path / "run").run("fast")
        assert [row["error"] for row in rows] == ["died of SIGSEGV last words"] * 2

    @pytest.mark.nightly
    def test_stopping_a_run_ends_its_processes_and_records_nothing(self, tmp_path: Path) -> None:
        """Whether it is interrupted or killed: no process goes on, and what was running is done again next time."""
        folder = tmp_path / "meshes"
        folder.mkdir()
        sphere = trimesh.creation.icosphere(subdivisions=6)  # keeps a method busy for long
        for name in ("a.ply", "b.ply"):
            trimesh.util.concatenate([sphere, sphere.copy().apply_translation((1.5, 0, 0))]).export(folder / name)
        program = (
            "import signal, sys; from pathlib import Path; from benchmarks.runner import Bench, find_meshes;"
            "from benchmarks.store import Store;"
            "signal.signal(signal.SIGINT, signal.default_int_handler);"  # ignored by what runs in a shell's background
            "m, o = map(Path, sys.argv[1:]);"
            "Bench(m, find_meshes(m), Store(o)).run('fast', 0.002)"
        )
        for number in (signal.SIGINT, signal.SIGKILL):
            out = tmp_path / f"run-{number}"
            command = [sys.executable, "-c", program, folder, out]
            with subprocess.Popen(command, stderr=subprocess.DEVNULL, cwd=ROOT) as process:
                try:
                    parent = psutil.Process(process.pid)
                    while not (children := parent.children()):
                        time.sleep(0.1)
                    time.sleep(1)  # let it begin
                    process.send_signal(number)
                    process.wait(timeout=60)
                finally:
                    process.kill()
            assert not psutil.wait_procs(children, timeout=30)[1]
            assert (out / "results.jsonl").read_text() == ""

    def test_a_broken_mesh_is_recorded_and_what_another_version_made_is_made_again(
        self, meshes: Path, tmp_path: Path
    ) -> None:
        (meshes / "broken.obj").write_text("this is no mesh")
        bench = bench_of(meshes, tmp_path / "run", Limits(tasks=9))
        first, *_, broken = rows = bench.run("fast")
        assert "Error" in broken["error"]
        assert "broken.obj" in tables.failures(rows)
        bench.store.add({**first, "version": "0.0.0", "parts": 99})
        assert tuning.known_curve(bench, "fast") == []
        written = bench.store.hulls_of(Task(first["mesh"], "fast", 0.05)).stat().st_mtime_ns
        again = bench.run("fast")
        assert [row.get("parts") for row in again] == [row.get("parts") for row in rows]
        assert again[1] == rows[1], "only that one"
        assert bench.store.hulls_of(Task(first["mesh"], "fast", 0.05)).stat().st_mtime_ns > written


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


class TestTuning:
    """On made-up methods, whose D_h is a known function of their number."""

    def tuned(
        self, monkeypatch: pytest.MonkeyPatch, tmp_path: Path, law: Any, target: float, method: str = "fast"
    ) -> tuple[tuning.Point, int]:
        bench = Bench(tmp_path, ["one", "two"], Store(tmp_path / "run"), say=lambda _: None)
        calls = []

        def run(self: Bench, name: str, setting: float) -> list[dict[str, Any]]:
            calls.append(setting)
            for mesh, factor in (("one", 0.5), ("two", 1.5)):
                self.store.add({"mesh": mesh, "method": name, "setting": setting, "hausdorff": factor * law(setting)})
            return [self.store.get(Task(mesh, name, setting)) for mesh in self.names]  # type: ignore[misc]

        monkeypatch.setattr(Bench, "run", run)
        point = tune(bench, method, target)
        assert tune(bench, method, target).setting == point.setting
        return point, len(calls)

    @pytest.mark.parametrize("target", [0.03, 0.1, 0.15])
    @pytest.mark.parametrize(
        "law", [lambda t: t, lambda t: 0.02 + t, lambda t: t**0.5 / 4, lambda t: 0.9 * t + 0.01 * math.sin(60 * t)]
    )
    def test_the_mean_is_the_target(
        self, monkeypatch: pytest.MonkeyPatch, tmp_path: Path, law: Any, target: float
    ) -> None:
        point, calls = self.tuned(monkeypatch, tmp_path, law, target)
        assert abs(point.hausdorff - target) <= CLOSE * target
        assert calls <= tuning.TRIES

    def test_a_step_is_bisected_to_its_end(self, monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
        point, calls = self.tuned(monkeypatch, tmp_path, lambda t: 0.01 if t < 0.137 else 0.2, 0.15)
        assert point.hausdorff == pytest.approx(0.2)  # the closer of the two there are
        assert calls <= 2 * tuning.TRIES


class TestTables:
    NUMBERS = (
        "faces hausdorff over under uncovered concavity exceeding volume overlap invalid empty cpu peak_mb input_faces"
    )

    def rows(self, *parts: int, failed: str | None = None) -> list[dict[str, Any]]:
        rows: list[dict[str, Any]] = [
            {"mesh": f"m{i}", "method": "x", "setting": 0.1, **dict.fromkeys(self.NUMBERS.split(), 1), "parts": n}
            for i, n in enumerate(parts)
        ]
        return rows + ([{"mesh": failed, "method": "x", "setting": 0.1, "error": "died"}] if failed else [])

    def test_a_mesh_that_one_fails_on_counts_for_none(self) -> None:
        a, b = self.rows(2, 4, 100), self.rows(3, 5, failed="m2")
        assert common_meshes([a, b]) == {"m0", "m1"}
        text = str(compare.comparison({"a": a, "b": b}))
        assert "| 2 meshes | a | b |" in text
        assert "| hulls | 6 | 8 |" in text
        assert "| failed | 0 of 3 | 1 of 3 |" in text
        assert "no mesh that all managed" in str(compare.comparison({"a": self.rows(2), "b": self.rows(failed="m0")}))

    def test_an_interval_covers_the_truth_as_often_as_it_says(self) -> None:
        """Of pairs with a true geometric mean of 0.9, in 95 of 100 draws or so."""
        random = np.random.default_rng(0)
        ratios = [Ratio.of(0.9 * np.exp(random.normal(0, 0.2, 50)), np.ones(50)) for _ in range(100)]
        assert 88 <= sum(ratio.low <= 0.9 <= ratio.high for ratio in ratios) <= 99
        assert ratio_of(self.rows(2, 8), self.rows(4, 4)).startswith("1.000 (0.500 to 2.000")
        assert ratio_of(self.rows(failed="m0"), self.rows(4)) == "–"


class TestCommands:
    def test_help_names_every_command_and_each_has_its_own(self) -> None:
        """In fresh interpreters: no command needs another tool for its help."""
        listed = subprocess.run([sys.executable, "-m", "benchmarks"], cwd=ROOT, capture_output=True, text=True).stdout
        assert all(f"\n  {name} " in listed for name in COMMANDS)
        for name in COMMANDS:
            assert (ROOT / "benchmarks" / f"{name.replace('-', '_')}.py").is_file()
        wrong = subprocess.run([sys.executable, "-m", "benchmarks", "x"], cwd=ROOT, capture_output=True, text=True)
        assert wrong.returncode == 1
        assert "there is no command 'x'" in wrong.stderr

    @pytest.mark.slow
    def test_compare_corpus_and_the_vhacd_set(self, meshes: Path, tmp_path: Path) -> None:
        out = tmp_path / "run"
        run(compare.app, meshes, "--out", out, "--methods", "fast,fast:policy=navacd", "--first", 2)
        text = (out / "compare.md").read_text()
        assert "| 2 meshes | fast | fast:policy=navacd |" in text
        before = (out / "results.jsonl").read_text()
        assert "| decomposed | 2 of 2 |" in run(corpus.app, meshes, "--out", out)
        assert (out / "results.jsonl").read_text() == before
        page = run(vhacd_set.app, meshes, "--out", out, "--methods", "fast,fast@0.04", "--threads", 2)
        assert "| fast @ 0.05 | 1.5 |" in page
        assert "| fast @ 0.04 |" in page
        assert "VisACD, published" in page
        assert "| wall s, 2 threads: median, sum |" in page
        timed = [json.loads(line) for line in (out / "results.jsonl").read_text().splitlines()]
        assert all(row["wall_threads"] > 0 for row in timed if row["threads"] == 2)

    @pytest.mark.nightly
    def test_the_papers_tables(self, meshes: Path, tmp_path: Path) -> None:
        pytest.importorskip("vhacdx")
        out = tmp_path / "run"
        run(paper.app, "table-1", meshes, "-o", out, "--first", 1, "--methods", "fast:policy=navacd", "--at", 0.3)
        text = (out / "table-1.md").read_text()
        assert "Mean D_h 0.3" in text
        assert (out / "curves.svg").exists()
        assert "44.2" in text, "the paper's numbers stand beside ours"
        run(paper.app, "vhacd", meshes, "-o", out)
        rows = [json.loads(line) for line in (out / "results.jsonl").read_text().splitlines()]
        ours = {row["mesh"]: row["parts"] for row in rows if row["method"] == "fast"}
        theirs = {row["mesh"]: row for row in rows if row["method"] == "vhacd"}
        assert len(theirs) == 2
        assert all(row["setting"] == ours[mesh] and row["parts"] <= ours[mesh] for mesh, row in theirs.items())
        run(paper.app, "table-2", meshes, "-o", out, "--first", 1)
        assert "without PCA planes" in (out / "table-2.md").read_text()
        run(paper.app, "table-3", meshes, "-o", out, "--first", 1, "--planes", "1,150", "--edges", "0")
        text = (out / "table-3.md").read_text()
        assert all(label in text for label in ("#AP 1, #CE 4", "#AP 150, #CE 4", "#AP 10, #CE 0"))

    @pytest.mark.parametrize(
        ("app", "words", "says"),
        [
            (compare.app, ["nowhere"], "is not a folder"),
            (compare.app, ["meshes", "--list", "nowhere.txt"], "does not exist"),
            (compare.app, ["meshes", "--list", "list.txt"], "no.stl"),
            (compare.app, ["empty"], "there are no meshes"),
            (compare.app, ["meshes", "--methods", "gredy"], "there is no method"),
            (compare.app, ["meshes", "--methods", ","], "name at least one"),
            (paper.app, ["table-3", "meshes", "--planes", "a,b"], "whole numbers"),
        ],
    )
    def test_wrong_options_are_one_sentence_before_any_work(
        self, app: Any, words: list[str], says: str, meshes: Path, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        monkeypatch.chdir(meshes.parent)
        Path("empty").mkdir()
        Path("list.txt").write_text("box.ply\nno.stl\n")
        usual = ["--methods", "fast"] if app is compare.app and "--methods" not in words else []
        told = run(app, *words, *usual, "-o", "run", code=2)
        assert says in told
        assert len(told.strip().splitlines()) == 1
        assert not Path("run").exists()

    def test_charts_are_asked_for_before_any_work(self, meshes: Path, monkeypatch: pytest.MonkeyPatch) -> None:
        monkeypatch.setitem(sys.modules, "matplotlib", None)
        told = run(paper.app, "table-1", meshes, "-o", meshes.parent / "run", "--methods", "fast", code=2)
        assert "pip install matplotlib" in told
        assert not (meshes.parent / "run").exists()


def test_research_shows_tables_that_commands_printed_and_no_others() -> None:
    document = (ROOT / "research" / "comparison.md").read_text()
    assert len(PLACE.findall(document)) > 5
    assert "|---" not in PLACE.sub("", document)


def test_tables_are_put_in_their_place_in_documents(tmp_path: Path) -> None:
    (tmp_path / "quick").mkdir()
    (tmp_path / "quick" / "a.md").write_text("# A\n\n| a |\n|---|\n| 1 |\n\ntext\n\n| b |\n|---|\n| 2 |\n")
    document = "before\n<!-- quick/a.md, table 2 -->\nold\n<!-- end -->\nafter\n"
    expected = "before\n<!-- quick/a.md, table 2 -->\n\n| b |\n|---|\n| 2 |\n\n<!-- end -->\nafter\n"
    assert fill(document, tmp_path) == fill(expected, tmp_path) == expected
    with pytest.raises(SystemExit, match="has 2 tables, not 3"):
        fill("<!-- quick/a.md, table 3 -->\n<!-- end -->\n", tmp_path)


@pytest.mark.parametrize("experiment", ARMS)
def test_arms_differ_in_what_they_say_only(experiment: str) -> None:
    for preset in ("two-cores", "paper"):
        arms = [_options(preset, 100, 1, changes) for changes in ARMS[experiment].values()]
        assert len(set(arms)) == len(arms)
    assert {(a.iterations, a.seed, a.warmup, a.validate_every) for a in arms} == {(100, 1, 20, 50)}


@pytest.mark.nightly
def test_arms_are_trained_once(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    pytest.importorskip("torch")
    folder = tmp_path / "meshes"
    folder.mkdir()
    for number in range(6):
        mesh = from_manifold(CROSS + box((0, 0, 0), (0.3 + 0.1 * number, 0.4, 1)))
        trimesh.Trimesh(mesh.vertices, mesh.faces, process=False).export(folder / f"{number}.stl")
    monkeypatch.setattr(
        "rlacd.learn.options.TRAIN_PRESETS", {"two-cores": {**TRAIN_PRESETS["two-cores"], "validation": 2}}
    )
    said: list[str] = []
    page = train_arms("curves", folder, tmp_path / "run", "two-cores", 40, seeds=2, say=said.append)
    table = next(block for block in page.blocks if isinstance(block, Table))
    assert [line[0] for line in table.lines] == list(ARMS["curves"])
    assert all(float(str(line[1]).partition(" ± ")[0]) > 0 for line in table.lines)
    assert len({(tmp_path / "run" / f"curves-1-seed-{s}" / "curves.jsonl").read_text() for s in (0, 1)}) == 2
    monkeypatch.setattr("rlacd.learn.train.train", None)  # would fail if called
    again = train_arms("curves", folder, tmp_path / "run", "two-cores", 40, seeds=2, say=said.append)
    assert str(again) == str(page)
