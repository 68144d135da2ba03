"""`python -m benchmarks fetch`: meshes from public repositories, each the listed one to the byte."""

from __future__ import annotations

import csv
import hashlib
import re
import subprocess
from pathlib import Path

import pytest
import trimesh
from benchmarks.fetch import LIST, app, as_ply, read_list
from benchmarks.runner import find_meshes
from click.testing import CliRunner, Result

RAW = {
    "hatchback__hatchback.obj": "test/gazebo_models",
    "chair_ivar_0668.obj": "test/ikea_assembled",
    "house_interior_pack__Shelf_2.glb": "train/quaternius_cc0",
    "modular_sci_fi_guns_pack__Pistol_2.glb": "train/quaternius_cc0",
}


def git(folder: Path, *words: str) -> str:
    who = ("-c", "user.name=a", "-c", "user.email=a@b.c")
    return subprocess.run(
        ["git", *who, "-C", folder, *words], check=True, capture_output=True, text=True
    ).stdout.strip()


@pytest.fixture
def listed(tmp_path: Path) -> Path:
    """A list of two files of a repository's first commit, which later ones change, and of one of another repository."""
    lines = [["file", "repository", "commit", "path", "licence", "sha256", "quick"]]
    for name, mesh in {"one": trimesh.creation.box(), "two": trimesh.creation.icosphere(1)}.items():
        source = tmp_path / name
        source.mkdir()
        git(source, "init", "-q")
        git(source, "config", "uploadpack.allowFilter", "true")
        git(source, "config", "uploadpack.allowAnySHA1InWant", "true")
        for ending in ("obj", "stl") if name == "one" else ("off",):
            mesh.export(source / f"a mesh.{ending}")
        git(source, "add", ".")
        git(source, "commit", "-qm", "meshes")
        commit = git(source, "rev-parse", "HEAD")
        for path in sorted(source.glob("a mesh.*")):
            made = as_ply(path.read_bytes(), path.suffix)
            told = [
                source.as_uri(),
                commit,
                path.name,
                "CC0-1.0",
                hashlib.sha256(made).hexdigest(),
                str(int(name == "two")),
            ]
            lines.append([f"test/{name}/{path.suffix[1:]}.ply", *told])
            path.write_text("changed")
        git(source, "commit", "-qam", "changed")
    with open(tmp_path / "list.csv", "w", newline="") as file:
        csv.writer(file).writerows(lines)
    return tmp_path / "list.csv"


def fetch(listed: Path, *words: str) -> Result:
    return CliRunner().invoke(app, [str(listed.parent / "meshes"), "--list", str(listed), *words])


def test_meshes_come_as_listed_and_no_file_twice(listed: Path) -> None:
    folder = listed.parent / "meshes"
    some = fetch(listed, "--only", "test/one")
    assert some.exit_code == 0, some.output
    assert (folder / "quick.txt").read_text().strip() == ""
    before = {path: path.stat().st_mtime_ns for path in folder.rglob("*.ply")}
    (folder / "test/one/obj.ply").write_bytes(b"cut off")
    assert fetch(listed).exit_code == 0
    assert find_meshes(folder) == ["test/one/obj.ply", "test/one/stl.ply", "test/two/off.ply"]
    assert find_meshes(folder, folder / "quick.txt") == ["test/two/off.ply"]
    assert (folder / "test/one/stl.ply").stat().st_mtime_ns == before[folder / "test/one/stl.ply"]
    index = list(csv.DictReader((folder / "index.csv").open()))
    assert [(row["split"], row["set"], row["faces"], row["watertight"]) for row in index] == [
        ("test", "one", "12", "1"),
        ("test", "one", "12", "1"),
        ("test", "two", "80", "1"),
    ]
    assert all(sha256_of(folder / row["file"]) == row["sha256"] for row in read_list(listed))
    assert "does not exist" in fetch(listed.with_name("no.csv")).output


def sha256_of(path: Path) -> str:
    return hashlib.sha256(path.read_bytes()).hexdigest()


@pytest.mark.parametrize(
    ("pattern", "instead", "says"),
    [
        (r"[0-9a-f]{64}", 64 * "0", "another mesh than the listed one"),
        (r"a mesh.obj", "no mesh.obj", "no mesh.obj"),
        (r"(?<=,)[0-9a-f]{40}(?=,)", 40 * "1", "1111"),
        (r"file:[^,]*", "file:///nowhere/at/all", "repository"),
    ],
)
def test_what_is_not_as_listed_is_not_written_and_the_rest_is(
    listed: Path, pattern: str, instead: str, says: str
) -> None:
    first, line, *others = listed.read_text().splitlines()
    listed.write_text("\n".join([first, re.sub(pattern, instead, line), *others]))
    done = fetch(listed)
    assert done.exit_code == 2
    assert says in next(told for told in done.output.splitlines() if told.startswith("test/one/obj.ply"))
    assert "1 of 3 meshes could not be brought" in done.output
    assert find_meshes(listed.parent / "meshes") == ["test/one/stl.ply", "test/two/off.ply"]


LINE = r"(test|vhacd_set)/\S+\.ply,https://github\.com/[\w-]+/[\w-]+,[0-9a-f]{40},[^,]+,(BSD-3-Clause|MIT|MIT-0|CC-BY-3\.0)"


def test_the_list_says_of_each_mesh_where_it_comes_from() -> None:
    _, *lines = LIST.read_text().splitlines()
    assert len({line.partition(",")[0] for line in lines}) == len(lines) > 150
    assert [line for line in lines if not re.fullmatch(LINE + r",[0-9a-f]{64},[01]", line)] == []


def test_the_list_is_of_the_meshes_that_numbers_are_of(corpus: Path) -> None:
    quick = (corpus / "quick.txt").read_text().split()
    for row in read_list(LIST):
        assert row["sha256"] == sha256_of(corpus / row["file"])
        assert row["quick"] == str(int(row["file"] in quick))


@pytest.mark.parametrize("name", RAW)
def test_files_as_they_are_published_give_the_meshes_measured(name: str, corpus: Path) -> None:
    source = corpus / "raw" / name
    assert as_ply(source.read_bytes(), source.suffix) == (corpus / RAW[name] / f"{source.stem}.ply").read_bytes()
