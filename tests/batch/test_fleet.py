"""What a batch rests on: names and keys of results, places for them, and the rows that tell what is done."""

from __future__ import annotations

import dataclasses
import inspect
import json
import os
from pathlib import Path

import pytest
import trimesh
from hypothesis import given
from hypothesis import strategies as st

import rlacd
from rlacd import NavigableSpace
from rlacd.batch import Asset, JobSpec, find_assets
from rlacd.batch.assets import _places, content_hash
from rlacd.batch.manifest import Ledger
from rlacd.batch.store import Store
from rlacd.cli.batch import COMMAND
from rlacd.decomposition import Decomposition
from rlacd.errors import OutputError
from rlacd.options import Options
from tests.hulls import save_hulls

NOT_OPTIONS = ("self", "path", "file_type", "scene")

# --- which meshes, and what their results are called ------------------------------------------------------------------


def touch(folder: Path, *names: str) -> None:
    for name in names:
        (folder / name).parent.mkdir(parents=True, exist_ok=True)
        (folder / name).write_bytes(b"x")


def test_meshes_of_all_depths_and_links_to_files_are_found_in_order_and_nothing_else(tmp_path: Path) -> None:
    touch(tmp_path, "b/椅子.OBJ", "a.stl", "notes.txt", ".hidden/c.obj", "b/.d.obj", "out/e.glb", "b/deep/er/f.3mf")
    (tmp_path / "link.obj").symlink_to(tmp_path / "b" / "椅子.OBJ")
    (tmp_path / "round").symlink_to(tmp_path)
    (tmp_path / "broken.obj").symlink_to(tmp_path / "nowhere")
    names = [asset.name for asset in find_assets(tmp_path, leave_out=tmp_path / "out")]
    assert names == ["a.stl", "b/deep/er/f.3mf", "b/椅子.OBJ", "broken.obj", "link.obj"]


def test_hulls_among_the_meshes_are_passed_over_by_what_is_in_them(tmp_path: Path) -> None:
    box = trimesh.creation.box()
    touch(tmp_path, "a.stl", "a_hulls.glb", "b/c.obj", "b/c_hulls.stl", "own_hulls.glb", "b/a_hulls.obj")
    save_hulls([box], f"{tmp_path}/b/hulls/", stem="mesh", file_type="stl")
    touch(tmp_path, "b/hulls/mesh_001.stl")
    for name in ("result.glb", "result.obj", "result.ply"):
        save_hulls([box], tmp_path / name)
    rlacd.decompose(box, quality="fast").save(tmp_path / "model.xml")
    names = [asset.name for asset in find_assets(tmp_path)]
    assert names == ["a.stl", "b/a_hulls.obj", "b/c.obj", "b/hulls/mesh_001.stl", "own_hulls.glb"]


@pytest.mark.parametrize(
    ("glob", "names"),
    [
        ("*.obj", ["a.obj", "x/a.obj", "x/y/b.obj"]),
        ("**/*.obj", ["a.obj", "x/a.obj", "x/y/b.obj"]),
        ("x/*", ["x/a.obj", "x/y/b.obj"]),
        ("a.*", ["a.obj", "a.stl", "x/a.obj"]),
        ("nothing", []),
    ],
)
def test_a_glob_picks_by_the_last_part_or_the_whole_name_and_decides_no_place(
    tmp_path: Path, glob: str, names: list[str]
) -> None:
    touch(tmp_path, "a.obj", "a.stl", "x/a.obj", "x/y/b.obj")
    places = {"a.obj": "a.obj", "a.stl": "a.stl", "x/a.obj": "x/a", "x/y/b.obj": "x/y/b"}
    assert {asset.name: asset.place for asset in find_assets(tmp_path, glob)} == {name: places[name] for name in names}


NAMES = st.tuples(
    st.sampled_from(["", "a/", "A/"]),
    st.sampled_from("aA"),
    st.lists(st.sampled_from([".obj", ".stl", ".STL"]), min_size=1, max_size=3).map("".join),
).map("".join)


@given(st.sets(NAMES, max_size=12))
def test_no_two_results_share_a_name_on_any_disk(names: set[str]) -> None:
    places = _places(sorted(names), ".glb")
    assert set(places) == names
    assert len({place.casefold() for place in places.values()}) == len(names)


# --- the key of a result ----------------------------------------------------------------------------------------------


