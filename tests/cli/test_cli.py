"""The command line: exit codes, what goes to stdout and stderr, and that errors come before the work."""

from __future__ import annotations

import io
import json
import re
import signal
import subprocess
import sys
import types
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import trimesh
from click.testing import CliRunner, Result

from rlacd.cli.main import app
from rlacd.cli.terminal import summary
from rlacd.decompose_mesh import decompose
from rlacd.decomposition import Decomposition
from rlacd.errors import MeshFileError, OptionError, OutputError
from rlacd.fit import ANY, LengthFit, Unit, told_apart
from rlacd.report import BodyRepair, Hausdorff
from rlacd.run import Progress, ProgressCallback
from tests.batch.trouble import write_ell
from tests.hulls import hull_of


@pytest.fixture
def mesh(tmp_path: Path) -> Path:
    return write_ell(tmp_path / "ell.stl")


@pytest.fixture(autouse=True)
def no_debugging(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv("RLACD_DEBUG", raising=False)


def rlacd(*words: object) -> Result:
    return CliRunner().invoke(app, [str(word) for word in words])


class StandIn:
    """Takes the place of `decompose_quietly` where a test needs it to be slow, stopped or broken."""

    def __init__(self) -> None:
        self.calls: list[dict[str, Any]] = []
        self.during: Callable[[], object] = lambda: None
        self.known: dict[str, Any] = {}

    def __call__(self, mesh: Path, *, progress: ProgressCallback, **options: Any) -> Decomposition:
        self.calls.append(options)
        complete = True
        for step in range(3):
            complete = complete and progress(Progress("cut", step, None, step + 1, 0.1 * step)) is not False
            if not complete:
                break
            self.during()
        source = trimesh.load(mesh, force="mesh")
        known = {
            "name": mesh.stem,
            "complete": complete,
            "stopped_by": None if complete else "cancel",
            "options": {"threshold": 0.05},
            "concavity": LengthFit((0.01,), 0.01, 0.05),
            "hausdorff": Hausdorff(0.02, float("nan")),
            "seconds": {"total": 0.3},
            "warnings": ("one body was open",),
            "unit": ANY,
        }
        return Decomposition.of([hull_of(source.vertices)], source, **{**known, **self.known})


@pytest.fixture
def stand_in(monkeypatch: pytest.MonkeyPatch) -> StandIn:
    module = types.ModuleType("rlacd.decompose_mesh")
    module.decompose_quietly = StandIn()  # type: ignore[attr-defined]
    monkeypatch.setitem(sys.modules, "rlacd.decompose_mesh", module)
    return module.decompose_quietly


# --- what a good run says ---------------------------------------------------------------------------------------------


def test_hulls_go_beside_the_input_by_default_and_stdout_stays_empty(mesh: Path, stand_in: StandIn) -> None:
    run = rlacd("decompose", mesh)
    assert (run.exit_code, run.stdout) == (0, "")
    assert len(trimesh.load_scene(mesh.with_name("ell_hulls.glb")).geometry) == 1
    for words in ("ell_hulls.glb", "1 hull,", "(threshold 0.05 units)", "0.30 s", "one body was open"):
        assert words in run.stderr
    assert stand_in.calls == [{}], "defaults belong to rlacd.decompose"


def test_lengths_are_said_in_the_unit_that_was_given(mesh: Path, stand_in: StandIn) -> None:
    stand_in.known = {"concavity": LengthFit(None, 0.0498, 0.05), "scale": 10.0, "hausdorff": Hausdorff(0.2, 0.0)}
    stand_in.known |= {"unit": Unit("mm", 1e-3)}
    glb = trimesh.load(mesh).export(mesh.with_suffix(".glb")) and mesh.with_suffix(".glb")
    said = "concavity at most 4.98 mm (threshold 5 mm); hulls reach 20 mm beyond the input and cover it\n"
    assert said in rlacd("decompose", glb, "--threshold", "5mm").stderr


@pytest.mark.parametrize(
    ("value", "limit", "words"),
    [
        (0.0110899, 0.0110901, ("0.01109", "0.01109")),
        (0.0110902, 0.0110901, ("0.0110902", "0.0110901")),
        (0.04, 0.05, ("0.04", "0.05")),
    ],
)
def test_what_is_met_looks_met_and_what_is_not_does_not(value: float, limit: float, words: tuple[str, str]) -> None:
    assert told_apart(value, limit) == words


def test_what_else_is_written_is_named_and_quiet_says_nothing(mesh: Path, stand_in: StandIn) -> None:
    words = ["decompose", mesh, "--report", mesh.with_name("ell.json")]
    assert f"report: {mesh.with_name('ell.json')}" in rlacd(*words).stderr
    run = rlacd(*words, "-q", "-o", mesh.with_name("out.obj"))
    assert (run.exit_code, run.stdout, run.stderr) == (0, "", "")


def test_every_option_reaches_the_decomposition(mesh: Path, stand_in: StandIn) -> None:
    options = {
        "threshold": 0.1,
        "threshold_abs": 0.2,
        "overlap": 0.01,
        "overlap_abs": 0.02,
        "keep_open": 0.9,
        "keep_open_abs": 0.03,
        "max_hulls": 5,
        "max_vertices": 32,
        "max_faces": 60,
        "policy": "greedy",
        "resolution": 80,
        "gap": 0.1,
        "seed": 7,
        "threads": 1,
        "timeout": 2.5,
    }
    words = [word for name, value in options.items() for word in ("--" + name.replace("_", "-"), value)]
    words += ["--avoid", "a.obj", "--avoid", "b.stl"]
    assert rlacd("decompose", mesh, *words, "--no-merge").exit_code == 0
    options |= {name: str(options[name]) for name in ("threshold", "overlap", "keep_open", "gap")}
    assert stand_in.calls == [{**options, "avoid": ["a.obj", "b.stl"], "merge": False}]


def test_a_report_on_stdout_is_json_and_nothing_else(mesh: Path, stand_in: StandIn) -> None:
    run = rlacd("decompose", mesh, "--report", "-")
    report = json.loads(run.stdout)
    assert report["hulls"] == 1
    assert report["hausdorff"]["missed"] is None, "NaN is not JSON"


def test_the_summary_says_how_far_hulls_and_input_are_apart(tmp_path: Path) -> None:
    trimesh.creation.icosphere(2).export(tmp_path / "ball.stl")
    run = CliRunner().invoke(
        app, ["decompose", str(tmp_path / "ball.stl"), "-o", str(tmp_path / "b.glb"), "-t", "0.05"]
    )
    assert "(threshold 0.05 units); hulls reach nowhere beyond the input and cover it" in run.stderr


def test_the_summary_says_how_far_repair_led_from_the_input() -> None:
    result = decompose(trimesh.creation.icosphere(1), threshold=0.05, threads=1)
    for deviation, says in ((0.004, ""), (0.02, "repaired surface, up to 0.01 units from the input's (wrapped)")):
        moved = BodyRepair(body=0, step="wrapped", faces_in=80, faces_out=90, deviation=deviation)
        told = summary(replace(result, report=replace(result.report, scale=2.0, repair=(moved,))), "a.glb")
        assert says in told
        assert bool(says) == ("repaired surface" in told)


def test_the_summary_says_what_more_time_may_gain() -> None:
    frame = trimesh.creation.annulus(0.8, 1.0, 0.3, sections=64)
    best = decompose(frame, quality="best", budget=0.2, threads=1)
    search = best.report.search
    assert 0 <= search.last_gain <= search.seconds
    idle = search.seconds - search.last_gain
    said = f"saved no hull in the last {idle:.1f} of {search.seconds:.1f} s"
    assert (said in summary(best, "out.xml")) == (best.report.lower_bound < len(best))
    assert "saved no hull" not in summary(decompose(frame, threads=1), "out.xml")


def test_the_summary_counts_primitives_by_kind() -> None:
    boxes = [trimesh.creation.box((1, 2, 3)), trimesh.creation.box((1, 1, 1))]
    boxes[1].apply_translation((5, 0, 0))
    result = decompose(trimesh.util.concatenate(boxes), primitives=True, quality="fast", threads=1)
    assert "of them 2 boxes\n" in summary(result, "out.xml") + "\n"
    assert "of them" not in summary(decompose(boxes[0], quality="fast", threads=1), "out.xml")


def test_a_folder_can_be_filled_in_any_format(mesh: Path, stand_in: StandIn) -> None:
    assert rlacd("decompose", mesh, "-o", f"{mesh.parent}/out/", "--format", "stl").exit_code == 0
    assert (mesh.parent / "out" / "ell_000.stl").exists()


# --- what goes wrong --------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("words", "code", "says"),
    [
        (["-o", "{dir}/out.fbx"], 2, ".glb, .obj, .ply, .stl"),
        (["-o", "{dir}/ell.stl/out.glb"], 3, "is a file, not a folder"),
        (["-o", "-", "--format", "urdf"], 2, "give -o a file name"),
        (["-o", "-", "--report", "-"], 2, "--report - would overwrite the hulls"),
        (["--from", "obj"], 2, "give - as IN"),
        (["--report", "{dir}/ell.stl/r.json"], 3, "is a file, not a folder"),
        (["--report", "{dir}/r.pdf"], 2, "must end in .json, .html or .htm"),
        (["--report", "{dir}/ell_hulls.glb"], 2, "overwrite the hulls"),
        (["--criterion", "navigable", "--balls", "{dir}/b.ply"], 2, ".csv or .glb"),
        (["-o", ""], 2, "no name"),
        (["-o", "{dir}/out.glb", "--format", "obj"], 2, "contradicts"),
        (["--threshold", "tight"], 2, "threshold is 'tight'; it has to be a number, a share such as 5%, or a length"),
        (["--treshold", "1"], 2, "there is no option --treshold; did you mean --threshold?"),
        (["--max-hulls"], 2, "option '--max-hulls' requires an argument"),
        (["--max-hulls", "few"], 2, "--max-hulls is 'few'; it has to be an integer, at least 1"),
        (["--timeout", "soon"], 2, "--timeout is 'soon'; it has to be a positive number of seconds"),
        (["--report", "{dir}/r.html", "--up", "w"], 2, "x, y or z"),
        (["--preset", "havok"], 2, "one of mujoco, physx"),
        (["--density", "-1", "-o", "{dir}/out.xml"], 2, "density is -1.0"),
        (["--density", "7", "--mass", "3", "-o", "{dir}/out.xml"], 2, "density is 7.0 and mass is 3.0"),
        (["--format", "urdf", "-o", "{dir}/out.glb"], 2, "ends in .urdf"),
        (["--one-mesh", "-o", "{dir}/out.xml"], 2, "for .urdf files only"),
        (["--package-dir", "a=b"], 2, "is for robots"),
        (["--radius", "0.05"], 2, "--radius needs --criterion navigable"),
        (["--tolerance", "9mm"], 2, "navigable; how far hulls may be from the mesh is --threshold 9mm"),
        (["--balls", "b.csv"], 2, "--balls needs --criterion navigable"),
        (["--criterion", "navigable", "--tolerance", "-1"], 2, "tolerance"),
        (["--criterion", "navigable", "--seed-point", "1,2"], 2, "--seed-point is '1,2'; it takes 3 numbers"),
        (["--criterion", "navigable", "--closed-plane", "0,0,0,1"], 2, "normal"),
    ],
)
@pytest.mark.promise("before-work")
def test_mistakes_are_found_before_the_work(
    mesh: Path, stand_in: StandIn, words: list[str], code: int, says: str
) -> None:
    run = rlacd("decompose", mesh, *(word.format(dir=mesh.parent) for word in words))
    assert run.exit_code == code
    assert says in " ".join(run.stderr.split())
    assert run.stderr.startswith("rlacd: ")
    assert run.stderr.count("\n") == 1
    assert stand_in.calls == []
    assert [path.name for path in mesh.parent.iterdir()] == ["ell.stl"]


