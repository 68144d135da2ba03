"""Side by side: methods in processes of their own, limits, results that survive, numbers tuned to equal accuracy."""

from __future__ import annotations

import contextlib
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
import pytest
import trimesh
from benchmarks import Bench, BenchLimits, BenchStore, BenchTask, find_meshes, make_method, tables, tuning
from benchmarks.deployed import Deployment, decompose_as_deployed
from benchmarks.store import load_hulls, save_hulls
from benchmarks.tables import (
    Spread,
    Table,
    as_csv,
    common_meshes,
    comparison,
    details,
    failures,
    ratio_of_parts,
    short_names,
)
from benchmarks.tuning import CLOSE, next_setting, tune

import rlacd
from rlacd.errors import MissingExtraError, OptionError, OutputError
from tests.shapes import box, from_manifold

CROSS = box((-1, -0.2, -0.2), (1, 0.2, 0.2)) + box((-0.2, -1, -0.2), (0.2, 1, 0.2))


@pytest.fixture
def meshes(tmp_path: Path) -> Path:
    folder = tmp_path / "meshes"
    for name, solid in {"a/cross.stl": CROSS, "box.ply": box((0, 0, 0), (3, 1, 1))}.items():
        (folder / name).parent.mkdir(parents=True, exist_ok=True)
        mesh = from_manifold(solid)
        trimesh.Trimesh(mesh.vertices, mesh.faces, process=False).export(folder / name)
    return folder


def bench_of(meshes: Path, folder: Path, limits: BenchLimits | None = None) -> Bench:
    return Bench(meshes, find_meshes(meshes), BenchStore(folder), limits, say=lambda _: None)


def wait_for_child(parent: int) -> int:
    """The process that `parent` has started, once there is one; Linux only."""
    for _ in range(600):
        for status in Path("/proc").glob("[0-9]*/stat"):
            with contextlib.suppress(OSError):
                if int(status.read_text().rpartition(")")[2].split()[1]) == parent:
                    time.sleep(1)  # let it begin
                    return int(status.parent.name)
        time.sleep(0.1)
    raise AssertionError("no process was started")


def wait_for_end(process: int) -> bool:
    for _ in range(300):
        try:
            state = Path(f"/proc/{process}/stat").read_text(encoding="utf-8").rpartition(")")[2].split()[0]
        except OSError:
            return True
        if state == "Z":
            return True
        time.sleep(0.1)
    return False


class TestMethods:
    @pytest.mark.parametrize(
        ("name", "setting", "default"),
        [
            ("greedy", "threshold", 0.05),
            ("navacd", "threshold", 0.05),
            ("greedy:best", "threshold", 0.05),
            ("navacd:space", "tolerance", 0.1),
            ("greedy-hull-sum+edges:balanced:space", "tolerance", 0.1),
            ("planes:ap=20:ce=0:no-principal", "threshold", 0.05),
        ],
    )
    def test_names(self, name: str, setting: str, default: float) -> None:
        method = make_method(name)
        assert (method.name, method.setting, method.default) == (name, setting, default)

    @pytest.mark.parametrize(
        "name",
        ["", "gredy", "greedy:bst", "greedy:best:balanced", "coacd:best", "planes:ap=x", "space", "planes:ce=-1"],
    )
    def test_unknown_names_are_one_sentence(self, name: str) -> None:
        with pytest.raises(OptionError, match=r"has to be|is not known"):
            make_method(name)

    def test_a_peer_that_is_not_there_says_how_to_get_it(self, monkeypatch: pytest.MonkeyPatch) -> None:
        from importlib import metadata

        def absent(name: str) -> str:
            raise metadata.PackageNotFoundError(name)

        monkeypatch.setattr(metadata, "version", absent)
        with pytest.raises(MissingExtraError, match=r"rlacd\[bench\]"):
            make_method("coacd")

    @pytest.mark.slow
    @pytest.mark.parametrize(
        "name", ["coacd", "vhacdx", "vhacdx:hulls", "greedy", "random-10+edges", "navacd:space", "planes"]
    )
    def test_all_find_the_parts_of_a_cross(self, name: str) -> None:
        pytest.importorskip(name.partition(":")[0] if name[0] in "cv" else "rlacd")
        method, mesh = make_method(name), from_manifold(CROSS)
        hulls = method.run(mesh.vertices, mesh.faces, method.default, 1)
        assert len(hulls) >= 2  # two bars may overlap
        points = np.concatenate([v for v, _ in hulls])
        assert np.allclose(points.min(axis=0), (-1, -1, -0.2), atol=0.06)
        assert np.allclose(points.max(axis=0), (1, 1, 0.2), atol=0.06)
        assert all(f.shape[1] == 3 and f.max() < len(v) for v, f in hulls)


