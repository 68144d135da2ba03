"""What README, examples and pages show works as written, and the tables of options and objects are complete."""

from __future__ import annotations

import functools
import inspect
import json
import re
import shlex
import shutil
import subprocess
import sys
from ctypes.util import find_library
from importlib import import_module
from itertools import takewhile
from pathlib import Path
from typing import Any

import click
import numpy as np
import pytest
import trimesh
from click.testing import CliRunner

import rlacd
from rlacd.cli.main import app
from rlacd.compat import coacd
from rlacd.viewer import viewer
from tests.option_table import PAGE, STUB, options_table, signatures
from tests.scripts import script

ROOT = Path(__file__).resolve().parent.parent


def test_the_sample_is_two_closed_bodies_of_a_few_thousand_triangles() -> None:
    sample = script(ROOT / "examples" / "sample.py").sample
    scene = sample()
    assert sample().export(file_type="glb") == scene.export(file_type="glb"), "it is the same every time"
    assert set(scene.geometry) == {"chair", "jug"}
    assert all(mesh.is_watertight and mesh.body_count == 1 for mesh in scene.geometry.values())
    assert scene.geometry["chair"].euler_number == 2 - 2 * 7, "a chair with seven windows to see through"
    assert scene.geometry["jug"].euler_number == 0, "a jug with one handle"
    assert 2000 < sum(len(mesh.faces) for mesh in scene.geometry.values()) < 6000
    height = scene.extents[1]
    assert height == pytest.approx(0.9, abs=0.02), "metres, y up"


@pytest.mark.nightly
def test_the_script_that_trains_on_one_mesh_falls_from_random_planes_to_greedys(tmp_path: Path) -> None:
    pytest.importorskip("torch", reason="needs the extra train")
    points = script(ROOT / "examples" / "train_one_mesh.py").main(None, tmp_path / "run")
    own = [point["validation_own_plane"] for point in points]
    assert min(own) <= 1 < min(own[0], points[0]["validation_random"])
    assert points[-1]["seconds"] < 300