@pytest.mark.parametrize(
    ("error", "code"),
    [
        (MeshFileError("cup.glb is empty; export it again."), 2),
        (OptionError("threshold is -1; it has to be positive."), 2),
        (OutputError("the disk is full; free some space."), 3),
        (MemoryError(), 2),
        (RuntimeError("surprise\nsecond line"), 1),
        (KeyboardInterrupt(), 130),
    ],
)
@pytest.mark.promise("exit-codes")
def test_errors_are_one_sentence_and_a_code(mesh: Path, stand_in: StandIn, error: BaseException, code: int) -> None:
    def fail() -> None:
        raise error

    stand_in.during = fail
    run = rlacd("decompose", mesh)
    assert run.exit_code == code
    assert run.stderr.startswith("rlacd: ")
    assert run.stderr.count("\n") == 1
    assert "Traceback" not in run.output
    assert ("RLACD_DEBUG=1" in run.stderr) == (code == 1)
    assert not mesh.with_name("ell_hulls.glb").exists()


@pytest.mark.parametrize(
    ("words", "typed"),
    [
        (["chair one.glb", "-t", "0.02"], "rlacd decompose 'chair one.glb' -t 0.02"),
        (["robot.urdf"], "rlacd decompose robot.urdf"),
        (["{dir}"], "rlacd batch {dir}"),
    ],
)
def test_a_file_in_place_of_a_command_tells_what_to_type(mesh: Path, words: list[str], typed: str) -> None:
    run = rlacd(*(word.format(dir=mesh.parent) for word in words))
    assert run.exit_code == 2
    assert run.stderr.endswith(f"did you mean  {typed.format(dir=mesh.parent)}\n")
    assert rlacd("decompsoe").stderr == "rlacd: there is no command 'decompsoe'; did you mean decompose?\n"


