"""`rlacd batch`: every mesh gets its row whatever the others do, and nothing finished is lost or done again."""

from __future__ import annotations

import json
import os
import re
import signal
import subprocess
import sys
import time
from collections import Counter
from pathlib import Path
from typing import Any

import psutil
import pytest
import trimesh
from click.testing import CliRunner, Result

from rlacd.batch import Summary, find_assets
from rlacd.batch.batch import _kinds
from rlacd.batch.mesh import _status
from rlacd.cli.batch_screen import summary_lines
from rlacd.cli.main import app
from rlacd.io.read import READERS as FORMATS
from tests.batch.trouble import make_trouble, tree, write_ell

TIMES = "timings.jsonl"


def batch(*words: object) -> Result:
    return CliRunner().invoke(app, ["batch", *(str(word) for word in words)])


def rows(out: Path, name: str = "manifest.jsonl") -> dict[str, dict[str, Any]]:
    return {row["mesh"]: row for row in map(json.loads, (out / name).read_text().splitlines())}


@pytest.fixture
def trouble(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> dict[str, str]:
    environment = make_trouble(tmp_path / "trouble")
    for name, value in environment.items():
        monkeypatch.setenv(name, value)
    return environment


@pytest.fixture
def assets(tmp_path: Path) -> Path:
    folder = tmp_path / "assets"
    for name, length in (("a.obj", 2.0), ("a.stl", 1.5), ("b/椅子.ply", 3.0)):
        write_ell(folder / name, length)
    return folder


# --- what a run leaves ------------------------------------------------------------------------------------------------


@pytest.mark.slow
@pytest.mark.promise("input-kept")
def test_no_result_goes_over_a_mesh(tmp_path: Path) -> None:
    """The results' folder holds the meshes', which holds one of its own name."""
    inner = tmp_path / "in" / "in"
    inner.mkdir(parents=True)
    trimesh.creation.box().export(inner.parent / "x.glb")
    trimesh.creation.box().export(inner / "x.stl")
    before = tree(tmp_path)
    for out in (tmp_path, inner.parent):
        for glob in ("**/*", "*.stl"):
            refused = batch(inner.parent, "-o", out, "--glob", glob)
            assert refused.exit_code == 2
            assert "overwrite the input" in refused.stderr or "among the meshes" in refused.stderr
            assert tree(tmp_path) == before
    assert batch(inner.parent, "-o", tmp_path, "--glob", "x.glb", "--dry-run").exit_code == 0


@pytest.mark.promise("batch-resumes")
def test_every_mesh_gets_hulls_and_a_row_and_is_not_done_again(assets: Path, tmp_path: Path) -> None:
    out = tmp_path / "out"
    run = batch(assets, "-o", out, "--jobs", 2)
    assert run.exit_code == 0, run.output
    assert "3 of 3 meshes are done" in run.stderr
    assert run.stdout == ""
    assert set(tree(out, ".rlacd/lock")) == {"a.obj.glb", "a.stl.glb", "b/椅子.glb", "manifest.jsonl", TIMES}
    told = rows(out)
    assert list(told) == sorted(told)
    for name, row in told.items():
        hulls = trimesh.load_scene(out / next(iter(row["outputs"]))).geometry
        assert row["status"] == "done"
        assert row["hulls"] == len(hulls) >= 2
        assert row["concavity"] <= 0.05
        assert rows(out, TIMES)[name]["seconds"] > 0

    before = tree(out)
    again = batch(assets, "-o", out)
    assert again.exit_code == 0
    assert "3 were done before" in again.stderr
    assert tree(out) == before

    write_ell(assets / "a.stl", 1.2)  # another mesh under the same name, a result that is gone, one that is cut off
    (out / "b" / "椅子.glb").unlink()
    third = batch(assets, "-o", out, "--jobs", 1)
    assert third.exit_code == 0
    assert "2 now" in third.stderr
    assert (out / "b" / "椅子.glb").read_bytes() == before["b/椅子.glb"]
    assert (out / "a.stl.glb").read_bytes() != before["a.stl.glb"]

    (assets / "a.stl").unlink()  # now there is no need to tell the two apart by their endings
    fourth = batch(assets, "-o", out, "--jobs", 1)
    assert fourth.exit_code == 0
    assert (out / "a.glb").read_bytes() == before["a.obj.glb"]
    assert not (out / "a.obj.glb").exists()


def box(path: Path, content: bytes = b"") -> None:
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_bytes(content or trimesh.creation.box().export(file_type=path.suffix[1:]).encode())


@pytest.mark.promise("own-files")
def test_no_name_stops_a_batch_and_no_file_of_others_is_replaced(tmp_path: Path) -> None:
    names = ["a.obj", "a.glb/b.obj", "manifest.jsonl.obj", "x.obj", "linked.obj", "z.obj"]
    for name in names:
        box(tmp_path / "in" / name)
    box(tmp_path / "in" / "notes.txt", b"no mesh")
    for words, ending in (([], ".glb"), (["--folders"], "/x_000.obj")):
        out = tmp_path / f"out{len(words)}"
        taken = out / ("x" + ending)
        box(taken, b"precious")
        box(tmp_path / "elsewhere", b"precious too")
        if not words:
            (out / "linked.glb").symlink_to(tmp_path / "elsewhere")
        run = batch(tmp_path / "in", "-o", out, "--jobs", 1, "--quality", "fast", *words)
        assert run.exit_code == 5, run.output
        assert "1 file (1 .txt)" in run.stderr
        told = rows(out)
        refused = {"x.obj"} if words else {"x.obj", "linked.obj"}
        assert {name for name, row in told.items() if row["status"] != "done"} == refused
        assert "is there already" in told["x.obj"]["error"]
        assert str(tmp_path) not in (out / "manifest.jsonl").read_text()
        assert (taken.read_bytes(), (tmp_path / "elsewhere").read_bytes()) == (b"precious", b"precious too")
        taken.unlink()
        batch(tmp_path / "in", "-o", out, "--jobs", 1, "--quality", "fast", *words)
        assert rows(out)["x.obj"]["status"] == "done", "tried again by the next run"


URDF = """<robot name="r"><link name="l"><visual><geometry><mesh filename="meshes/l.obj"/></geometry></visual>
<collision><geometry><mesh filename="meshes/l.obj"/></geometry></collision></link></robot>"""
MJCF = """<mujoco><asset><mesh name="m" file="meshes/l.obj"/></asset>
<worldbody><body><geom type="mesh" mesh="m"/></body></worldbody></mujoco>"""


def test_robots_and_stages_are_worked_on_like_meshes_and_other_xml_is_passed_over(tmp_path: Path) -> None:
    assets, out = tmp_path / "in", tmp_path / "out"
    box(assets / "meshes" / "l.obj")
    for name, text in (("r.urdf", URDF), ("r.xml", MJCF), ("package.xml", "<package/>"), ("bad.urdf", "no robot")):
        box(assets / name, text.encode())
    box(assets / "wide.xml", MJCF.encode("utf-16"))
    robots_usd = pytest.importorskip("tests.io.test_robots_usd")
    robots_usd.write_stage(assets / "stage.usda")
    how = ("--quality", "fast", "--format", "usd")
    run = batch(assets, "-o", out, "--jobs", 1, *how)
    assert run.exit_code == 5, run.output
    assert "1 file (1 .xml)" in run.stderr
    told = rows(out)
    assert {name: row["status"] for name, row in told.items()} == {
        "r.urdf": "warned",  # its link has no inertial
        **dict.fromkeys(["r.xml", "meshes/l.obj", "stage.usda"], "done"),
        **dict.fromkeys(["bad.urdf", "wide.xml"], "failed"),
    }
    assert "save it as UTF-8" in told["wide.xml"]["error"]
    assert set(told["r.urdf"]["outputs"]) == {"r.urdf", "r_urdf/r_l_000.obj", "r_urdf/r_hulls.json"}
    for name in ("r.urdf", "r.xml"):
        named = re.findall(r'file(?:name)?="([^"]+)"', (out / name).read_text(encoding="utf-8"))
        assert len(named) == 2, "what is shown and a hull"
        assert all((out / one).is_file() for one in named)
    (assets / "stage.usda").unlink()
    stage = robots_usd.Usd.Stage.Open(str(out / "stage.usd"))
    assert stage.GetPrimAtPath("/robot/table")
    assert len(robots_usd.colliders(stage)) == told["stage.usda"]["hulls"] > 1
    again = batch(assets, "-o", out, "--glob", "*.urdf", *how)
    assert "0 now" in again.stderr
    write_ell(assets / "meshes" / "l.obj")
    changed = batch(assets, "-o", out, "--glob", "r.*", "--jobs", 1, *how)
    assert "2 of 2 meshes are done" in changed.stderr
    assert rows(out)["r.urdf"]["hulls"] > 1, "done again when a mesh has changed"


def test_all_formats_that_are_read_are_meshes_of_a_batch(tmp_path: Path) -> None:
    for ending in FORMATS:
        (tmp_path / f"{ending}.{ending}").touch()
    assert [asset.name for asset in find_assets(tmp_path)] == sorted(f"{ending}.{ending}" for ending in FORMATS)


def test_a_dry_run_tells_and_writes_nothing(assets: Path, tmp_path: Path) -> None:
    units = ("--unit", "mm", "--threshold", "2mm", "--overlap", "1mm", "--keep-open", "3mm")
    run = batch(assets, "-o", tmp_path / "out", "--dry-run", "--format", "urdf", *units)
    assert run.exit_code == 0
    assert run.stdout.splitlines() == ["a.obj -> a.obj.urdf", "a.stl -> a.stl.urdf", "b/椅子.ply -> b/椅子.urdf"]
    assert "3 meshes: 0 done, 3 to do" in run.stderr
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize(
    ("words", "code", "says"),
    [
        (["{in}/no", "-o", "{in}/out"], 2, "not a folder"),
        (["{in}/empty", "-o", "{in}/out"], 2, "no mesh in"),
        (["{in}", "-o", "{in}/out", "--glob", "*.fbx"], 2, "'*.fbx'"),
        (["{in}", "-o", "{in}"], 2, "among the meshes"),
        (["{in}", "-o", "{in}/a.obj"], 3, "a.obj"),
        (["{in}", "-o", "{in}/out", "--redo", "some"], 2, "none, failed, all"),
        (["{in}", "-o", "{in}/out", "--format", "fbx"], 2, "unknown format"),
        (["{in}", "-o", "{in}/out", "--jobs", "0"], 2, "--jobs"),
        (["{in}", "-o", "{in}/out", "--shard", "4/3"], 2, "K/N"),
        (["{in}", "-o", "{in}/out", "--shard", "0/3"], 2, "K/N"),
        (["{in}", "-o", "nowhere://x"], 2, "address"),
        (["{in}", "-o", "{in}/out", "--policy", "nowhere.npz"], 2, "nowhere.npz"),
        (["{in}", "-o", "{in}/out", "--format", "mjcf", "--folders"], 2, "mjcf"),
        (["{in}", "-o", "{in}/out", "--one-mesh"], 2, "for .urdf files only: leave it out"),
    ],
)
def test_mistakes_are_one_sentence_and_leave_nothing(assets: Path, words: list[str], code: int, says: str) -> None:
    (assets / "empty").mkdir()
    before = tree(assets)
    run = batch(*(word.format(**{"in": assets}) for word in words))
    assert run.exit_code == code, run.output
    assert says in " ".join(run.stderr.split())
    assert tree(assets) == before


# --- trouble ----------------------------------------------------------------------------------------------------------


def test_a_summary_tells_what_is_warned_of_and_what_is_uncovered() -> None:
    said = ["Some lies 3.7 mm outside: repair dropped it."]
    missing = {"hausdorff": {"missed": 0.37}, "missed": "3.7 mm", "warnings": said}
    assert [_status(report) for report in ({"warnings": ["a"]}, missing, {"warnings": []})] == [
        *("warned", "uncovered", "done")
    ]
    row = {"mesh": "spoon.obj", "status": "uncovered", **missing}
    status = Counter({"done": 27, "warned": 12, "uncovered": 1})
    summary = Summary(40, status=status, uncovered=[row], warnings=Counter({"Some lies … outside": 13}))
    shown = "\n".join(summary_lines(summary, "out"))
    assert "out: 39 of 40 meshes are done, 12 of them with warnings, 1 uncovered\n" in shown
    assert "spoon.obj: hulls miss its surface by up to 3.7 mm" in shown
    assert "13 x warning: Some lies … outside" in shown


def test_what_is_wrong_with_a_mesh_is_said_once(tmp_path: Path) -> None:
    (tmp_path / "in").mkdir()
    trimesh.creation.box().export(tmp_path / "in" / "box.stl")
    (tmp_path / "in" / "bad.stl").write_text("junk")
    words = ["batch", str(tmp_path / "in"), "-o", str(tmp_path / "out"), "--jobs", "1"]
    first, again = (CliRunner().invoke(app, words).stderr for _ in range(2))
    assert first.count("bad.stl: cannot be read as stl") == 1, first
    assert again.count("bad.stl: cannot be read as stl") == 1, again


def test_warnings_are_counted_by_kind_whatever_their_numbers_and_units() -> None:
    one = ["1 hull sticks out by up to 0.3 m, more than 0.1 m: cut it.", "1 body became a shell (open at (1, 2, 3))."]
    two = [
        "3 hulls stick out by up to 7 mm, more than 2.5e-06 mm: cut them.",
        "4 hulls stick out by up to 1 mm, more than 0.5 mm: so.",
    ]
    kinds = _kinds([one, two, []])
    assert kinds == {"… hull sticks out by up to …, more than …": 2, "… body became a shell": 1}


@pytest.mark.slow
@pytest.mark.promise("batch-alone")
def test_no_mesh_stops_the_others(trouble: dict[str, str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    assets, out = tmp_path / "assets", tmp_path / "out"
    names = ["dies", "dies_once", "grows", "hangs", "prints", "bug", "well"]
    for name in names:
        write_ell(assets / f"{name}.obj")
    (assets / "bad.obj").write_text("no mesh")
    (assets / "gone.obj").symlink_to(assets / "nowhere")
    (assets / "shut.obj").mkdir()
    geometry = '<collision><geometry><mesh filename="lost.obj"/></geometry></collision>'
    (assets / "arm.urdf").write_text(f'<robot name="arm"><link name="link">{geometry}</link></robot>')
    monkeypatch.chdir(tmp_path)
    run = batch("assets", "-o", "out", "--jobs", 2, "--limit", 12, "--memory", 1)
    assert run.exit_code == 5, run.output
    told = rows(out)
    assert {name.removesuffix(".obj"): row["status"] for name, row in told.items()} == {
        **dict.fromkeys(["dies", "grows", "hangs", "bug"], "fallback"),
        **dict.fromkeys(["dies_once", "prints", "well"], "done"),
        **dict.fromkeys(["bad", "gone", "arm.urdf"], "failed"),
    }
    assert told["dies.obj"]["error"] == "its process died of SIGSEGV"
    assert told["hangs.obj"]["error"] == "it took more than 12 s"
    slowest = run.stderr.partition("slowest: ")[2].splitlines()[0]
    assert "hangs.obj " in slowest
    assert "well.obj" not in slowest
    assert told["grows.obj"]["error"] == "it needed more than 1 GB of memory"
    assert "surprise" in told["bug.obj"]["error"]
    assert "does not exist" in told["gone.obj"]["error"]
    assert told["arm.urdf"]["error"].startswith("arm.urdf refers to lost.obj, but lost.obj does not")
    assert str(tmp_path) not in (out / "manifest.jsonl").read_text(), "a manifest is the same wherever the meshes lie"
    assert told["well.obj"]["outputs"]
    assert told["bad.obj"]["outputs"] == {}
    hull = trimesh.load_scene(out / "dies.glb").geometry
    assert len(hull) == 1
    assert next(iter(hull.values())).bounds == pytest.approx(trimesh.load(assets / "well.obj").bounds, abs=1e-5)
    times = rows(out, TIMES)
    assert times["dies.obj"]["attempts"] == times["dies_once.obj"]["attempts"] == 2
    assert "last words" in times["dies.obj"]["last_words"]
    assert times["hangs.obj"]["attempts"] == 1, "it would take too long again"
    assert "attempts" not in times["well.obj"]

    again = batch(assets, "-o", out, "--limit", 12, "--memory", 1)  # the same limits: it would end the same
    assert (again.exit_code, "0 now" in again.stderr) == (5, True)
    refused = batch(assets, "-o", out, "--limit", 12, "--memory", 1, "--no-fallback", "--glob", "dies.obj")
    assert refused.exit_code == 5
    assert rows(out)["dies.obj"]["status"] == "failed"
    assert not (out / "dies.glb").exists()
    os.environ["PYTHONPATH"] = ""  # the trouble is over
    mended = batch(assets, "-o", out, "--redo", "failed", "--glob", "[dh]*.obj", "--jobs", 1)
    assert mended.exit_code == 0, mended.output
    assert rows(out)["dies.obj"]["status"] == rows(out)["hangs.obj"]["status"] == "done"
    assert (out / "dies.glb").read_bytes() == (out / "well.glb").read_bytes()


# --- shards -----------------------------------------------------------------------------------------------------------


@pytest.mark.promise("batch-resumes")
def test_shards_and_a_last_run_of_all_meshes_leave_what_one_run_leaves(tmp_path: Path) -> None:
    assets, out = tmp_path / "assets", tmp_path / "out"
    for number in range(7):
        box(assets / f"{number}" / "box.obj")
    (assets / "bad.obj").write_text("no mesh")
    how = ("--jobs", 1, "--quality", "fast")
    assert batch(assets, "-o", tmp_path / "plain", *how).exit_code == 5
    counts = []
    for k in (1, 2):  # of three: the third one's machine never came up
        run = batch(assets, "-o", out, "--shard", f"{k}/3", *how)
        assert run.exit_code in (0, 5), run.output
        again = batch(assets, "-o", out, "--shard", f"{k}/3", *how)
        assert "  0 now" in again.stderr
        counts.append(int(re.search(r"(\d+) were done before", again.stderr)[1]))  # type: ignore[index]
    assert not (out / "manifest.jsonl").exists()
    assert 0 < sum(counts) < 8
    last = batch(assets, "-o", out, *how)
    assert f"{8 - sum(counts)} now" in last.stderr
    assert f"{sum(counts)} were done before" in last.stderr
    without = (TIMES, ".rlacd/lock", ".rlacd/shard-1-of-3.lock", ".rlacd/shard-2-of-3.lock")
    assert tree(out, *without) == tree(tmp_path / "plain", *without)
    assert rows(out, TIMES).keys() == rows(out).keys()


# --- killed and stopped -----------------------------------------------------------------------------------------------


def start(assets: Path, out: Path, environment: dict[str, str], *words: object) -> subprocess.Popen[str]:
    command = [sys.executable, "-c", "from rlacd.cli.main import main; main()", "batch", str(assets), "-o", str(out)]
    return subprocess.Popen(
        [*command, "--jobs", "2", *(str(word) for word in words)],
        env={**os.environ, **environment},
        stderr=subprocess.PIPE,
        text=True,
    )


def wait_for_rows(out: Path, count: int, process: subprocess.Popen[str]) -> int:
    journal = out / "manifest.jsonl"
    while process.poll() is None:
        found = journal.read_bytes().count(b"\n") if journal.exists() else 0
        if found >= count:
            return found
        time.sleep(0.01)
    pytest.fail(f"ended before it had {count} rows: {process.stderr.read() if process.stderr else ''}")


@pytest.mark.nightly
@pytest.mark.promise("batch-resumes")
def test_killed_again_and_again_it_ends_as_if_undisturbed(trouble: dict[str, str], tmp_path: Path) -> None:
    assets = tmp_path / "assets"
    for number in range(5):
        write_ell(assets / f"slow_{number}.obj", 2.0 + number / 10)
    for name in ("dies", "well"):
        write_ell(assets / "deep" / f"{name}.stl")
    (assets / "bad.stl").write_text("no mesh")
    words = ["--preset", "bullet"]  # several files a mesh
    plain = tmp_path / "plain"
    assert start(assets, plain, trouble, *words).wait(timeout=300) == 5

    out = tmp_path / "out"
    for count in (0, 2, 5):
        process = start(assets, out, trouble, *words)
        if count:
            wait_for_rows(out, count, process)
        else:
            time.sleep(3)
        children = psutil.Process(process.pid).children(recursive=True)
        process.send_signal(signal.SIGKILL)
        process.wait()
        _, alive = psutil.wait_procs(children, timeout=30)
        assert not alive, "workers end with the run that started them"
    last = start(assets, out, trouble, *words)
    assert last.wait(timeout=300) == 5
    said = last.stderr.read() if last.stderr else ""
    assert "0 were done before" not in said
    assert tree(out, TIMES) == tree(plain, TIMES)
    assert set(rows(out, TIMES)) >= set(rows(out)) - {"bad.stl"}


@pytest.mark.slow
def test_ctrl_c_finishes_what_is_running_and_the_next_run_goes_on(trouble: dict[str, str], tmp_path: Path) -> None:
    assets, out = tmp_path / "assets", tmp_path / "out"
    for number in range(6):
        write_ell(assets / f"slow_{number}.obj", 2.0 + number / 10)
    process = start(assets, out, {**trouble, "TROUBLE_SLOW": "1.5"})
    wait_for_rows(out, 1, process)
    process.send_signal(signal.SIGINT)
    _, said = process.communicate(timeout=120)
    assert process.returncode == 4, said
    assert "stopped early" in said
    done = rows(out)
    assert 1 <= len(done) < 6
    assert all((out / name).stat().st_size == size for row in done.values() for name, size in row["outputs"].items())
    before = {name: (out / name).stat().st_mtime_ns for row in done.values() for name in row["outputs"]}
    assert batch(assets, "-o", out, "--jobs", 2).exit_code == 0
    assert len(rows(out)) == 6
    assert all((out / name).stat().st_mtime_ns == then for name, then in before.items()), "none is made twice"


@pytest.mark.nightly
def test_ctrl_c_twice_quits_at_once(trouble: dict[str, str], tmp_path: Path) -> None:
    assets, out = tmp_path / "assets", tmp_path / "out"
    write_ell(assets / "a.obj")
    write_ell(assets / "hangs.obj")
    process = start(assets, out, trouble)
    wait_for_rows(out, 1, process)
    process.send_signal(signal.SIGINT)
    time.sleep(1)
    assert process.poll() is None, "the first one waits for what is running"
    process.send_signal(signal.SIGINT)
    _, said = process.communicate(timeout=60)
    assert process.returncode == 130, said
    assert "Traceback" not in said
    assert batch(assets, "-o", out, "--glob", "a.obj", "--dry-run").stderr.startswith("1 mesh: 1 done")
