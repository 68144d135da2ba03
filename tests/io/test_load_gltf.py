"""glTF files are read as the specification defines: sparse arrays, poses of skins and morphs, instances."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import trimesh

import rlacd
from rlacd.errors import MeshFileError
from rlacd.io.read.load import load_mesh
from rlacd.solid.input_mesh import InputMesh
from tests.assets import Rig

BOX = trimesh.creation.box()
TURN = trimesh.transformations.rotation_matrix


@pytest.fixture
def rig() -> Rig:
    """A rig whose scene is one box; tests add to it."""
    rig = Rig()
    rig.header["meshes"] = [rig.mesh("box", BOX)]
    rig.header["nodes"] = [{"mesh": 0}]
    rig.header["scenes"] = [{"nodes": [0]}]
    for unused in ("skins", "animations"):
        del rig.header[unused]
    return rig


def read(rig: Rig, folder: Path) -> InputMesh:
    mesh = load_mesh(rig.glb(folder / "box.glb"))
    assert mesh.warnings == ()
    return mesh


def moved(points: np.ndarray, by: np.ndarray) -> np.ndarray:
    return np.asarray(trimesh.transform_points(points, by))


@pytest.mark.parametrize("without_view", [False, True])
def test_a_sparse_array_changes_some_rows(rig: Rig, tmp_path: Path, without_view: bool) -> None:
    (primitive,) = rig.header["meshes"][0]["primitives"]
    accessor = rig.header["accessors"][primitive["attributes"]["POSITION"]]
    accessor["sparse"] = {
        "count": 2,
        "indices": {"bufferView": rig.view(np.array([1, 6], "<u2").tobytes()), "componentType": 5123},
        "values": {"bufferView": rig.view(np.array([[1, 2, 3], [4, 5, 6]], "<f4").tobytes())},
    }
    expected = np.array(BOX.vertices)
    if without_view:
        del accessor["bufferView"]
        expected[:] = 0
    expected[[1, 6]] = [[1, 2, 3], [4, 5, 6]]
    np.testing.assert_array_equal(read(rig, tmp_path).vertices, expected)
    accessor["sparse"]["indices"]["componentType"] = 5121
    rig.binary = rig.binary[:-32] + b"\x09" * 32
    with pytest.raises(MeshFileError, match="damaged"):
        load_mesh(rig.glb(tmp_path / "box.glb"))


@pytest.mark.parametrize("kind", ["<i1", "<u1", "<i2", "<u2"])
@pytest.mark.parametrize("normalized", [True, False])
def test_integers_are_lengths_as_the_specification_says(rig: Rig, tmp_path: Path, kind: str, normalized: bool) -> None:
    """KHR_mesh_quantization: a normalised integer is a share of the largest, any other is its own value."""
    signed, most = "i" in kind, np.iinfo(kind).max
    corners = np.zeros((8, 4), kind)  # rows of positions begin at multiples of four bytes
    corners[:, :3] = np.where(BOX.vertices > 0, most, -int(most) if signed else 0)
    component = {"<i1": 5120, "<u1": 5121, "<i2": 5122, "<u2": 5123}[kind]
    (primitive,) = rig.header["meshes"][0]["primitives"]
    primitive["attributes"] = {"POSITION": rig.accessor(corners, "VEC3", component, normalized=normalized)}
    rig.header["bufferViews"][-1]["byteStride"] = corners.strides[0]
    rig.header["nodes"][0]["scale"] = [2.0, 2.0, 2.0]
    rig.header["extensionsRequired"] = ["KHR_mesh_quantization"]
    vertices = read(rig, tmp_path).vertices
    expected = np.array([-1.0 if signed else 0.0, 1.0]) * 2 * (1 if normalized else most)
    assert np.allclose([vertices.min(axis=0), vertices.max(axis=0)], expected[:, None])


@pytest.mark.parametrize("bound", [True, False])
def test_a_skinned_mesh_lies_where_its_joints_put_it(rig: Rig, tmp_path: Path, bound: bool) -> None:
    """By the formula of the specification, corner by corner; the transform of the mesh's own node is ignored."""
    rng = np.random.default_rng(1)
    joints, weights = rng.integers(0, 2, (8, 8)).astype("<u1"), np.zeros((8, 8), "<u2")
    weights[np.arange(8), rng.integers(0, 4, 8)] = 40000
    weights[np.arange(8), rng.integers(4, 8, 8)] = 25535
    attributes = rig.header["meshes"][0]["primitives"][0]["attributes"]
    for number, part in enumerate((slice(0, 4), slice(4, 8))):
        attributes[f"JOINTS_{number}"] = rig.accessor(np.ascontiguousarray(joints[:, part]), "VEC4", 5121)
        rows = np.ascontiguousarray(weights[:, part])
        attributes[f"WEIGHTS_{number}"] = rig.accessor(rows, "VEC4", 5123, normalized=True)
    arm, hand = TURN(0.5, (1, 2, 3)), TURN(-1.2, (3, 1, 0), (1, 1, 1))
    inverses = np.stack([TURN(0.3, (0, 1, 1), (0, 2, 0)), TURN(0.9, (1, 0, 1), (3, 2, 0))]).astype("<f4")
    rig.header["nodes"] = [
        {"mesh": 0, "skin": 0, "scale": [100, 100, 100], "name": "body"},
        {"matrix": arm.T.ravel().tolist(), "children": [2]},
        {"matrix": hand.T.ravel().tolist()},
    ]
    rig.header["scenes"] = [{"nodes": [0, 1]}]
    rig.header["skins"] = [{"joints": [2, 1]}]
    if bound:
        stored = np.ascontiguousarray(inverses.transpose(0, 2, 1)).reshape(2, 16)
        rig.header["skins"][0]["inverseBindMatrices"] = rig.accessor(stored, "MAT4")
    moves = [
        world @ (inverse if bound else np.eye(4)) for world, inverse in zip((arm @ hand, arm), inverses, strict=True)
    ]
    expected = [
        sum(
            weight / 65535 * moved(point[None], moves[joint])[0]
            for joint, weight in zip(joints[i], weights[i], strict=True)
        )
        for i, point in enumerate(BOX.vertices)
    ]
    mesh = read(rig, tmp_path)
    np.testing.assert_allclose(mesh.vertices, expected, atol=1e-6)
    assert [node.name for node in mesh.nodes] == ["body"]