@pytest.mark.parametrize(
    ("words", "says"),
    [
        ("view -", "only rlacd decompose reads stdin"),
        ("view {dir}/nothing.glb", "does not exist"),
        ("view {dir}", "is a folder"),
        ("view {dir}/ell.stl --port 99999", "not a port"),
        ("view {dir}/ell.stl --up w", "x, y or z"),
        ("view {dir}/ell.stl --criterion volume --threshold 0.05", "threshold is 0.05; it has to be left out"),
        ("view {dir}/ell.stl --openings wide", "auto, small, solid, thin"),
        ("info -", "only rlacd decompose reads stdin"),
        ("view {dir}/ell.stl --threshold 2mm", "it has to be a number or a share such as 2%"),
        ("decompose {dir}/no/chair.glb", "{dir}/no/chair.glb does not exist: check the spelling and the folder"),
        ("decompose https://example.com/chair.glb", "is an address, and nothing is fetched: download the file"),
        ("decompose {dir}/ell.stl {dir}/ell.stl", "rlacd batch {dir} -o hulls/ --glob '*.stl'"),
        ("decompose {dir}", "rlacd batch {dir} -o hulls/"),
        ("decompose {dir}/ell.stl {dir}/out.obj", "rlacd decompose {dir}/ell.stl -o {dir}/out.obj"),
        ("batch {dir}", "a batch needs -o"),
        ("decompose", "missing argument 'IN'; rlacd decompose --help shows"),
        ("train {dir}", "missing option '--run' / '-o'; rlacd train --help shows"),
        ("sell", "there is no command 'sell'; use one of decompose, tradeoff, info, view, batch, train"),
        ("--verson", "there is no option --verson; did you mean --version?"),
        ("view {dir}/ell.stl --port http", "'http' is not a valid integer"),
        ("batch {dir} -o {dir}/out --link finger=1mm", "--link is for one robot: run  rlacd decompose"),
    ],
)
def test_what_a_command_is_not_for_is_one_sentence(mesh: Path, words: str, says: str) -> None:
    run = rlacd(*words.format(dir=mesh.parent).split())
    assert run.exit_code == 2
    assert says.format(dir=mesh.parent) in run.stderr
    assert run.stderr.count("\n") == 1


