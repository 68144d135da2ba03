"""Files made to harm are refused with one sentence, in little time and memory, and nothing outside is read.

Everything hostile is opened in a process of its own, which may take a gigabyte of memory and a minute of a processor.
"""

from __future__ import annotations

import io
import json
import os
import re
import zipfile
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from trimesh import creation

from rlacd.batch.assets import Asset
from rlacd.batch.manifest import Ledger
from rlacd.batch.store import Store
from rlacd.errors import MeshFileError, OutputError, RlacdError, TrainingError, WeightsError
from rlacd.io.read.load import load_mesh
from rlacd.io.read.open_file import LARGEST_FILE
from rlacd.io.robots import rewrite_robot
from rlacd.policies.network import load_network
from tests.bounded import bounded
from tests.io.hostile import HARMLESS, REFUSED
from tests.io.hostile.gltf import gltf, named_often
from tests.io.hostile.xml import ENTITIES


def load(path: Path) -> tuple[int, float]:
    """Number of triangles, and the greatest coordinate."""
    mesh = load_mesh(path)
    return len(mesh.faces), float(abs(mesh.vertices).max())


def check_refused(error: type[RlacdError], says: str, function: Callable[..., Any], *args: Any, **limits: Any) -> None:
    with pytest.raises(error) as caught:
        bounded(function, *args, **limits)
    text = str(caught.value)
    assert len(text.splitlines()) == 1
    assert 20 < len(text) < 800
    assert re.search(says, text)


# --- meshes -----------------------------------------------------------------------------------------------------------


@pytest.mark.slow
@pytest.mark.parametrize("name", REFUSED)
@pytest.mark.promise("hostile-files")
def test_a_hostile_mesh_is_refused_with_its_reason(name: str, tmp_path: Path) -> None:
    build, says = REFUSED[name]
    path = build(tmp_path)
    check_refused(RlacdError, f"{re.escape(path.name)}.*({says})", load, path)


@pytest.mark.slow
@pytest.mark.parametrize("name", HARMLESS)
def test_what_only_looks_hostile_is_read(name: str, tmp_path: Path) -> None:
    faces, extent = bounded(load, HARMLESS[name](tmp_path))
    assert faces >= 12
    assert extent == 0.5


@pytest.mark.slow
def test_a_file_that_is_named_ten_thousand_times_is_read_once(tmp_path: Path) -> None:
    assert bounded(load, named_often(tmp_path)) == (12, 0.0)


# --- what is no ordinary file -----------------------------------------------------------------------------------------


def special(folder: Path, kind: str, ending: str) -> Path:
    path = folder / f"mesh{ending}"
    if kind == "pipe":
        os.mkfifo(path)
    elif kind == "device":
        path.symlink_to("/dev/zero")
    elif kind == "link to a pipe":
        os.mkfifo(folder / "pipe")
        path.symlink_to("pipe")
    else:
        with path.open("wb") as file:
            file.write(b"solid")
            file.truncate(LARGEST_FILE + 1)  # takes no room on the disk
    return path


KINDS = {"pipe": "pipe or a device", "device": "pipe or a device", "link to a pipe": "pipe", "too large": "larger than"}


def rewrite(path: Path) -> object:
    return rewrite_robot(path, path.with_stem("out"))


def load_q(path: Path) -> object:
    return load_network(path, "rl-acd", 906, 150)


def read_asset(path: Path) -> object:
    return Asset(path.name, path, "mesh").files()


READERS = [*((load, end) for end in (".stl", ".glb", ".3mf")), (rewrite, ".urdf"), (rewrite, ".xml")]
READERS += [(load_q, ".npz"), (read_asset, ".stl")]


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize(("reader", "ending"), READERS)
def test_what_never_ends_is_refused(kind: str, reader: Callable[[Path], Any], ending: str, tmp_path: Path) -> None:
    error = WeightsError if ending == ".npz" else MeshFileError
    check_refused(error, KINDS[kind], reader, special(tmp_path, kind, ending))


def test_a_link_to_an_ordinary_mesh_is_followed(tmp_path: Path) -> None:
    creation.box().export(tmp_path / "there.stl")
    (tmp_path / "here.stl").symlink_to("there.stl")
    assert bounded(load, tmp_path / "here.stl") == (12, 0.5)


# --- robots -----------------------------------------------------------------------------------------------------------

COLLISION = '<link name="l"><collision><geometry><mesh filename="{}"/></geometry></collision></link>'


def robot(folder: Path, text: str, ending: str = ".urdf") -> Path:
    path = folder / "package" / "robots" / f"robot{ending}"
    path.parent.mkdir(parents=True)
    creation.box().export(path.parent / "box.stl")
    path.write_text(text)
    return path


@pytest.mark.parametrize("ending", [".urdf", ".xml"])
@pytest.mark.parametrize(("doctype", "used"), ENTITIES.values(), ids=ENTITIES)
@pytest.mark.promise("hostile-robots")
def test_a_robot_with_entities_is_refused(doctype: str, used: str, ending: str, tmp_path: Path) -> None:
    tag = "robot" if ending == ".urdf" else "mujoco"
    path = robot(tmp_path, f"{doctype}<{tag}>{used}</{tag}>", ending)
    check_refused(MeshFileError, "DOCTYPE", rewrite_robot, path, tmp_path / f"out{ending}")