def test_other_tools_run_at_their_own_defaults(monkeypatch: pytest.MonkeyPatch) -> None:
    """Nothing is passed but the setting compared, at the default it has there, and the input."""
    coacd = pytest.importorskip("coacd", reason="the extra bench is not installed")
    vhacdx = pytest.importorskip("vhacdx", reason="the extra bench is not installed")
    threshold = inspect.signature(coacd.run_coacd).parameters["threshold"].default
    hulls = int(vhacdx.compute_vhacd.__doc__.split("maxConvexHulls")[1].split(" = ")[1].split(",")[0])
    passed: list[dict[str, Any]] = []
    hull = trimesh.creation.box()

    def seen(*_: Any, **options: Any) -> list[Any]:
        passed.append(options)
        return [(hull.vertices, hull.faces)]

    monkeypatch.setattr(coacd, "run_coacd", seen)
    monkeypatch.setattr(vhacdx, "compute_vhacd", seen)
    for name in ("coacd", "vhacdx:hulls"):
        method = make_method(name)
        method.run(np.array(hull.vertices), np.array(hull.faces, dtype=np.int32), method.default, 1)
    assert passed == [{"threshold": threshold}, {"maxConvexHulls": hulls, "asyncACD": False}]


@pytest.mark.nightly
def test_coacd_on_its_own_example(corpus: Path, tmp_path: Path) -> None:
    """Version 1.0.14 has been seen to make 47 and 48 parts of SnowFlake at 0.05."""
    pytest.importorskip("coacd")
    bench = Bench(corpus, ["test/coacd_examples/SnowFlake.ply"], BenchStore(tmp_path), say=lambda _: None)
    (row,) = bench.run("coacd", 0.05)
    assert 45 <= row["parts"] <= 50
    assert row["hausdorff"] < 0.06
    assert row["empty"] == 0


class TestDeployment:
    def test_words(self) -> None:
        words = ["no-principal", "ap=7", "excess", "ce=0"]
        assert Deployment.parse(words) == Deployment("excess", 7, 0, True, False)

    def test_no_planes_at_all_is_an_error(self) -> None:
        with pytest.raises(OptionError, match="no planes are left"):
            Deployment.parse(["no-principal", "no-spatial", "ce=0"])

    def test_without_the_axes_a_tilted_frame_needs_its_own(self) -> None:
        """Along x, y, z an open frame turned by 30 degrees has no good cuts; its concave edges have."""
        frame = box((0, 0, 0), (2, 2, 0.5)) - box((0.5, 0.5, -1), (1.5, 3, 1))
        mesh = from_manifold(frame.rotate((0, 0, 30)))

        def parts(*words: str) -> int:
            return len(decompose_as_deployed(Deployment.parse(words), mesh.vertices, mesh.faces, 0.05, 1))

        assert parts("ap=0", "ce=4") == 3
        assert parts("ap=150", "ce=0", "no-principal") > 3

    def test_more_planes_ranked_is_greedy(self) -> None:
        """With all 150 planes on the shortlist and no edges, what is left is the paper's greedy baseline."""
        mesh = from_manifold(CROSS.rotate((10, 20, 30)))
        deployed = decompose_as_deployed(Deployment("excess", 150, 0), mesh.vertices, mesh.faces, 0.05, 1)
        greedy = rlacd.decompose((mesh.vertices, mesh.faces), quality="fast", policy="greedy-hull-sum", detail="full")
        assert len(deployed) == len(greedy)
        assert sum(len(v) for v, _ in deployed) == sum(len(hull.vertices) for hull in greedy)