def test_debugging_lets_the_traceback_through(mesh: Path, stand_in: StandIn, monkeypatch: pytest.MonkeyPatch) -> None:
    def fail() -> None:
        raise RuntimeError("surprise")

    stand_in.during = fail
    monkeypatch.setenv("RLACD_DEBUG", "1")
    assert isinstance(rlacd("decompose", mesh).exception, RuntimeError)


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
@pytest.mark.parametrize(("times", "code"), [(1, 4), (2, 130)])
@pytest.mark.promise("ctrl-c")
def test_ctrl_c_once_writes_what_is_reached_and_twice_quits_and_writes_nothing(
    mesh: Path, stand_in: StandIn, times: int, code: int, number: int
) -> None:
    stand_in.during = lambda: list(map(signal.raise_signal, [number] * times))
    before = signal.getsignal(number)
    run = rlacd("decompose", mesh)
    assert run.exit_code == code
    assert ("stopped by Ctrl-C" in run.stderr) == (times == 1)
    assert mesh.with_name("ell_hulls.glb").exists() == (times == 1)
    assert signal.getsignal(number) is before


def test_help_names_every_exit_code_and_version_is_printed() -> None:
    run = rlacd("decompose", "--help")
    assert run.exit_code == 0
    for code in ("0 ", "1 ", "2 ", "3 ", "4 ", "5 ", "130 "):
        assert f"  {code}" in run.output
    import rlacd as package

    assert rlacd("--version").stdout == f"rlacd {package.__version__}\n"