def test_morph_targets_have_the_weights_of_the_node_or_else_of_the_mesh(rig: Rig, tmp_path: Path) -> None:
    rng = np.random.default_rng(2)
    targets = rng.random((2, 8, 3)).astype("<f4")
    rig.header["meshes"][0]["primitives"][0]["targets"] = [{"POSITION": rig.accessor(one, "VEC3")} for one in targets]
    rig.header["meshes"][0]["weights"] = [0.5, 2.0]
    rig.header["nodes"] = [{"mesh": 0}, {"mesh": 0, "weights": [0, -1]}, {"mesh": 0, "weights": [0, 0]}]
    rig.header["scenes"] = [{"nodes": [0, 1, 2]}]
    shifts = [0.5 * targets[0] + 2 * targets[1], -targets[1], 0 * targets[0]]
    expected = np.concatenate([BOX.vertices + shift for shift in shifts])
    np.testing.assert_allclose(read(rig, tmp_path).vertices, expected, atol=1e-6)


def test_instances_of_a_node_are_placed_within_it(rig: Rig, tmp_path: Path) -> None:
    moves = np.array([[0, 0, 0], [3, 0, 0], [0, 5, 0]], "<f4")
    turns = np.array([[0, 0, 0, 127], [90, 0, 0, 90], [0, 127, 0, 0]], "<i1")
    sizes = np.array([[1, 1, 1], [1, 2, 3], [-1, 1, 1]], "<f4")
    given = {
        "TRANSLATION": rig.accessor(moves, "VEC3"),
        "ROTATION": rig.accessor(turns, "VEC4", 5120, normalized=True),
        "SCALE": rig.accessor(sizes, "VEC3"),
    }
    name = "EXT_mesh_gpu_instancing"
    rig.header["extensionsRequired"] = [name]
    rig.header["nodes"] = [{"mesh": 0, "extensions": {name: {"attributes": given}}, "scale": [2, 2, 2]}]
    turned = [np.eye(4), TURN(np.pi / 2, (1, 0, 0)), TURN(np.pi, (0, 1, 0))]
    placed = [moved(moved(BOX.vertices, np.diag([*size, 1])), turn) for size, turn in zip(sizes, turned, strict=True)]
    mesh = read(rig, tmp_path)
    np.testing.assert_allclose(
        mesh.vertices, np.concatenate([2 * (p + m) for p, m in zip(placed, moves, strict=True)]), atol=1e-6
    )
    assert trimesh.Trimesh(mesh.vertices, mesh.faces).volume == pytest.approx(8 * (1 + 6 + 1))
    assert len(mesh.nodes) == 1


