"""What `import rlacd` costs and offers: every public name, and no library before it is needed."""

from __future__ import annotations

import compileall
import dataclasses
import json
import os
import pkgutil
import shutil
import subprocess
import sys
from pathlib import Path

import pytest
import trimesh

import rlacd
from rlacd import _native
from rlacd.learn.options import TrainOptions
from rlacd.options import Options

HEAVY = {"numpy", "scipy", "trimesh", "manifold3d", "networkx", "onnxruntime", "rich", "torch", "click"}


def modules_after(code: str) -> set[str]:
    """Names of everything imported by a fresh interpreter that runs `code`."""
    show = f"import json, sys\n{code}\nprint(json.dumps(sorted(sys.modules)))"
    done = subprocess.run([sys.executable, "-c", show], capture_output=True, text=True, check=True)
    return set(json.loads(done.stdout.splitlines()[-1]))


def test_import_loads_no_library() -> None:
    loaded = modules_after("import rlacd")
    assert not (loaded | modules_after("from rlacd import OptionError, RlacdError")) & HEAVY
    assert {name for name in loaded if name.startswith("rlacd")} == {"rlacd", "rlacd._version"}


@pytest.mark.parametrize("arguments", [[], ["--help"], ["decompose", "--help"], ["batch", "--help"]])
def test_help_does_not_wait_for_the_geometry(arguments: list[str]) -> None:
    run = f"from rlacd.cli.main import app\ntry:\n    app({arguments!r})\nexcept SystemExit:\n    pass"
    assert not modules_after(run) & {"numpy", "scipy", "trimesh", "onnxruntime", "torch"}


def test_a_command_does_not_wait_for_libraries_that_it_does_not_use(tmp_path: Path) -> None:
    """trimesh imports whatever it finds; a bar is for terminals, and watching is for processes."""
    trimesh.creation.box().export(tmp_path / "box.obj")
    words = ["decompose", str(tmp_path / "box.obj"), "--quality", "fast", "--quiet"]
    loaded = modules_after(f"from rlacd.cli.main import app\napp({words!r}, standalone_mode=False)")
    assert "trimesh" in loaded
    unused = {
        "scipy",
        "networkx",
        "shapely",
        "cascadio",
        "fcl",
        "jsonschema",
        "lxml",
        "rich",
        "onnxruntime",
        "torch",
        "mitsuba",
        "ray",
        "rlacd.viewer.picture",
    }
    assert not loaded & unused


ROBOTS = {
    "urdf": '<robot name="r"><link name="l"><collision><geometry><mesh filename="box.obj"/></geometry></collision>'
    "</link></robot>",
    "xml": '<mujoco><asset><mesh name="b" file="box.obj"/></asset><worldbody><body><geom type="mesh" mesh="b"/></body>'
    "</worldbody></mujoco>",
}