class TestStore:
    ROW: ClassVar = {"mesh": "a.ply", "method": "greedy", "setting": 0.05, "parts": 3}

    def test_rows_come_back(self, tmp_path: Path) -> None:
        store = BenchStore(tmp_path / "deep" / "run")
        store.add(self.ROW)
        store.close()
        again = BenchStore(tmp_path / "deep" / "run")
        assert again.get(BenchTask("a.ply", "greedy", 0.05)) == self.ROW
        assert again.get(BenchTask("a.ply", "greedy", 0.1)) is None

    def test_a_line_cut_short_by_a_kill_is_done_again(self, tmp_path: Path) -> None:
        (tmp_path / "results.jsonl").write_text(json.dumps(self.ROW) + '\n{"mesh": "b.pl')
        store = BenchStore(tmp_path)
        assert len(store) == 1
        store.add({**self.ROW, "mesh": "b.ply"})
        store.close()
        assert [row["mesh"] for row in BenchStore(tmp_path).rows()] == ["a.ply", "b.ply"]

    def test_a_damaged_line_is_named(self, tmp_path: Path) -> None:
        (tmp_path / "results.jsonl").write_text(json.dumps(self.ROW) + '\n{"mesh": 3}\n')
        with pytest.raises(OutputError, match=r"line 2 .* delete"):
            BenchStore(tmp_path)

    def test_two_runs_do_not_write_to_one_folder(self, tmp_path: Path) -> None:
        store = BenchStore(tmp_path)
        with pytest.raises(OutputError, match="another run"):
            BenchStore(tmp_path)
        store.close()

    def test_hulls_come_back(self, tmp_path: Path) -> None:
        hulls = [
            (np.random.default_rng(i).random((4 + i, 3)), np.full((2 * i, 3), i, dtype=np.int32)) for i in range(3)
        ]
        save_hulls(tmp_path / "h.npz", hulls, {"cpu": 1.5})
        found, account = load_hulls(tmp_path / "h.npz")
        assert account == {"cpu": 1.5}
        for (v, f), (v2, f2) in zip(hulls, found, strict=True):
            assert np.array_equal(v, v2)
            assert np.array_equal(f, f2)

    def test_no_hulls_come_back_too(self, tmp_path: Path) -> None:
        save_hulls(tmp_path / "h.npz", [], {})
        assert load_hulls(tmp_path / "h.npz") == ([], {})