def test_help_speaks_of_its_own_command_only_in_whole_sentences() -> None:
    assert "..." not in rlacd("--help").output.partition("Commands:")[2]
    assert "train" not in rlacd("batch", "--help-all").output
    assert "batch" not in rlacd("train", "--help").output.partition("Exit codes:")[0].replace("--batch", "")


def test_help_shows_ten_options_and_help_all_every_one() -> None:
    asked = (rlacd("decompose", word).output for word in ("--help", "--help-all"))
    short, whole = (set(re.findall(r"^  (?:-\w, )?(--[a-z-]+)", text, re.MULTILINE)) for text in asked)
    assert {"--output", "--threshold", "--max-hulls", "--quality"} < short < whole
    assert len(short - {"--help", "--help-all"}) == 10
    assert {"--seed", "--balls", "--radius-abs"} <= whole - short


# --- the real thing ---------------------------------------------------------------------------------------------------


def shell(*words: object, **options: Any) -> subprocess.CompletedProcess[str]:
    command = [sys.executable, "-c", "from rlacd.cli.main import main; main()", *(str(word) for word in words)]
    return subprocess.run(command, capture_output=True, text=True, timeout=120, **options)


@pytest.mark.slow
@pytest.mark.skipif(not Path("/dev/full").exists(), reason="there is no device that is always full")
@pytest.mark.parametrize("words", ["decompose {} --quiet --report -", "--help", "info --help", "decompose --help-all"])
@pytest.mark.parametrize(("out", "says"), [(">/dev/full", "No space left"), (">&-", "it is closed")])
def test_what_cannot_be_printed_is_an_error_of_one_sentence(mesh: Path, words: str, out: str, says: str) -> None:
    command = f"{sys.executable} -m rlacd {words.format(mesh)} {out}"
    run = subprocess.run(["sh", "-c", command], stderr=subprocess.PIPE, text=True, timeout=120, check=False)
    assert (run.returncode, len(run.stderr.splitlines())) == (3, 1), run.stderr
    assert "cannot write to stdout" in run.stderr
    assert says in run.stderr


EARLY = """
import signal, sys

class Early:
    def find_spec(self, name, *_):
        if name == {name!r}:
            signal.raise_signal(signal.{sent})

sys.meta_path.insert(0, Early())
from rlacd.__main__ import main
main()
"""
"""The command line, with Ctrl-C while a module is imported."""


@pytest.mark.parametrize("name", ["rlacd.cli.main", "click", "rlacd.cli.decompose", "trimesh.base"])
@pytest.mark.parametrize("sent", ["SIGINT", "SIGTERM"])
@pytest.mark.promise("exit-codes")
def test_ctrl_c_before_the_work_is_one_sentence(mesh: Path, name: str, sent: str) -> None:
    command = [sys.executable, "-c", EARLY.format(name=name, sent=sent), "decompose", str(mesh)]
    run = subprocess.run(command, capture_output=True, text=True, timeout=120, check=False)
    assert (run.returncode, run.stdout) == (130, "")
    assert run.stderr == "rlacd: interrupted; no file is left half-written.\n"
    assert not mesh.with_name("ell_hulls.glb").exists()


@pytest.mark.slow
@pytest.mark.parametrize(("words", "ending"), [(["--from", "stl"], "obj"), (["-o", "-", "--format", "glb"], "glb")])
def test_a_mesh_from_stdin_becomes_hulls_on_stdout(mesh: Path, words: list[str], ending: str) -> None:
    command = [sys.executable, "-m", "rlacd", "decompose", "-", *words, "--quality", "fast"]
    run = subprocess.run(command, input=mesh.read_bytes(), capture_output=True, timeout=120, check=False)
    assert run.returncode == 0, run.stderr
    read = trimesh.load_scene(io.BytesIO(run.stdout), file_type=ending)
    assert np.allclose(read.bounds, trimesh.load(mesh).bounds, atol=1e-6)
    assert run.stderr.startswith(b"stdout: ")
    assert [path.name for path in mesh.parent.iterdir()] == ["ell.stl"]


