"""The meshes that the published numbers are of, from the public repositories that `meshes.csv` lists."""

from __future__ import annotations

import csv
import hashlib
import io
import os
import subprocess
from collections.abc import Iterable, Iterator
from itertools import groupby
from operator import itemgetter
from pathlib import Path
from typing import Any, TypeAlias

import click
import numpy as np
import trimesh

from benchmarks.cli import PATH
from rlacd.cli.exit_codes import exit_codes
from rlacd.errors import MeshFileError
from rlacd.io.write import write_file

Source: TypeAlias = dict[str, str]
"""A line of the list: ``file``, ``repository``, ``commit``, ``path``, ``licence``, ``sha256`` of the file as written,
``quick``: whether it is one of those that are measured often."""

LIST = Path(__file__).with_name("meshes.csv")

KEPT = "vhacd_set/"
"""Meshes whose vertices are written as they come; all others' are merged where equal, and sorted."""


@click.command()
@click.argument("folder", type=PATH)
@click.option("--list", "listed", type=PATH, default=LIST, help="Another list of sources, with the same columns.")
@click.option("--only", default="", help="Files whose names begin so, such as test/vhacd.")
def app(folder: Path, listed: Path, only: str) -> None:
    """Bring the meshes of the published numbers to FOLDER with git: 151 of the 238 of `test/` and the V-HACD set.

    Each file is read, written as binary PLY, and kept if its SHA-256 is the listed one. A next run goes on: what is
    there and right is not brought again. FOLDER/.sources holds what git brought; delete it in the end. Left out:
    CAPOD, which is in no repository; furniture that a program puts together of parts; 12 whose place is not known.

    \b
    python -m benchmarks fetch MESHES && python -m benchmarks compare MESHES --list MESHES/quick.txt --out RUN
    """
    with exit_codes():
        sources = [row for row in read_list(listed) if row["file"].startswith(only)]
        missing = [row for row in sources if digest(folder / row["file"]) != row["sha256"]]
        failed = 0
        place = itemgetter("repository", "commit")
        for (repository, commit), some in groupby(sorted(missing, key=place), place):
            for name, problem in brought(folder, repository, commit, some):
                click.echo(f"{name}: {problem or 'ok'}")
                failed += bool(problem)
        describe(folder, [row for row in sources if (folder / row["file"]).is_file()])
        if failed:
            raise MeshFileError(f"{failed} of {len(missing)} meshes could not be brought; run the command again.")


def read_list(path: Path) -> list[Source]:
    """Read a list of sources."""
    if not path.is_file():
        raise MeshFileError(f"the list {path} does not exist; give a table as benchmarks/meshes.csv.")
    return list(csv.DictReader(path.read_text(encoding="utf-8").splitlines()))


def digest(path: Path) -> str:
    """SHA-256 of a file; empty if there is none."""
    return hashlib.sha256(path.read_bytes()).hexdigest() if path.is_file() else ""


def brought(folder: Path, repository: str, commit: str, some: Iterable[Source]) -> Iterator[tuple[str, str]]:
    """Bring the files of a commit; for each, what went wrong, if anything did."""
    store = folder / ".sources" / hashlib.sha256(repository.encode()).hexdigest()[:12]
    rows = list(some)
    try:
        if not (store / "HEAD").is_file():
            store.mkdir(parents=True, exist_ok=True)
            git(store, "init", "--bare", "--quiet")
            git(store, "remote", "add", "origin", repository)
        git(store, "fetch", "--quiet", "--depth=1", "--filter=blob:none", "origin", commit)
    except subprocess.CalledProcessError as error:
        yield from ((row["file"], last_words(error)) for row in rows)
        return
    for row in rows:
        try:
            write_file(folder / row["file"], checked(git(store, "cat-file", "blob", f"{commit}:{row['path']}"), row))
        except subprocess.CalledProcessError as error:
            yield row["file"], last_words(error)
        except (MeshFileError, ValueError) as error:
            yield row["file"], str(error)
        else:
            yield row["file"], ""


def last_words(error: subprocess.CalledProcessError) -> str:
    """The last line that git wrote."""
    return (error.stderr.decode(errors="replace").strip() or str(error)).splitlines()[-1]


def checked(content: bytes, row: Source) -> bytes:
    """What to write for a file; it has to be what is listed."""
    made = as_ply(content, Path(row["path"]).suffix, kept=row["file"].startswith(KEPT))
    if hashlib.sha256(made).hexdigest() != row["sha256"]:
        raise MeshFileError(f"{row['repository']} has another mesh than the listed one at {row['path']}")
    return made


def git(store: Path, *words: str) -> bytes:
    """What git writes; it asks for no password."""
    environment = {**os.environ, "GIT_TERMINAL_PROMPT": "0"}
    return subprocess.run(["git", "-C", store, *words], check=True, capture_output=True, env=environment).stdout


def as_ply(content: bytes, ending: str, kept: bool = False) -> bytes:
    """A mesh file as binary PLY: float32, without anything but geometry; `kept`: see `KEPT`."""
    mesh: Any = trimesh.load_mesh(io.BytesIO(content), file_type=ending.lower().lstrip("."), process=False)
    vertices, faces = np.asarray(mesh.vertices, dtype="<f4"), np.asarray(mesh.faces)
    if not kept:
        vertices, same = np.unique(vertices, axis=0, return_inverse=True)
        faces = same.reshape(-1)[faces]
    rows = np.empty(len(faces), dtype=[("count", "u1"), ("corners", "<i4", 3)])
    rows["count"], rows["corners"] = 3, faces
    head = ["ply", "format binary_little_endian 1.0", *([] if kept else ["comment https://github.com/mikedh/trimesh"])]
    head += [f"element vertex {len(vertices)}", *(f"property float {axis}" for axis in "xyz")]
    head += [f"element face {len(faces)}", "property list uchar int vertex_indices", "end_header\n"]
    return "\n".join(head).encode() + vertices.tobytes() + rows.tobytes()


def describe(folder: Path, sources: list[Source]) -> None:
    """Write ``index.csv``, which says whose each mesh is, and ``quick.txt``."""
    lines = ["split,set,file,faces,vertices,watertight,licence,repository"]
    for row in sources:
        mesh: Any = trimesh.load_mesh(folder / row["file"], process=False)
        size, parts = (len(mesh.faces), len(mesh.vertices), int(mesh.is_watertight)), row["file"].split("/")
        lines.append(",".join(map(str, (parts[0], parts[-2], row["file"], *size, row["licence"], row["repository"]))))
    write_file(folder / "index.csv", "\n".join([*lines, ""]).encode())
    quick = [row["file"] for row in sources if row["quick"] == "1"]
    write_file(folder / "quick.txt", "\n".join([*quick, ""]).encode())
