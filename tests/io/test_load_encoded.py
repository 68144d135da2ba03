"""glTF files whose positions are encoded: Draco's streams and integers."""

from __future__ import annotations

import json
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import trimesh

import rlacd
from rlacd.errors import MeshFileError
from rlacd.io.read.load import load_mesh
from tests.assets import Rig, read_glb
from tests.io.hostile.gltf import glb, gltf_tree

DRACO = "KHR_draco_mesh_compression"


def ring_scene() -> trimesh.Scene:
    scene = trimesh.Scene()
    ring = trimesh.creation.annulus(1, 2, 1)
    for index, name in enumerate(("left", "right")):
        place = trimesh.transformations.translation_matrix((5.0 * index, 0, 0))
        scene.add_geometry(ring, node_name=name, geom_name="ring", transform=place)
    return scene


@pytest.fixture
def compressed(tmp_path: Path) -> Path:
    pytest.importorskip("DracoPy")
    path = tmp_path / "rings.glb"
    path.write_bytes(ring_scene().export(file_type="glb", extension_draco=True))
    return path


def test_draco_gives_the_triangles_that_were_compressed(compressed: Path) -> None:
    plain = compressed.with_name("plain.glb")
    plain.write_bytes(ring_scene().export(file_type="glb"))
    read, wanted = load_mesh(compressed), load_mesh(plain)
    for name in ("left", "right"):
        one, other = (
            trimesh.Trimesh(node.vertices, node.faces)
            for mesh in (read, wanted)
            for node in [mesh.of_node([node.name for node in mesh.nodes].index(name))]
        )
        assert one.is_volume
        assert one.volume == pytest.approx(other.volume, rel=1e-3)
        assert np.allclose(one.bounds, other.bounds, atol=1e-3)  # Draco rounds to 14 bits


def test_joints_and_weights_that_draco_compressed_place_a_skin(tmp_path: Path) -> None:
    draco = pytest.importorskip("DracoPy")
    rig, box = Rig(), trimesh.creation.box()
    joints, weights = np.zeros((8, 4), "<u1"), np.tile(np.array([1, 0, 0, 0], "<f4"), (8, 1))
    joints[:, 0] = np.arange(8) % 2
    stream = draco.encode(
        box.vertices, box.faces.astype("<u4"), preserve_order=True, generic_attributes={5: joints, 6: weights}
    )
    (position,) = (one["unique_id"] for one in draco.decode(stream).attributes if one["unique_id"] not in (5, 6))
    given = {"POSITION": position, "JOINTS_0": 5, "WEIGHTS_0": 6}
    kinds = {"POSITION": (5126, "VEC3"), "JOINTS_0": (5121, "VEC4"), "WEIGHTS_0": (5126, "VEC4")}
    rig.header["accessors"] = [{"componentType": kind, "count": 8, "type": of} for kind, of in kinds.values()]
    compressed = {DRACO: {"bufferView": rig.view(stream), "attributes": given}}
    attributes = {name: index for index, name in enumerate(kinds)}
    rig.header["meshes"] = [{"primitives": [{"attributes": attributes, "extensions": compressed}]}]
    rig.header["nodes"] = [{"mesh": 0, "skin": 0}, {}, {"translation": [0, 9, 0]}]
    rig.header["skins"] = [{"joints": [1, 2]}]
    rig.header["scenes"] = [{"nodes": [0, 1, 2]}]
    rig.header["extensionsRequired"] = [DRACO]
    del rig.header["animations"]
    mesh = load_mesh(rig.glb(tmp_path / "box.glb"))
    assert mesh.warnings == ()
    expected = box.vertices + np.outer(np.arange(8) % 2, (0, 9, 0))
    assert np.allclose(np.sort(mesh.vertices, axis=0), np.sort(expected, axis=0), atol=1e-3)


def test_a_draco_file_is_kept_as_it_is(compressed: Path) -> None:
    result = rlacd.decompose(compressed, quality="fast", threads=1, per_node=True)
    out = result.save(compressed.with_name("out.glb"), keep_input=True)
    (before, stored, _), (after, binary, _) = read_glb(compressed), read_glb(out)
    assert binary[: len(stored)] == stored
    assert after["extensionsRequired"] == before["extensionsRequired"] == [DRACO]
    for kind in ("meshes", "accessors", "bufferViews"):
        assert after[kind][: len(before[kind])] == before[kind]
    again = load_mesh(out)
    assert len(again.nodes) == 2
    assert len(again.left_out) == len(result)
    assert np.allclose(again.of_node(0).vertices, load_mesh(compressed).of_node(0).vertices)


def test_triangles_that_are_stored_plainly_as_well_need_no_draco(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    tree = gltf_tree(extensionsUsed=[DRACO])
    tree["meshes"][0]["primitives"][0]["extensions"] = {DRACO: {"bufferView": 0, "attributes": {"POSITION": 0}}}
    (tmp_path / "both.gltf").write_text(json.dumps(tree))
    monkeypatch.setitem(sys.modules, "DracoPy", None)
    assert len(load_mesh(tmp_path / "both.gltf").faces) == 12


@pytest.mark.parametrize(
    "change",
    [
        {},
        {"attributes": {"POSITION": 7}},
        {"attributes": {}},
        {"bufferView": 99},
        {"byteLength": 10**9},
        {"byteLength": 0},
        {"byteOffset": -8},
    ],
    ids=str,
)
def test_damaged_draco_is_refused_in_one_sentence(compressed: Path, change: dict[str, Any]) -> None:
    """A stream of zeros, or the extension or the view of the stream changed."""
    header, binary, _ = read_glb(compressed)
    of_view = change.keys() & {"byteLength", "byteOffset"}
    stream = header["meshes"][0]["primitives"][0]["extensions"][DRACO]
    (header["bufferViews"][stream["bufferView"]] if of_view else stream).update(change)
    compressed.write_bytes(glb(header, binary if change else bytes(len(binary))))
    with pytest.raises(MeshFileError, match=r"rings\.glb.*export it again"):
        load_mesh(compressed)