@pytest.mark.slow
class TestRunner:
    def test_a_row_a_mesh_and_nothing_twice(self, meshes: Path, tmp_path: Path) -> None:
        bench = bench_of(meshes, tmp_path / "run")
        rows = bench.run("greedy", 0.05)
        assert [row["mesh"] for row in rows] == ["a/cross.stl", "box.ply"]
        assert rows[0]["parts"] == 2
        assert rows[1]["parts"] == 1
        assert all(row["cpu"] > 0 and row["peak_mb"] > 10 and row["invalid"] == 0 for row in rows)
        bench.store.close()
        lines = (tmp_path / "run" / "results.jsonl").read_text()
        assert bench_of(meshes, tmp_path / "run").run("greedy", 0.05) == rows
        assert (tmp_path / "run" / "results.jsonl").read_text() == lines

    def test_hulls_that_are_there_are_only_measured(self, meshes: Path, tmp_path: Path) -> None:
        bench = bench_of(meshes, tmp_path / "run")
        first = bench.run("greedy", 0.05)
        bench.store.close()
        (tmp_path / "run" / "results.jsonl").write_text("")
        assert bench_of(meshes, tmp_path / "run").run("greedy", 0.05) == first  # the seconds too

    def test_a_hang_is_recorded_and_the_run_goes_on(self, meshes: Path, tmp_path: Path) -> None:
        rows = bench_of(meshes, tmp_path / "run", BenchLimits(seconds=0.05)).run("greedy", 0.05)
        assert [row["error"] for row in rows] == ["more than 0.05 s"] * 2

    @pytest.mark.skipif(sys.platform != "linux", reason="address space is limited on Linux only")
    def test_too_much_memory_is_recorded(self, meshes: Path, tmp_path: Path) -> None:
        rows = bench_of(meshes, tmp_path / "run", BenchLimits(memory=2**28)).run("greedy", 0.05)
        assert all("error" in row for row in rows)

    def test_a_crash_is_recorded(self, meshes: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
        crasher = tmp_path / "crasher"
        crasher.write_text("#!/bin/sh\necho last words >&2\nkill -SEGV $$\n")
        crasher.chmod(0o755)
        monkeypatch.setattr(sys, "executable", str(crasher))
        rows = bench_of(meshes, tmp_path / "run").run("greedy", 0.05)
        assert [row["error"] for row in rows] == ["died of SIGSEGV last words"] * 2

    @pytest.mark.nightly
    @pytest.mark.skipif(sys.platform != "linux", reason="reads /proc")
    def test_stopping_a_run_ends_its_processes_and_records_nothing(self, tmp_path: Path) -> None:
        """Whether it is interrupted or killed: no process goes on, and what was running is done again next time."""
        folder = tmp_path / "meshes"
        folder.mkdir()
        sphere = trimesh.creation.icosphere(subdivisions=6)  # keeps a method busy for long
        for name in ("a.ply", "b.ply"):
            trimesh.util.concatenate([sphere, sphere.copy().apply_translation((1.5, 0, 0))]).export(folder / name)
        program = (
            "import signal, sys; from pathlib import Path; from benchmarks import Bench, BenchStore, find_meshes;"
            "signal.signal(signal.SIGINT, signal.default_int_handler);"  # ignored by what runs in a shell's background
            "m, o = map(Path, sys.argv[1:]);"
            "Bench(m, find_meshes(m), BenchStore(o)).run('greedy', 0.002)"
        )
        for number in (signal.SIGINT, signal.SIGKILL):
            out = tmp_path / f"run-{number}"
            with subprocess.Popen([sys.executable, "-c", program, folder, out], stderr=subprocess.DEVNULL) as run:
                try:
                    child = wait_for_child(run.pid)
                    run.send_signal(number)
                    run.wait(timeout=60)
                finally:
                    run.kill()
            assert wait_for_end(child)
            assert (out / "results.jsonl").read_text() == ""

    def test_a_broken_mesh_is_recorded(self, meshes: Path, tmp_path: Path) -> None:
        (meshes / "broken.obj").write_text("this is no mesh")
        rows = bench_of(meshes, tmp_path / "run").run("greedy", 0.05)
        assert [("error" in row) for row in rows] == [False, False, True]
        assert "Error" in rows[-1]["error"]
        assert "broken.obj" in failures(rows)

    def test_a_list_of_meshes(self, meshes: Path, tmp_path: Path) -> None:
        (tmp_path / "list.txt").write_text("# one\nbox.ply\n\n")
        assert find_meshes(meshes, tmp_path / "list.txt") == ["box.ply"]


@pytest.mark.slow
def test_what_another_version_made_is_made_again(meshes: Path, tmp_path: Path) -> None:
    bench = bench_of(meshes, tmp_path / "run")
    (first, _) = rows = bench.run("greedy", 0.05)
    bench.store.add({**first, "version": "0.0.0", "parts": 99})
    assert tuning.known_curve(bench, "greedy") == []
    written = bench.store.hulls_of(BenchTask(first["mesh"], "greedy", 0.05)).stat().st_mtime_ns
    again = bench.run("greedy", 0.05)
    assert [row["parts"] for row in again] == [row["parts"] for row in rows]
    assert again[1] == rows[1], "only that one"
    assert bench.store.hulls_of(BenchTask(first["mesh"], "greedy", 0.05)).stat().st_mtime_ns > written


class TestLayouts:
    """Data sets that people have are read as they are distributed; the files here are made up."""

    LAYOUTS: ClassVar = {
        "ShapeNetCore v1": {
            "02691156/10155655850468db78d106ce0a280f87/model.obj": True,
            "02691156/10155655850468db78d106ce0a280f87/model.mtl": False,
            "02691156/10155655850468db78d106ce0a280f87/images/texture0.jpg": False,
            "03001627/1006be65e7bc937e9141f9b58470d646/model.obj": True,
        },
        "ShapeNetCore v2": {
            "02691156/10155655850468db78d106ce0a280f87/models/model_normalized.obj": True,
            "02691156/10155655850468db78d106ce0a280f87/models/model_normalized.mtl": False,
            "02691156/10155655850468db78d106ce0a280f87/models/model_normalized.json": False,
            "02691156/10155655850468db78d106ce0a280f87/models/model_normalized.solid.binvox": False,
            "02691156/10155655850468db78d106ce0a280f87/models/model_normalized.surface.binvox": False,
            "02691156/10155655850468db78d106ce0a280f87/screenshots/10155655850468db78d106ce0a280f87-0.png": False,
            "03001627/1006be65e7bc937e9141f9b58470d646/models/model_normalized.obj": True,
            "taxonomy.json": False,
        },
        "COSEG": {
            "chairs/shapes/1.off": True,
            "chairs/gt/1.seg": False,
            "vases/shapes/1.off": True,
        },
        "HumanBody": {
            "meshes/train/adobe/alien.off": True,
            "meshes/train/faust/tr_reg_000.ply": True,
            "meshes/train/MIT_animation/meshes_bouncing/mesh_0000.obj": True,
            "meshes/test/shrec/1.off": True,
            "segs/test/shrec/shrec_1_full.txt": False,
        },
    }

    @pytest.mark.parametrize("layout", LAYOUTS)
    def test_every_mesh_is_found_and_has_a_name_of_its_own(self, layout: str, tmp_path: Path) -> None:
        files = self.LAYOUTS[layout]
        for name in files:
            (tmp_path / name).parent.mkdir(parents=True, exist_ok=True)
            (tmp_path / name).touch()
        found = find_meshes(tmp_path)
        assert found == sorted(name for name, wanted in files.items() if wanted)
        names = set(short_names(found).values())
        assert len(names) == len(found)
        assert not any("model" in name for name in names), "files that are all called alike say nothing"


class TestTuning:
    """On made-up methods, whose D_h is a known function of their number."""

    def tuned(
        self, monkeypatch: pytest.MonkeyPatch, tmp_path: Path, law: Any, target: float, method: str = "greedy"
    ) -> tuple[tuning.Point, int]:
        bench = Bench(tmp_path, ["one", "two"], BenchStore(tmp_path / "run"), say=lambda _: None)
        calls = []

        def run(self: Bench, name: str, setting: float) -> list[dict[str, Any]]:
            calls.append(setting)
            for mesh, factor in (("one", 0.5), ("two", 1.5)):
                self.store.add({"mesh": mesh, "method": name, "setting": setting, "hausdorff": factor * law(setting)})
            return [self.store.get(BenchTask(mesh, name, setting)) for mesh in self.names]  # type: ignore[misc]

        monkeypatch.setattr(Bench, "run", run)
        point = tune(bench, method, target)
        again = tune(bench, method, target)
        assert again.setting == point.setting
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

    def test_more_hulls_are_tighter(self, monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
        point, _ = self.tuned(monkeypatch, tmp_path, lambda n: 2 / n, 0.1, "vhacdx:hulls")
        assert point.setting == 20

    def test_a_step_is_bisected_to_its_end(self, monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
        point, calls = self.tuned(monkeypatch, tmp_path, lambda t: 0.01 if t < 0.137 else 0.2, 0.15)
        assert point.hausdorff == pytest.approx(0.2)  # the closer of the two there are
        assert calls <= 2 * tuning.TRIES

    def test_out_of_reach_ends_at_the_range(self) -> None:
        method = make_method("greedy")
        assert next_setting(method, [(1.0, 0.02)], 0.5, 3) is None
        assert next_setting(method, [(0.005, 0.9)], 0.5, 3) is None

    def test_failed_meshes_do_not_count(self) -> None:
        point = tuning.Point(0.1, [{"mesh": "a", "hausdorff": 0.2}, {"mesh": "b", "error": "died"}])
        assert point.hausdorff == 0.2
        assert math.isnan(tuning.Point(0.1, [{"mesh": "b", "error": "died"}]).hausdorff)


class TestTables:
    def rows(self, *parts: int, failed: str | None = None) -> list[dict[str, Any]]:
        numbers = set(tables.COLUMNS) - {"mesh", "method", "setting", "version", "error"}
        rows: list[dict[str, Any]] = [
            {"mesh": f"m{i}", "method": "x", "setting": 0.1, **dict.fromkeys(numbers, 1), "parts": n}
            for i, n in enumerate(parts)
        ]
        if failed:
            rows.append({"mesh": failed, "method": "x", "setting": 0.1, "error": "died"})
        return rows

    def test_spread(self) -> None:
        assert Spread.of([1, 2, 6]) == Spread(3, 6, pytest.approx(7**0.5))
        assert Spread.of([5]) == Spread(5, 5, 0)

    def test_a_mesh_that_one_fails_on_counts_for_none(self) -> None:
        a, b = self.rows(2, 4, 100), self.rows(3, 5, failed="m2")
        assert common_meshes([a, b]) == {"m0", "m1"}
        text = comparison([("a", a), ("b", b)]).markdown()
        assert "| 2 meshes | #P |" in text
        assert "| a | 3.0 (4.0, ± 1.4) | 1 |" in text
        assert "| b | 4.0 (5.0, ± 1.4) | 1.37 ± 0.12 |" in text
        assert [line[-1] for line in details([("a", a), ("b", b)]).lines] == ["0 of 3", "1 of 3"]

    def test_a_method_that_always_fails(self) -> None:
        groups = [("a", self.rows(2)), ("b", self.rows(failed="m0"))]
        assert "| b | – | – |" in comparison(groups).markdown()
        assert [line[-1] for line in details(groups).lines] == ["0 of 1", "1 of 1"]

    def test_ratio(self) -> None:
        assert ratio_of_parts(self.rows(2, 8), self.rows(4, 4)) == "1.00 ± 0.69"
        assert ratio_of_parts(self.rows(failed="m0"), self.rows(4)) == "–"

    def test_names_tell_meshes_apart(self) -> None:
        named = short_names(["a/chair.obj", "b/chair.obj", "b/lamp.obj"])
        assert list(named.values()) == ["a/chair", "b/chair", "lamp"]
        assert short_names(["x/one.obj"]) == {"x/one.obj": "one"}
        same = short_names(["one.obj", "one.stl", "a/one.obj"])
        assert len(set(same.values())) == 3

    def test_csv_keeps_errors_with_commas(self) -> None:
        import csv
        import io

        rows = [*self.rows(2), {"mesh": "b", "method": "x", "setting": 0.1, "error": 'died, "badly"'}]
        read = list(csv.DictReader(io.StringIO(as_csv(rows))))
        assert read[0]["parts"] == "2"
        assert read[1]["error"] == 'died, "badly"'
        assert read[1]["parts"] == ""

    def test_markdown_escapes_bars(self) -> None:
        assert Table(["a", "|b|"], [["x|y", 1]]).markdown() == "| a | \\|b\\| |\n|---|---:|\n| x\\|y | 1 |"