def test_the_buffers_of_a_gltf_file_in_its_folder_are_part_of_the_mesh_and_others_are_not_read(tmp_path: Path) -> None:
    touch(tmp_path, "secret.bin", "in/b c.bin")
    uris = ["../secret.bin", str(tmp_path / "secret.bin"), "data:,x", "b%20c.bin", "missing.bin"]
    (tmp_path / "in/m.gltf").write_text(json.dumps({"asset": {}, "buffers": [{"uri": uri} for uri in uris]}))
    (asset,) = find_assets(tmp_path / "in")
    before = content_hash(asset.files())
    assert list(asset.files()) == ["m.gltf", "b c.bin"]
    (tmp_path / "secret.bin").write_bytes(b"another")
    assert content_hash(asset.files()) == before
    (tmp_path / "in/b c.bin").write_bytes(b"y")
    assert content_hash(asset.files()) != before


def test_a_robot_depends_on_each_file_that_its_meshes_are_read_from_and_on_no_result(tmp_path: Path) -> None:
    root = tmp_path / "in"
    touch(root, "r/robot.urdf", "r/meshes/l.obj", "r/meshes/l.mtl", "out/r/l.obj", "r/other.obj")
    (root / "r/robot.urdf").write_text('<robot><mesh filename="package://r/meshes/l.obj"/></robot>')
    before = []
    for name in ("r/meshes/l.obj", "r/meshes/l.mtl", "r/robot.urdf", "out/r/l.obj", "r/other.obj"):
        with (root / name).open("a") as file:
            file.write("\nmtllib l.mtl\n" if name.endswith("l.obj") else " ")
        (robot,) = find_assets(root, "*.urdf", root / "out")
        before.append(content_hash(robot.files()))
    assert len(set(before)) == 3
    assert len(set(before[2:])) == 1


def test_all_that_decides_the_bytes_is_in_the_key_and_nothing_else(tmp_path: Path) -> None:
    policies = [tmp_path / "here.npz", tmp_path / "there" / "p.npz"]
    policies[1].parent.mkdir()
    from fuzz.networks import q_network

    for policy in policies:
        policy.write_bytes(q_network())

    written = ("file_type", "density", "mass", "up", "folders", "one_mesh", "keep_input")

    def key(content: str = "c", name: str = "a/chair.obj", **options: object) -> str:
        kept = {what: options.pop(what) for what in written if what in options}
        return JobSpec.of(options, **kept).key(content, name)  # type: ignore[arg-type]

    same = [key(), key(threads=2), key(threshold=0.05), key(name="b/chair.obj"), key(file_type="glb")]
    assert len(set(same)) == 1
    others = [
        key("d"),
        key(name="a/table.obj"),
        key(threshold=0.04),
        key(seed=1),
        key(preset="mujoco"),
        key(preset="unity"),
        key(file_type="obj"),
        key(file_type="obj", folders=True),
        key(file_type="unreal"),
        key(file_type="urdf"),
        key(file_type="urdf", one_mesh=True),
        key(density=2.0),
        key(up="y"),
        key(mass=2.0),
        key(keep_input=True),
        key(policy="navacd"),
        key(criterion=NavigableSpace(0.2)),
        key(criterion=NavigableSpace(0.4)),
        key(criterion=NavigableSpace(0.4, seeds=[(1, 2, 3)])),
        key(policy=str(policies[0])),
    ]
    assert len({*same, *others}) == 1 + len(others)
    assert key(file_type=".OBJ", folders=True) == key(file_type="obj", folders=True)
    assert key(policy=str(policies[0])) == key(policy=str(policies[1])), "where the network lies is all the same"


def test_a_batch_takes_every_option_of_a_decomposition() -> None:
    taken = {parameter.name for parameter in COMMAND.params}
    assert taken >= {option.name for option in dataclasses.fields(Options)} - {"criterion", "volume_tolerance"}
    assert taken >= {name for name in inspect.signature(Decomposition.save).parameters if name not in NOT_OPTIONS}


def test_an_order_survives_the_way_to_another_process() -> None:
    space = NavigableSpace(0.2, 0.4, seeds=[(1, 2, 3)], closed_planes=[((0, 0, 1), 0)])
    spec = JobSpec.of({"criterion": space, "max_vertices": 32}, file_type="urdf", density=2.0, up="y")
    again = JobSpec(**json.loads(json.dumps(dataclasses.asdict(spec))))
    assert Options(**again.options).criterion == space
    assert again.key("c", "a.obj") == spec.key("c", "a.obj")


# --- places for results -----------------------------------------------------------------------------------------------


@pytest.fixture
def store(tmp_path: Path) -> Store:
    return Store(tmp_path / "out")


def test_files_go_in_and_come_out(store: Store) -> None:
    assert store.read("a/b.bin") is None
    assert store.size("a/b.bin") is None
    store.write("a/b.bin", b"one")
    store.write("a/b.bin", b"three")
    assert (store.read("a/b.bin"), store.size("a/b.bin")) == (b"three", 5)
    store.remove("a/b.bin")
    store.remove("a/b.bin")
    assert store.read("a/b.bin") is None


