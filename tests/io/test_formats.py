"""Files of hulls: what is written is what is read, every hull stays a hull, and nothing is ever half-written."""

from __future__ import annotations

import contextlib
import errno
import json
import os
import subprocess
import sys
from importlib.util import find_spec
from pathlib import Path

import numpy as np
import pytest
import trimesh
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from rlacd.errors import OutputError
from rlacd.io.write import FORMATS, hull_target
from rlacd.io.write.palette import hull_colors
from tests.assets import read_glb
from tests.hulls import assert_convex_hull, hull_of, moved, random_hull, save_hulls

THREE = [moved(random_hull(seed), 0.3, (seed, 0.1, -0.7)) for seed in range(3)]
NAMES = ["hull_000", "hull_001", "hull_002"]


def load(path: Path) -> dict[str, trimesh.Trimesh]:
    """Read hulls back by name, placed by their nodes; vertices that a format stores once a triangle are joined."""
    # Without processing: trimesh would join vertices closer than 1e-8, which is all of a small mesh.
    scene = trimesh.load_scene(path, process=False, **({"split_objects": True} if path.suffix == ".obj" else {}))
    placed = {}
    for node in scene.graph.nodes_geometry:
        transform, geometry = scene.graph[node]
        mesh = scene.geometry[geometry].copy()
        mesh.apply_transform(transform)
        if path.suffix == ".stl":
            vertices, index = np.unique(mesh.vertices, axis=0, return_inverse=True)
            mesh = trimesh.Trimesh(vertices, index.reshape(-1)[mesh.faces], process=False)
        placed[node] = mesh
    return dict(sorted(placed.items()))


def same_points(a: np.ndarray, b: np.ndarray, tolerance: float) -> bool:
    """Whether two point sets agree, whatever their order."""
    return trimesh.proximity.cKDTree(a).query(b)[0].max() <= tolerance and len(a) == len(b)


@pytest.mark.parametrize("ending", ["glb", "obj", "stl"])
def test_every_hull_comes_back_under_its_name(tmp_path: Path, ending: str) -> None:
    read = load(save_hulls(THREE, tmp_path / f"out.{ending}"))
    assert list(read) == NAMES
    for hull, mesh in zip(THREE, read.values(), strict=True):
        assert_convex_hull(mesh)
        assert len(mesh.faces) == len(hull.faces)
        assert same_points(mesh.vertices, hull.vertices, 1e-6 if ending == "glb" else 0.0)


def test_hulls_of_a_glb_have_arrays_of_their_own_and_a_colour_each(tmp_path: Path) -> None:
    """glTF 2.0, 3.6.2.4: a view that vertex attributes share must define a stride."""
    written, _, _ = read_glb(save_hulls(THREE, tmp_path / "out.glb"))
    views = [accessor["bufferView"] for accessor in written["accessors"]]
    assert len(set(views)) == len(views) == 2 * len(THREE)
    assert len({str(one["pbrMetallicRoughness"]["baseColorFactor"]) for one in written["materials"]}) == len(THREE)
    assert not any("matrix" in node or "translation" in node for node in written["nodes"])


def test_ply_keeps_hulls_apart_exact_and_coloured(tmp_path: Path) -> None:
    mesh = trimesh.load(save_hulls(THREE, tmp_path / "out.ply"), process=False)
    owner = mesh.metadata["_ply_raw"]["face"]["data"]["hull"].ravel()
    colors = mesh.visual.vertex_colors[:, :3]
    for index, (hull, color) in enumerate(zip(THREE, hull_colors(3), strict=True)):
        part = mesh.submesh([np.flatnonzero(owner == index)], append=True, repair=False)
        assert_convex_hull(part)
        assert same_points(part.vertices, hull.vertices, 0.0)
        assert (colors[np.unique(mesh.faces[owner == index])] == color).all()


@pytest.mark.parametrize("ending", ["obj", "ply", "stl"])
def test_a_second_parser_reads_the_same(tmp_path: Path, ending: str) -> None:
    pcu = pytest.importorskip("point_cloud_utils", reason="it has no wheel for some processors and new Pythons")
    path = save_hulls(THREE[:1], tmp_path / f"out.{ending}")
    vertices, faces = pcu.load_mesh_vf(str(path))
    mesh = trimesh.Trimesh(vertices, faces, process=ending == "stl")
    assert mesh.is_watertight
    assert mesh.volume == pytest.approx(THREE[0].volume, rel=1e-5)
    assert len(faces) == len(THREE[0].faces)
    assert ending != "stl" or path.stat().st_size == 84 + 50 * len(faces), "binary, which every reader accepts"