@pytest.mark.slow
@pytest.mark.parametrize(("each", "says"), [("<a>{}</a>", "deep"), ("<a/>{}", "elements")])
def test_a_hostile_robot_is_refused_with_its_reason(each: str, says: str, tmp_path: Path) -> None:
    before, after = (part * 2_000_000 for part in each.split("{}"))
    path = robot(tmp_path, f"<robot>{before}{after}</robot>")
    check_refused(MeshFileError, says, rewrite_robot, path, tmp_path / "out.urdf")
    assert not (tmp_path / "out.urdf").exists()


@pytest.mark.slow
def test_a_robot_with_ten_thousand_parts_in_one_line_is_rewritten(tmp_path: Path) -> None:
    """What each costs must not grow with the length of the file before it."""
    path = robot(tmp_path, "<robot>" + COLLISION.format("box.stl") * 10_000 + "<!--" + " " * 10**7 + "--></robot>")
    bounded(rewrite_robot, path, tmp_path / "out.urdf")
    assert (tmp_path / "out.urdf").read_text().count("<collision") == 10_000


# --- batches ----------------------------------------------------------------------------------------------------------


@pytest.mark.slow
def test_files_beside_an_asset_are_read_once_around(tmp_path: Path) -> None:
    (tmp_path / "much.bin").write_bytes(bytes(2**20))
    spelled = [{"byteLength": 1, "uri": "./" * i + "much.bin"} for i in range(1500)]
    path = tmp_path / "mesh.gltf"
    path.write_bytes(gltf(buffers=spelled))
    files = bounded(Asset("mesh.gltf", path, "mesh").files, memory=2**32)
    assert sum(map(len, files.values())) <= LARGEST_FILE + len(path.read_bytes())


@pytest.mark.parametrize(
    "row",
    [
        {"mesh": "a.stl", "outputs": {"../precious": 3}},
        {"mesh": "a.stl", "outputs": {"b/../../precious": 3}},
        {"mesh": "a.stl", "outputs": {"{precious}": 3}},
        {"mesh": "a.stl", "outputs": ["../precious"]},
        {"mesh": "a.stl", "outputs": 7},
        {"mesh": ["a.stl"]},
        ["a.stl"],
    ],
    ids=json.dumps,
)
def test_a_manifest_of_others_removes_nothing_outside_of_the_results(row: Any, tmp_path: Path) -> None:
    precious, out = tmp_path / "precious", tmp_path / "out"
    precious.write_text("mine")
    out.mkdir()
    (out / "manifest.jsonl").write_text(json.dumps(row).replace("{precious}", str(precious)) + "\n")
    with pytest.raises(OutputError, match=r"line 1 of manifest\.jsonl is damaged"):
        Ledger(Store(out), "manifest.jsonl").add({"mesh": "a.stl", "outputs": {}})
    assert precious.read_text() == "mine"


@pytest.mark.parametrize(
    ("line", "says"), [(b"[" * 10**6, "damaged"), (b'{"mesh": "a", "n": ' + b"9" * 10**6 + b"}", "damaged")]
)
def test_a_manifest_that_no_parser_survives_is_refused(line: bytes, says: str, tmp_path: Path) -> None:
    (tmp_path / "manifest.jsonl").write_bytes(line + b"\n")
    check_refused(OutputError, says, Ledger, Store(tmp_path), "manifest.jsonl")


def test_a_manifest_that_is_a_pipe_is_refused(tmp_path: Path) -> None:
    os.mkfifo(tmp_path / "manifest.jsonl")
    check_refused(OutputError, "pipe", Ledger, Store(tmp_path), "manifest.jsonl")


# --- weights and checkpoints ------------------------------------------------------------------------------------------


def array_of(count: int) -> bytes:
    """The header of an array of so many numbers."""
    header = io.BytesIO()
    np.lib.format.write_array_header_1_0(header, {"descr": "<f8", "fortran_order": False, "shape": (count,)})
    return header.getvalue()


def npy(array: np.ndarray[Any, Any]) -> bytes:
    np.save(file := io.BytesIO(), array)
    return file.getvalue()


def restore(place: Path) -> Any:
    from rlacd.learn.checkpoint import load_checkpoint

    return load_checkpoint(place)


TRAPS = {
    "bomb": (zipfile.ZIP_DEFLATED, "net.it.npy", lambda: array_of(2**25) + bytes(2**28), "it is compressed"),
    "shape": (zipfile.ZIP_STORED, "net.it.npy", lambda: array_of(10**12) + bytes(80), "Unable to allocate"),
    "objects": (zipfile.ZIP_STORED, "net.it.npy", lambda: npy(np.array([{}])), "Object arrays cannot be loaded"),
    "depth": (zipfile.ZIP_STORED, "state.npy", lambda: npy(np.frombuffer(b"[" * 10**6, np.uint8)), "recursion"),
}


@pytest.mark.nightly
@pytest.mark.parametrize("trap", TRAPS)
@pytest.mark.promise("hostile-weights")
def test_a_hostile_checkpoint_is_refused(trap: str, tmp_path: Path) -> None:
    pytest.importorskip("torch", reason="the extra train is not installed")
    from rlacd.learn.checkpoint import save_checkpoint

    place, (kind, member, content, says) = tmp_path / "checkpoint.npz", TRAPS[trap]
    save_checkpoint(place, {"net": {"weight": np.arange(4)}}, {"step": 1})
    assert bounded(restore, place, needs="rlacd.learn.checkpoint")[1]["step"] == 1
    with zipfile.ZipFile(place, "w" if member == "state.npy" else "a", kind) as archive:
        archive.writestr(member, content())
    check_refused(TrainingError, f"is damaged.*{says}", restore, place, needs="rlacd.learn.checkpoint")