@pytest.mark.promise("batch-resumes")
def test_rows_outlive_a_run_that_never_ended(store: Store) -> None:
    first = Ledger(store, "m.jsonl")
    first.add({"mesh": "b", "n": 1})
    first.add({"mesh": "a", "n": 1})
    first.add({"mesh": "b", "n": 2})
    first.__exit__(KeyboardInterrupt, KeyboardInterrupt(), None)
    with Ledger(store, "m.jsonl") as second:
        assert [second.get(mesh) for mesh in "abc"] == [{"mesh": "a", "n": 1}, {"mesh": "b", "n": 2}, None]
        second.add({"mesh": "c\udcff", "n": 3})
    before = store.read("m.jsonl")
    with Ledger(store, "m.jsonl") as again:
        assert again.get("c\udcff") == {"mesh": "c\udcff", "n": 3}
    assert store.read("m.jsonl") == before


def test_a_row_removes_the_files_that_only_its_forerunner_had_and_none_of_another_mesh(store: Store) -> None:
    for name in ("a.obj", "a_000.obj", "a_001.obj"):
        store.write(name, b"x")
    ledger = Ledger(store, "m.jsonl")
    ledger.add({"mesh": "a.stl", "outputs": {"a.obj": 1, "a_000.obj": 1, "a_001.obj": 1}})
    ledger.add({"mesh": "a.stl", "outputs": {"a.obj": 1, "a_000.obj": 1}})
    assert [store.size(name) for name in ("a.obj", "a_000.obj", "a_001.obj")] == [1, 1, None]
    ledger.add({"mesh": "a.ply", "outputs": {"a.obj": 1}})
    assert [mesh for mesh in ("a.ply", "a.stl") if ledger.get(mesh)] == ["a.ply"]
    ledger.add({"mesh": "a.stl", "outputs": {}})
    assert store.size("a.obj") == 1


def test_half_a_line_is_cut_off_and_a_damaged_one_is_reported(tmp_path: Path) -> None:
    store = Store(tmp_path)
    journal = tmp_path / "m.jsonl"
    journal.write_bytes(b'{"mesh": "a"}\n{"mesh": "b')
    with Ledger(store, "m.jsonl") as ledger:
        assert [mesh for mesh in "abc" if ledger.get(mesh)] == ["a"]
        ledger.add({"mesh": "c"})
    assert [json.loads(line)["mesh"] for line in journal.read_text().splitlines()] == ["a", "c"]
    journal.write_bytes(b'{"mesh": "a"}\n{"mesh": 1}\n')
    with pytest.raises(OutputError, match="line 2"):
        Ledger(store, "m.jsonl")


def test_two_runs_cannot_write_to_one_folder_and_the_next_sweeps_up_what_a_killed_one_left(tmp_path: Path) -> None:
    touch(tmp_path, "a/mesh.stl", "a/.rlacd-0123.tmp")
    first, second = Store(tmp_path), Store(tmp_path)
    first.open()
    with pytest.raises(OutputError, match="another run"):
        second.open()
    first.close()
    second.open()
    second.close()
    assert os.listdir(tmp_path / "a") == ["mesh.stl"]


def test_shards_work_beside_each_other_and_a_run_of_all_meshes_beside_none(tmp_path: Path) -> None:
    first, second, whole = Store(tmp_path, (1, 2)), Store(tmp_path, (2, 2)), Store(tmp_path)
    first.open()
    touch(tmp_path, ".rlacd-0123.tmp")
    second.open()
    assert (tmp_path / ".rlacd-0123.tmp").exists(), "the other one may be writing it"
    for other in (Store(tmp_path, (1, 2)), whole):
        with pytest.raises(OutputError, match="another run"):
            other.open()
    second.close()
    first.close()
    whole.open()
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("rlacd.batch.store.LOCK_SECONDS", 0.1)
        with pytest.raises(OutputError, match="another run"):
            first.open()
    whole.close()
    first.open()
    first.close()


@given(st.sets(NAMES, min_size=1), st.integers(1, 20))
def test_every_mesh_is_of_one_shard_whichever_others_there_are(names: set[str], parts: int) -> None:
    shards = [[name for name in names if Asset(name, Path(name), name).is_of((k, parts))] for k in range(1, parts + 1)]
    assert sorted(name for shard in shards for name in shard) == sorted(names)
    assert all(Asset(name, Path("elsewhere"), "").is_of((k, parts)) for k, s in enumerate(shards, 1) for name in s)