@pytest.mark.slow
def test_the_notebook_holds_a_ball_and_stores_what_it_prints(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    for package in ("nbclient", "ipykernel", "mujoco", "mitsuba", "PIL"):
        pytest.importorskip(package)
    if not find_library("EGL"):
        pytest.skip("MuJoCo draws without a display by EGL, which is not installed")
    monkeypatch.setenv("MUJOCO_GL", "egl")
    path = ROOT / "examples" / "quickstart.ipynb"
    stored = [cell.get("outputs", []) for cell in json.loads(path.read_text(encoding="utf-8"))["cells"]]
    notebook = import_module("nbformat").read(path, as_version=4)
    import_module("nbclient").NotebookClient(notebook, resources={"metadata": {"path": tmp_path}}).execute()
    printed = ["".join(part.get("text", "") for part in cell.get("outputs", [])) for cell in notebook.cells]
    assert ["".join("".join(part.get("text", "")) for part in cell) for cell in stored] == printed
    assert sum("image/png" in part.get("data", {}) for cell in stored for part in cell) == 2
    assert path.stat().st_size < 300_000, "small enough to show on a code host"


@functools.cache
def gallery() -> dict[str, list[str]]:
    """The rows of the gallery's table, by the name of the object."""
    text = (ROOT / "docs" / "gallery.md").read_text(encoding="utf-8")
    rows = [[cell.strip() for cell in line.split("|")[1:-1]] for line in text.splitlines() if line.startswith("| ")]
    return {row[0]: row[1:] for row in rows[1:]}


QUICK = ["vhacd/lamp.ply", "vhacd/horse_walk.ply", "vhacd/teddy.ply"]
OBJECTS = re.findall(r'"(\w+/\S+\.ply)"', (ROOT / "examples" / "gallery.py").read_text(encoding="utf-8"))


@pytest.mark.parametrize(
    "name", [pytest.param(n, marks=pytest.mark.slow if n in QUICK else pytest.mark.nightly) for n in OBJECTS]
)
def test_rows_of_the_gallery_are_what_the_objects_give(corpus: Path, name: str) -> None:
    pytest.importorskip("PIL", reason="the extra view is not installed")
    assert len(gallery()) == len(OBJECTS) == 12
    result = rlacd.decompose(corpus / "test" / name)
    cells = [f"{len(result.source.faces):,}", str(len(result)), f"{result.report.triangles:,}"]
    stem = Path(name).stem.partition("-")[0].lower()
    assert gallery()[stem] == [*cells, f"{result.report.hausdorff.added:.3f}"]
    assert (ROOT / "docs" / "gallery_objects" / f"{stem}.webp").is_file()


@pytest.mark.slow
def test_the_furnished_room_stays_open_for_a_small_ball_only() -> None:
    """Under the bed and in the shelf, where only the small one goes, and in the middle of the room, where both go."""
    places = [(3.5, 1.5, 0.2), (1.1, 2.7, 0.25), (1.0, 1.5, 1.3)]
    inside = []
    for radius in ("2%", "10%"):
        space = rlacd.NavigableSpace(radius, tolerance="1%")
        hulls = rlacd.decompose(
            script(ROOT / "examples" / "furnished_room.py").room(), criterion=space, policy="navacd", quality="fast"
        )
        depths = [np.einsum("fi,pfi->pf", h.face_normals, h.triangles[:, 0] - np.array(places)[:, None]) for h in hulls]
        inside.append(np.any([(depth > 0).all(axis=1) for depth in depths], axis=0).tolist())
    assert inside == [[False, False, False], [True, True, False]]


def test_the_documentation_holds_the_table_of_options() -> None:
    assert options_table() in PAGE.read_text(encoding="utf-8"), "run  python -m tests.option_table"


@pytest.mark.slow
def test_five_minutes_shows_what_the_command_prints_for_the_sample(tmp_path: Path) -> None:
    script(ROOT / "examples" / "sample.py").sample().export(tmp_path / "chair.glb")
    shown = (ROOT / "docs" / "start.md").read_text(encoding="utf-8").split("```text\n")[1].split("```")[0]
    run = CliRunner().invoke(app, ["decompose", str(tmp_path / "chair.glb")])
    assert run.exit_code == 0
    said = re.sub(r"[\d.]+ s$", "…", run.stderr.replace(f"{tmp_path}/", ""), flags=re.MULTILINE)
    assert said == shown
    assert (tmp_path / "chair_hulls.glb").is_file()


def test_the_readme_works_in_a_clone_and_on_a_package_index() -> None:
    """Pictures and links lead to files that exist; outside the repository they have addresses."""
    readme = (ROOT / "README.md").read_text(encoding="utf-8")
    pyproject = (ROOT / "pyproject.toml").read_text(encoding="utf-8")
    targets = re.findall(r"\]\(([^)]+)\)", readme) + re.findall(r'src="([^"]+)"', readme)
    assert len(targets) > 10
    for target in targets:
        assert target.startswith("https://") or (ROOT / target.partition("#")[0]).is_file(), target
    for pattern, replacement in re.findall(r"pattern = '(.+)', replacement = '(.+)' }", pyproject):
        readme = re.sub(pattern, replacement, readme)
    assert len(re.findall(r"""(?:\]\(|src=")https://""", readme)) == len(targets)


INPUT = {"mesh", "faces", "file_type"}


@pytest.mark.promise("all-options")
def test_the_table_names_every_option_and_the_command_offers_every_argument() -> None:
    table = "".join(line.split("|")[1] for line in options_table().splitlines() if line.startswith("|"))
    command = app.get_command(click.Context(app), "decompose")
    options = {
        name for p in command.params if not getattr(p, "hidden", False) for name in p.opts if name.startswith("--")
    } - {
        "--from",  # of stdin, see docs/formats.md
        "--like",  # a report, see docs/reference/report.md
        "--help",
        "--help-all",
    }
    assert {name for name in options if f"`{name}`" not in table and f"{name}/" not in table} == set()
    arguments = set(inspect.signature(rlacd.decompose).parameters) - INPUT
    assert arguments - {"progress", "volume_tolerance"} <= {parameter.name for parameter in command.params}
    assert {name for name in arguments if f"`{name}`" not in table} == set()


def test_editors_and_type_checkers_see_the_options_as_they_are_stated_once() -> None:
    assert STUB.read_text(encoding="utf-8").endswith(signatures()), "run  python -m tests.option_table"


@pytest.mark.nightly
def test_the_guide_to_tight_fits_shows_the_numbers_that_its_script_prints(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    script(ROOT / "examples" / "tight_fits.py").main(tmp_path / "hulls.webp")
    page = (ROOT / "docs/guides/tight_fits.md").read_text(encoding="utf-8")
    printed = capsys.readouterr().out.replace("=None", "=–")
    rows = re.findall(r"^(\S+ mm): (\d+) chords, (\d+) hulls, at least (\d+)$", printed, re.MULTILINE)
    rows += re.findall(r"keep_open=(\S+): (\d+) hulls, clear radius (\S+ mm)$", printed, re.MULTILINE)
    assert len(rows) == 7
    assert all(f"| {' | '.join(row)} |" in page.replace("| 1 mm", "| 1.0 mm") for row in rows)


SNIPPET = re.compile(r"^```python\n(.*?)^```$", re.MULTILINE | re.DOTALL)
SHELL = re.compile(r"^```sh\n(.*?)^```$", re.MULTILINE | re.DOTALL)
BEFORE = re.compile(r"^.*# before.*\n", re.MULTILINE)
"""What a reader is told to replace, which needs the other tool."""

PAGES_OF_TEXT = [ROOT / "README.md", *sorted((ROOT / "docs").rglob("*.md"))]

PAGES = {
    str(page.relative_to(ROOT)): found
    for page in PAGES_OF_TEXT
    if page.name != "simulators.md" and (found := SNIPPET.findall(page.read_text(encoding="utf-8")))
}
"""But for the recipes for simulators: tests/engines/test_recipes.py."""

COMMAND = re.compile(r"^ *(?:rlacd|python -m) ([a-z].*)$", re.MULTILINE)
COMMANDS = sorted(
    {
        line
        for page in PAGES_OF_TEXT
        for block in SHELL.findall(page.read_text(encoding="utf-8"))
        for line in COMMAND.findall(block)
        if not line.startswith(("fuzz", "tests", "pip"))
    }
)


MESHES = [
    "assets/furniture/stool.obj",
    "block.stl",
    "chair.glb",
    "chair.obj",
    "cupboard.glb",
    "house.glb",
    "link.obj",
    "mesh.ply",
    "mug.glb",
    "rack.stl",
    "scan.ply",
    "SM_Chair.glb",
]
"""The files that pages name."""


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A folder with the files that pages name; nothing waits for Ctrl-C, or changes other packages for later tests."""
    post = trimesh.creation.box((1, 1, 3))
    seat = trimesh.creation.box((3, 1, 1), trimesh.transformations.translation_matrix((1, 0, -1)))
    ell = trimesh.boolean.union([post, seat])
    (tmp_path / "assets" / "furniture").mkdir(parents=True)
    (tmp_path / "run").mkdir()
    shutil.copy(Path(rlacd.__file__).parent / "policies" / "rl_acd.npz", tmp_path / "run" / "policy.npz")
    for name in MESHES:
        ell.export(tmp_path / name)
    for robot, mesh in {"robot": "link.obj", "arm": "package://arm_description/link.obj"}.items():
        (tmp_path / f"{robot}.urdf").write_text(
            '<robot name="r"><link name="finger_tip"><collision><geometry>'
            f'<mesh filename="{mesh}" scale="0.1 0.1 0.1"/></geometry></collision></link></robot>'
        )
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(viewer.ViewServer, "wait", lambda self: None)
    monkeypatch.setitem(sys.modules, "coacd", coacd)
    monkeypatch.setattr(trimesh.decomposition, "convex_decomposition", trimesh.decomposition.convex_decomposition)
    return tmp_path


def test_the_readme_and_the_first_pages_have_snippets() -> None:
    assert {"README.md", "docs/index.md", "docs/start.md", "docs/coming_from.md", "docs/policies.md"} <= set(PAGES)


@pytest.mark.parametrize("page", PAGES)
def test_snippets_run_as_written(folder: Path, page: str) -> None:
    mesh = trimesh.load_mesh(folder / "link.obj")
    known: dict[str, Any] = {"rlacd": rlacd, "np": np, "mesh": mesh}
    known |= {"vertices": mesh.vertices, "points": mesh.vertices, "faces": mesh.faces}
    for snippet in PAGES[page]:
        exec(compile(BEFORE.sub("", snippet), page, "exec"), known)


@pytest.mark.parametrize("line", COMMANDS)
def test_commands_have_the_options_that_pages_use(line: str) -> None:
    words = list(
        takewhile(lambda word: word not in {"|", ">", "&&", ";"}, shlex.split(line.replace("SEED", "1"), comments=True))
    )
    at: Any = app
    if words[0].startswith("benchmarks.learned."):
        assert import_module(words[0]).parser().parse_args(words[1:]).meshes
        return
    if words[0] == "benchmarks":
        _, name, *words = words
        at = import_module(f"benchmarks.{name.replace('-', '_')}").app
    while hasattr(at, "resolve_command"):
        _, at, words = at.resolve_command(at.context_class(at), words)
    at.make_context("rlacd", words)


@pytest.mark.nightly
@pytest.mark.parametrize(
    "line", [line for line in COMMANDS if re.match(r"(decompose|info|tradeoff|batch)\b(?!.*ray)", line)]
)
def test_commands_run_in_a_process_of_their_own(folder: Path, line: str) -> None:
    """Where no other test has imported what a command forgets."""
    words = shlex.split(line.replace("/opt/robots/arm", "."), comments=True)
    done = subprocess.run([sys.executable, "-m", "rlacd", *words], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