@pytest.mark.parametrize(
    ("words", "given", "says"),
    [
        ([], b"no mesh at all", "add --from obj"),
        ([], b"", "stdin is empty"),
        (["mug.obj"], b"", "the name of the output follows -o: rlacd decompose - -o mug.obj"),
        (["--from", "stl"], b"v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n", "stdin is not stl but obj: use --from obj"),
        (["--report", "-", "--from", "obj"], b"v 0 0 0\n", "--report - would overwrite the hulls"),
        (["--from", "obj"], b"v 0 0 0\nf 1 2 9\n", "stdin cannot be read as obj"),
        (["--from", "abc"], b"abc", "stdin is in a format that rlacd does not read"),
        (["--from", "urdf", "-o", "out.urdf"], b"<robot/>", "files beside it"),
    ],
)
def test_what_stdin_cannot_be_read_as_is_said(words: list[str], given: bytes, says: str) -> None:
    run = CliRunner().invoke(app, ["decompose", "-", *words], input=given)
    assert run.exit_code == 2
    assert says in run.stderr
    assert len(run.stderr.splitlines()) == 1


def test_hulls_of_stdin_are_not_poured_onto_a_terminal(monkeypatch: pytest.MonkeyPatch) -> None:
    terminal = types.SimpleNamespace(stdout=types.SimpleNamespace(isatty=lambda: True))
    monkeypatch.setattr("rlacd.cli.decompose.sys", terminal)
    run = rlacd("decompose", "-")
    assert (run.exit_code, len(run.stderr.splitlines())) == (2, 1)
    assert "give -o a file name" in run.stderr


@pytest.mark.slow
def test_a_real_run_in_a_pipe(mesh: Path) -> None:
    run = shell("decompose", mesh, "-o", mesh.with_name("out.obj"), "--report", "-")
    assert run.returncode == 0, run.stderr
    report = json.loads(run.stdout)
    read = trimesh.load_scene(mesh.with_name("out.obj"), split_objects=True)
    assert len(read.geometry) == report["hulls"] == len(report["concavity"]["per_part"])
    assert read.bounds == pytest.approx(trimesh.load(mesh).bounds, abs=1e-6)
    assert report["complete"] is True
    assert "\x1b" not in run.stderr, "no colours or bars in a pipe"


@pytest.mark.slow
def test_a_real_timeout_still_writes_hulls(mesh: Path) -> None:
    run = shell("decompose", mesh, "--timeout", "1e-6", "--report", "-")
    assert run.returncode == 4, run.stderr
    assert json.loads(run.stdout)["stopped_by"] == "timeout"
    assert mesh.with_name("ell_hulls.glb").exists()


@pytest.mark.slow
@pytest.mark.promise("repair-said")
def test_info_tells_bodies_and_repair(mesh: Path) -> None:
    text = shell("info", mesh)
    assert text.returncode == 0, text.stderr
    assert "24 triangles" in text.stdout
    facts = json.loads(shell("info", mesh, "--json").stdout)
    assert facts["faces"] == 24
    assert len(facts["repair"]) == 2
    assert facts["solid"]["volume"] == pytest.approx(2 * 2.0 * 0.4**2 - 0.4**3, rel=1e-4)
    assert shell("info", mesh.with_name("nothing.glb")).returncode == 2


# --- formats and presets ----------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("words", "written"),
    [
        (["--preset", "mujoco"], "ell_hulls.xml"),
        (["--preset", "bullet"], "ell_hulls.urdf"),
        (["--preset", "unity"], "ell_hulls.obj"),
        (["--preset", "unreal"], "ell_hulls.glb"),
        (["--format", "sdf"], "ell_hulls.sdf"),
        (["--format", "godot"], "ell_hulls.glb"),
        (["--preset", "unreal", "-o", "{dir}/out.obj"], "out.obj"),
        (["--preset", "unreal", "-o", "{dir}/out.stl"], "out.stl"),
        (["--preset", "mujoco", "-o", "{dir}/out.glb"], "out.glb"),
    ],
)
def test_presets_and_formats_choose_the_file(mesh: Path, stand_in: StandIn, words: list[str], written: str) -> None:
    run = rlacd("decompose", mesh, *(word.format(dir=mesh.parent) for word in words))
    assert run.exit_code == 0, run.stderr
    data = mesh.with_name(written).read_bytes()
    unreal = "unreal" in words and not written.endswith(".stl")
    assert (b"UCX_ell_00" in data) == unreal
    assert (b"ell_000-convcolonly" in data) == ("godot" in words)
    assert [call.get("preset") for call in stand_in.calls] == [words[1] if words[0] == "--preset" else None]