def test_nodes_that_a_file_hides_neither_count_nor_stretch_the_others(rig: Rig, tmp_path: Path) -> None:
    name = "KHR_node_visibility"
    hidden = {"translation": [50, 0, 0], "children": [2], "extensions": {name: {"visible": False}}}
    rig.header["extensionsRequired"] = [name]
    rig.header["nodes"] = [{"mesh": 0}, hidden, {"mesh": 0}, {"mesh": 0, "translation": [0, 70, 0], "scale": [0] * 3}]
    rig.header["scenes"] = [{"nodes": [0, 1, 3]}]
    mesh = load_mesh(rig.glb(tmp_path / "box.glb"))
    assert mesh.warnings == ("hidden nodes were left out, with those below them: 1",)
    assert mesh.faces.shape == BOX.faces.shape
    np.testing.assert_array_equal(np.sort(mesh.vertices[mesh.faces], axis=0), np.sort(BOX.triangles, axis=0))
    result = rlacd.decompose(tmp_path / "box.glb", quality="fast", threads=1, per_node=True)
    assert (len(result), result.report.scale) == (1, 2.0)


def test_what_a_gltf_adds_to_its_triangles_is_read_refused_or_named(tmp_path: Path) -> None:
    files = trimesh.Scene(BOX).export(file_type="gltf")
    tree = json.loads(files.pop("model.gltf"))
    for name, content in files.items():
        (tmp_path / name).write_bytes(content)

    def load(**changes: Any) -> InputMesh:
        (tmp_path / "box.gltf").write_text(json.dumps(tree | changes))
        return load_mesh(tmp_path / "box.gltf")

    (primitive,) = tree["meshes"][0]["primitives"]
    corners = load().faces.ravel()
    for mode in (5, 6):
        loaded = load(meshes=[{"primitives": [primitive, primitive | {"mode": mode}]}])
        if mode == 5:
            rows = [corners[i : i + 3][:: -1 if i % 2 else 1] for i in range(34)]
        else:
            rows = [[corners[0], corners[i], corners[i + 1]] for i in range(1, 35)]
        expected = np.concatenate([BOX.faces, rows])
        assert len(loaded.faces) == 46
        areas = trimesh.triangles.area(loaded.vertices[loaded.faces])
        assert areas.sum() == pytest.approx(trimesh.triangles.area(BOX.vertices[expected]).sum())
    assert "lines" in load(meshes=[{"primitives": [primitive, primitive | {"mode": 1}]}]).warnings[0]
    assert load(extensionsRequired=["KHR_texture_transform", "EXT_texture_webp"]).warnings == ()
    nodes = [{**node, "skin": 0} for node in tree["nodes"]]
    assert load(nodes=nodes).warnings == ("meshes with a skin but without joints were placed by their nodes: 1",)