@pytest.mark.parametrize("ending", FORMATS)
@settings(max_examples=15, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(
    seed=st.integers(0, 10**6),
    scale=st.sampled_from([1e-9, 1e-3, 1.0, 1e4, 1e9]),
    distance=st.sampled_from([0.0, 1.0, 1e3, 1e6]),
    squash=st.sampled_from([1.0, 1e-3]),
)
@pytest.mark.promise("convex-in-files")
def test_hulls_stay_hulls_in_the_file(
    tmp_path: Path, ending: str, seed: int, scale: float, distance: float, squash: float
) -> None:
    """At any size, however far from the origin compared to the size; thin, round, or with flat sides that may dent."""
    turn = trimesh.transformations.random_rotation_matrix(np.random.default_rng(seed).random(3))[:3, :3]
    points = (random_hull(seed) if seed % 2 else trimesh.creation.box()).vertices * [1.0, 1.0, squash] @ turn
    hull = moved(hull_of(points), scale, np.full(3, distance * scale))
    path = save_hulls([hull], tmp_path / f"out.{ending}")
    if ending == "glb":
        mesh = in_place(path)
    else:
        (mesh,) = load(path).values()
    assert_convex_hull(mesh)
    assert mesh.bounds == pytest.approx(hull.bounds, abs=1e-6 * scale * max(distance, 10.0))
    shifted = trimesh.Trimesh(mesh.vertices - hull.vertices[0], mesh.faces, process=False)
    reference = trimesh.Trimesh(hull.vertices - hull.vertices[0], hull.faces, process=False)
    assert shifted.volume == pytest.approx(reference.volume, rel=2e-3)


def in_place(path: Path) -> trimesh.Trimesh:
    """Read the one hull of a GLB as stored: the file holds it exactly, adding its node's translation would round."""
    (mesh,) = trimesh.load_scene(path, process=False).geometry.values()
    scene = trimesh.load_scene(path, process=False)
    (node,) = scene.graph.nodes_geometry
    assert_convex_hull(mesh)
    moved_back = mesh.copy()
    moved_back.vertices = mesh.vertices + scene.graph[node][0][:3, 3]
    return mesh if np.allclose(scene.graph[node][0], np.eye(4)) else hull_of(moved_back.vertices)


@pytest.mark.promise("convex-in-files")
def test_too_thin_for_single_precision_is_reported_and_double_precision_formats_work(tmp_path: Path) -> None:
    # Thinner than the spacing of float32 numbers at its corners, on a slant so that no axis helps.
    plate = trimesh.creation.box((1.0, 1.0, 1e-9))
    plate.apply_transform(trimesh.transformations.rotation_matrix(0.7, [1.0, 2.0, 3.0]))
    hull = hull_of(plate.vertices)
    for name, says in (("thin.glb", r".*\.obj"), ("thin.xml", ""), ("thin.urdf", ""), ("thin.usda", "")):
        if name == "thin.usda" and find_spec("pxr") is None:
            continue
        with pytest.raises(OutputError, match=rf"hull_000.*too thin for single precision{says}"):
            save_hulls([hull], tmp_path / name)
    assert list(tmp_path.iterdir()) == []
    for ending in ("obj", "ply", "stl"):
        (mesh,) = load(save_hulls([hull], tmp_path / f"thin.{ending}")).values()
        assert_convex_hull(mesh)
    for size, misfit in ((1e39, "large"), (1e-60, "small")):
        with pytest.raises(OutputError, match=f"hull_000.*too {misfit} for single precision"):
            save_hulls([hull_of(trimesh.creation.box().vertices * size)], tmp_path / "out.glb")


# --- places -----------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("place", ["new/out.glb", "new/deep/OUT.STL", "new/", "new/deep/er/"])
def test_missing_folders_are_made_with_the_file(tmp_path: Path, place: str) -> None:
    hull_target(f"{tmp_path}/{place}")
    assert list(tmp_path.iterdir()) == [], "checking makes nothing"
    written = save_hulls(THREE, f"{tmp_path}/{place}")
    assert written.is_dir() if place.endswith("/") else written.stat().st_size > 0


# --- whole or not at all ----------------------------------------------------------------------------------------------


FULL = OSError(errno.ENOSPC, "No space left on device")


@pytest.mark.parametrize(
    ("ending", "stage", "error"),
    [
        *(("glb", "fsync", FULL), ("obj", "replace", FULL)),
        *(("ply", "fsync", KeyboardInterrupt()), ("stl", "replace", KeyboardInterrupt())),
    ],
)
@pytest.mark.promise("whole-files")
def test_a_failing_disk_or_an_interrupt_leaves_the_old_file(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, ending: str, stage: str, error: BaseException
) -> None:
    path = tmp_path / f"out.{ending}"
    path.write_bytes(b"old")

    def fail(*_: object) -> None:
        raise error

    monkeypatch.setattr(os, stage, fail)
    with pytest.raises((OutputError, KeyboardInterrupt), match=r"disk is full|^$"):
        save_hulls(THREE, path)
    assert path.read_bytes() == b"old"
    assert list(tmp_path.iterdir()) == [path]


def test_a_link_is_refused_and_the_umask_kept(tmp_path: Path) -> None:
    (tmp_path / "real").mkdir()
    real, link = tmp_path / "real" / "file.glb", tmp_path / "out.glb"
    real.write_bytes(b"precious")
    link.symlink_to(real)
    with pytest.raises(OutputError, match="it is a link; remove it, or name the file it points to"):
        save_hulls(THREE, link)
    assert link.is_symlink()
    assert real.read_bytes() == b"precious"
    before = os.umask(0o027)
    try:
        save_hulls(THREE, real)
    finally:
        os.umask(before)
    assert real.stat().st_mode & 0o777 == 0o640


# --- folders ----------------------------------------------------------------------------------------------------------


def files_of(folder: Path) -> list[str]:
    return sorted(path.name for path in folder.iterdir())


@pytest.mark.parametrize("ending", [None, *FORMATS])
def test_a_folder_gets_one_file_a_hull(tmp_path: Path, ending: str | None) -> None:
    folder = save_hulls(THREE, f"{tmp_path}/hulls{'' if ending else '/'}", stem="chair", file_type=ending)
    known = ending or "obj"
    assert files_of(folder) == [*(f"chair_{i:03d}.{known}" for i in range(3)), "chair_hulls.json"]
    assert files_of(tmp_path) == ["hulls"]
    for index, hull in enumerate(THREE):
        (mesh,) = load(folder / f"chair_{index:03d}.{known}").values()
        assert_convex_hull(mesh)
        assert same_points(mesh.vertices, hull.vertices, 1e-6)


@pytest.mark.promise("own-files")
def test_an_existing_folder_needs_no_slash_and_loses_only_our_older_hulls(tmp_path: Path) -> None:
    (tmp_path / "notes.txt").write_text("mine")
    (tmp_path / "chair_007.obj").write_text("also mine: no run wrote it")
    save_hulls(THREE, tmp_path, stem="chair")
    save_hulls(THREE, tmp_path, stem="table")
    save_hulls(THREE[:1], tmp_path, stem="chair")
    assert files_of(tmp_path) == [
        "chair_000.obj",
        "chair_007.obj",
        "chair_hulls.json",
        "notes.txt",
        "table_000.obj",
        "table_001.obj",
        "table_002.obj",
        "table_hulls.json",
    ]


@pytest.mark.parametrize("names", [["../precious_000.obj", "notes.txt", "chair_hulls.json", 3], "chair_000.obj", None])
def test_a_list_that_somebody_changed_removes_nothing_else(tmp_path: Path, names: object) -> None:
    folder = tmp_path / "hulls"
    save_hulls(THREE[:1], f"{folder}/", stem="chair")
    for path in (tmp_path / "precious_000.obj", folder / "notes.txt"):
        path.write_text("mine")
    (folder / "chair_hulls.json").write_text(json.dumps({"files": names}))
    with contextlib.suppress(OutputError):  # where its own hull is listed no longer
        save_hulls(THREE[:1], folder, stem="chair")
    assert files_of(tmp_path) == ["hulls", "precious_000.obj"]
    assert files_of(folder) == ["chair_000.obj", "chair_hulls.json", "notes.txt"]


@pytest.mark.parametrize("foreign", ["chair_001.obj", "chair_hulls.json"])
@pytest.mark.promise("own-files")
def test_a_file_of_somebody_else_in_the_folder_is_never_replaced(tmp_path: Path, foreign: str) -> None:
    (tmp_path / foreign).write_text("precious")
    with pytest.raises(OutputError, match=f"{foreign}: a file of that name is there that rlacd did not write"):
        save_hulls(THREE, tmp_path, stem="chair")
    assert files_of(tmp_path) == [foreign]
    (tmp_path / foreign).rename(tmp_path / "precious")
    (tmp_path / foreign).symlink_to(tmp_path / "precious")
    with pytest.raises(OutputError, match="did not write"):
        save_hulls(THREE, tmp_path, stem="chair")
    assert (tmp_path / "precious").read_text() == "precious"


def test_a_folder_is_locked_before_anything_in_it_changes(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def there() -> dict[str, bytes]:
        return {path.name: path.read_bytes() for path in tmp_path.glob("chair*")}

    fcntl, seen = pytest.importorskip("fcntl"), []
    save_hulls(THREE, tmp_path, stem="chair")
    before = there()
    monkeypatch.setattr(fcntl, "flock", lambda _, how: seen.append((how, there())))
    save_hulls(THREE[:1], tmp_path, stem="chair")
    assert seen == [(fcntl.LOCK_EX, before)]


AT_ONCE = """
import sys, pathlib, trimesh
from tests.hulls import save_hulls
place, count, go = pathlib.Path(sys.argv[1]), int(sys.argv[2]), pathlib.Path(sys.argv[3])
hulls = [trimesh.creation.box((count, 1, 1))] * count
print(flush=True)
for turn in range(20):
    while not (go / str(turn)).exists():
        pass
    save_hulls(hulls, f"{place}/{turn}/", stem="chair")
    save_hulls(hulls, place / f"{turn}.obj")
    print(flush=True)
"""


@pytest.mark.slow
@pytest.mark.promise("at-once")
def test_of_several_runs_at_once_each_writes_a_whole_result(tmp_path: Path) -> None:
    go, counts = tmp_path / "go", (1, 3, 5)
    go.mkdir()
    runs = [
        subprocess.Popen([sys.executable, "-c", AT_ONCE, tmp_path, str(count), go], stdout=subprocess.PIPE)
        for count in counts
    ]
    try:
        for turn in range(20):
            assert all(run.stdout is not None and run.stdout.readline() for run in runs)
            (go / str(turn)).touch()
        assert [run.communicate()[0].count(b"\n") for run in runs] == [1] * len(runs)
    finally:
        for run in runs:
            run.kill()
    for turn in range(20):
        names = json.loads((tmp_path / str(turn) / "chair_hulls.json").read_bytes())["files"]
        assert files_of(tmp_path / str(turn)) == [*names, "chair_hulls.json"]
        lengths = {float(next(iter(load(tmp_path / str(turn) / name).values())).extents[0]) for name in names}
        assert lengths == {len(names)}, "the hulls of one run"
        assert len(load(tmp_path / f"{turn}.obj")) in counts
    assert not list(tmp_path.rglob(".rlacd*"))


@pytest.mark.parametrize("exists", [False, True])
def test_a_failing_disk_leaves_the_folder_as_it_was(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, exists: bool
) -> None:
    folder = tmp_path / "hulls"
    if exists:
        save_hulls(THREE[1:], f"{folder}/", stem="chair")
    before = {path: path.read_bytes() for path in tmp_path.rglob("*") if path.is_file()}
    real, calls = os.fsync, iter(range(1000))

    def fail_on_the_fifth(descriptor: int) -> None:
        if next(calls) == 4:
            raise OSError(errno.ENOSPC, "No space left on device")
        real(descriptor)

    monkeypatch.setattr(os, "fsync", fail_on_the_fifth)
    with pytest.raises(OutputError, match="disk is full"):
        save_hulls(THREE, f"{folder}/", stem="chair")
    assert {path: path.read_bytes() for path in tmp_path.rglob("*") if path.is_file()} == before
    assert folder.exists() == exists


@pytest.mark.parametrize("name", ["../../etc/x", "a/b", "", "con\n?", "..", "x" * 300])
def test_any_name_of_a_mesh_makes_safe_file_names(tmp_path: Path, name: str) -> None:
    folder = save_hulls(THREE[:1], f"{tmp_path}/hulls/", stem=name)
    assert files_of(tmp_path) == ["hulls"]
    assert len(files_of(folder)) == 2