@pytest.mark.parametrize("ending", ["dae", "3mf", "urdf", "xml", "stl"])
def test_a_process_reads_its_file_with_the_libraries_that_trimesh_was_loaded_without(
    tmp_path: Path, ending: str
) -> None:
    """Other tests have trimesh and its libraries loaded when a command begins; a user's process has not."""
    file, box = tmp_path / f"a.{ending}", trimesh.creation.box()
    box.export(tmp_path / "box.obj")
    file.write_text(ROBOTS[ending]) if ending in ROBOTS else box.export(file)
    words = [
        "decompose",
        str(file),
        "--quality",
        "fast",
        "--output",
        str(tmp_path / "out") + (f".{ending}" if ending in ROBOTS else ".glb"),
    ]
    done = subprocess.run([sys.executable, "-m", "rlacd", *words], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    used = f"import rlacd.cli.lean, pathlib; rlacd.cli.lean.import_trimesh(pathlib.Path({str(file)!r}))"
    modules_after(f"{used}; import importlib.metadata, lxml.etree, networkx; networkx.Graph()")


EXTRAS = """
import sys, trimesh, rlacd
corner = trimesh.util.concatenate([trimesh.creation.box((2, 1, 1)), trimesh.creation.box((1, 1, 2))])
done = rlacd.decompose(corner, threads=1, **{options})
assert len(done.hulls) > 1
print(*(name for name in sys.modules if name.startswith("rlacd.extras.")))
"""


def extras_of(options: dict[str, object]) -> list[str]:
    """The modules of extras that a fresh process has imported after a run with these options."""
    run = [sys.executable, "-c", EXTRAS.format(options=options)]
    return subprocess.run(run, capture_output=True, text=True, check=True).stdout.split()


@pytest.mark.parametrize("options", [{"quality": "fast"}, {}], ids=str)
def test_a_default_run_imports_no_extras(options: dict[str, object]) -> None:
    assert extras_of(options) == []


def test_an_option_imports_its_own_extra() -> None:
    assert extras_of({"criterion": "volume", "quality": "fast"}) == [
        "rlacd.extras.criteria",
        "rlacd.extras.criteria.volume",
    ]


def test_no_module_imports_scipy() -> None:
    """It is installed for the tests, so nothing else would notice."""
    files = list(Path(rlacd.__file__).parent.rglob("*.py"))
    assert len(files) > 100
    imports = ("import scipy", "from scipy")
    assert not [file for file in files if any(line.strip().startswith(imports) for line in file.open(encoding="utf-8"))]


@pytest.mark.slow
def test_meshes_of_every_format_need_no_scipy(tmp_path: Path) -> None:
    """trimesh uses it where it is installed; rlacd does not require it."""
    chair = trimesh.creation.box().difference(trimesh.creation.icosphere(1, 0.6))
    files = [tmp_path / f"chair.{kind}" for kind in ("obj", "stl", "ply", "off", "glb", "dae", "3mf")]
    for file in files:
        chair.export(file)
    files += [tmp_path / "open.ply", tmp_path / "scene.glb"]
    trimesh.Trimesh(chair.vertices, chair.faces[5:], process=False).export(files[-2])
    trimesh.Scene([chair, chair.copy().apply_translation([3, 0, 0])]).export(files[-1])
    program = f"""
import sys
sys.modules["scipy"] = None
import rlacd
for file in {[str(file) for file in files]}:
    hulls = rlacd.decompose(file, primitives=True, quality="fast", threshold=0.2)
    hulls.save(file + ".glb")
    assert len(hulls) > 1, file
assert len(rlacd.decompose(file, criterion=rlacd.NavigableSpace(), quality="fast")) > 0
assert sys.modules["scipy"] is None
"""
    subprocess.run([sys.executable, "-c", program], check=True)


def test_every_public_name_is_there_and_listed() -> None:
    for name in rlacd.__all__:
        assert getattr(rlacd, name) is not None
    assert set(rlacd.__all__) <= set(dir(rlacd))
    everything: dict[str, object] = {}
    exec("from rlacd import *", everything)
    assert set(rlacd.__all__) <= set(everything)


def test_an_unknown_name_is_an_attribute_error() -> None:
    with pytest.raises(AttributeError, match="no attribute 'decompse'"):
        _ = rlacd.decompse
    with pytest.raises(ImportError):
        from rlacd import decompse  # noqa: F401


def test_no_module_hides_a_public_name() -> None:
    modules = {module.name for module in pkgutil.iter_modules(rlacd.__path__)}
    assert not modules & set(rlacd.__all__)


def test_the_types_of_the_kernels_are_those_of_the_bindings(tmp_path) -> None:
    """`make stubs` writes them."""
    stubgen = pytest.importorskip("nanobind.stubgen")
    written = tmp_path / "_native.pyi"
    stubgen.main(["--quiet", "--exclude-docstrings", "-m", "rlacd._native", "-o", str(written)])
    assert written.read_text() == (Path(rlacd.__file__).parent / "_native.pyi").read_text()


def test_help_explains_every_option_without_the_source(tmp_path: Path) -> None:
    """The package as a frozen program has it: compiled, without docstrings."""
    packed = tmp_path / "rlacd"
    shutil.copytree(Path(rlacd.__file__).parent, packed, ignore=shutil.ignore_patterns("viewer", "__pycache__"))
    shutil.copy(_native.__file__, packed)  # which an editable install keeps elsewhere
    assert compileall.compile_dir(packed, quiet=1, legacy=True, optimize=2)
    for source in packed.rglob("*.py"):
        source.unlink()
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join([str(tmp_path), *sys.path])}

    def help_of(*words: str) -> str:
        command = [sys.executable, "-S", "-OO", "-m", "rlacd", *words]  # without the finder of an editable install
        done = subprocess.run(command, env=environment, capture_output=True, text=True, check=True)
        return "".join(done.stdout.split())

    for options, words in ((Options, ["decompose", "--help-all"]), (TrainOptions, ["train", "--help"])):
        shown = help_of(*words)
        for field in dataclasses.fields(options):
            known = field.metadata["option"]
            assert known.help
            assert "".join(known.help.split()) in shown, field.name
