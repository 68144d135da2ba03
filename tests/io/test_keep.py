"""The input's own scene in the output: untouched but for the hulls, each under the node it belongs to."""

from __future__ import annotations

import copy
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import trimesh

import rlacd
from rlacd.errors import OptionError
from tests.assets import Json, Rig, png, read_glb, view_of
from tests.hulls import assert_convex_hull

NAMES = {"unreal": "UCX_{}_00", "godot": "{}_000-convcolonly", None: "{}_hull_000"}
"""The name of the first hull of a node."""


@pytest.fixture(scope="module")
def cart(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return Rig().glb(tmp_path_factory.mktemp("cart") / "cart.glb")


@pytest.fixture(scope="module")
def apart(cart: Path) -> rlacd.Decomposition:
    return rlacd.decompose(cart, per_node=True, threads=1)


def without_hulls(header: Json, before: Json) -> Json:
    """Take what was added out of the JSON again, checking that it is only that."""
    left = copy.deepcopy(header)
    for kind in ("nodes", "meshes", "accessors", "bufferViews", "materials"):
        del left[kind][len(before[kind]) :]
    del left["scenes"][0]["nodes"][len(before["scenes"][0]["nodes"]) :]
    for node, was in zip(left["nodes"], before["nodes"], strict=True):
        if "children" in node:
            node["children"] = [child for child in node["children"] if child < len(before["nodes"])]
            if not node["children"] and "children" not in was:
                del node["children"]
    return left


@pytest.mark.parametrize("file_type", NAMES)
@pytest.mark.parametrize("stored", ["glb", "gltf", "embedded"])
@pytest.mark.promise("scene")
def test_a_textured_animated_scene_comes_back_node_by_node(tmp_path: Path, stored: str, file_type: str | None) -> None:
    rig = Rig()
    path = tmp_path / f"cart.{'glb' if stored == 'glb' else 'gltf'}"
    rig.glb(path) if stored == "glb" else rig.gltf(path, embedded=stored == "embedded")
    result = rlacd.decompose(path, per_node=True, threads=1, quality="fast")
    (tmp_path / "elsewhere").mkdir()
    out = tmp_path / "elsewhere" / "out.glb"
    result.save(out, file_type=file_type, keep_input=file_type is None)
    header, binary, others = read_glb(out)

    left = without_hulls(header, rig.header)
    image = left["images"][0]
    assert view_of(header, binary, image.pop("bufferView")) == png()
    assert image == {"mimeType": "image/png", "name": "red and blue"}
    same = {name: value for name, value in rig.header.items() if name not in ("images", "buffers")}
    assert {name: left[name] for name in same} == same
    assert set(left) == {*same, "images", "buffers"}
    assert binary[: len(rig.binary)] == rig.binary  # and with it every array, of skins and animations too
    assert others == ([(b"XTRA", b"unknown!")] if stored == "glb" else [])
    assert (len(header["materials"]) > 1) == (file_type is None)

    nodes = header["nodes"]
    for index, called in ((0, "Axle"), (1, "Wheel"), (2, "wheel"), (3, "Flag pole")):
        below = header["scenes"][0] if "skin" in nodes[index] else nodes[index]
        added = [child for child in below.get("children", below.get("nodes", [])) if child >= len(rig.header["nodes"])]
        assert [nodes[child]["name"] for child in added] == [NAMES[file_type].format(called)]
    if file_type == "unreal":  # the two wheels share a mesh
        added = [mesh["name"] for mesh in header["meshes"][len(rig.header["meshes"]) :]]
        assert sorted(added) == ["UCX_axle_00", "UCX_flag_00", "UCX_wheel_00", "UCX_wheel_01"]


def placed(read: trimesh.Scene, node: str) -> trimesh.Trimesh:
    transform, mesh = read.graph[node]
    return read.geometry[mesh].copy().apply_transform(transform)


@pytest.mark.parametrize(("how", "factor"), [({}, 1), ({"unit": "cm"}, 100), ({"scale": 0.01}, 100)])
@pytest.mark.promise("scene")
def test_hulls_lie_around_their_node_wherever_it_goes_in_the_unit_of_the_scene(
    tmp_path: Path, cart: Path, how: dict[str, Any], factor: float
) -> None:
    """Placed by a reader of its own, each hull covers what its node shows; the scene is stretched, turned, mirrored.

    Hulls alone are converted; in the input's scene they are as large as what they lie around.
    """
    result = rlacd.decompose(cart, per_node=True, threads=1, **how)
    before = trimesh.load_scene(cart, process=False)
    assert np.allclose(result.source.extents, before.extents / factor, rtol=1e-5)
    read = trimesh.load_scene(result.save(tmp_path / "out.glb", file_type="unreal"), process=False)
    assert np.allclose(read.bounds, before.bounds, atol=0.02)
    for number, hull in enumerate(result):
        there = placed(read, f"UCX_{hull.metadata['node']}_00")
        assert_convex_hull(there)
        assert there.volume == pytest.approx(hull.volume * factor**3, rel=1e-5)
        assert np.allclose(there.bounds, hull.bounds * factor, atol=1e-5)
        assert result.report.provenance[number].node == hull.metadata["node"]
    alone = trimesh.load_scene(result.save(tmp_path / "hulls.glb"), process=False)
    assert np.allclose(alone.extents, before.extents / factor, rtol=0.02)


def test_hulls_of_a_scene_as_a_whole_know_their_node(tmp_path: Path, cart: Path) -> None:
    result = rlacd.decompose(cart, threads=1)
    nodes = [hull.metadata["node"] for hull in result]
    assert {one.node for one in result.report.provenance} == set(nodes)
    assert {"Axle", "Flag pole"} <= set(nodes) <= {"Axle", "Wheel", "wheel", "Flag pole"}
    bodies = {repair.body for repair in result.report.repair}
    assert {hull.metadata["body"] for hull in result} <= bodies
    header, _, _ = read_glb(result.save(tmp_path / "out.glb", file_type="godot"))
    assert sum(node.get("name", "").endswith("-convcolonly") for node in header["nodes"]) == len(result)


@pytest.mark.promise("per-node")
def test_nodes_apart_share_the_threshold_of_the_scene() -> None:
    """A bracket that is small in its scene needs no cut there, but does on its own."""
    bracket = trimesh.util.concatenate(
        [
            trimesh.creation.box((0.1, 0.02, 0.02)),
            trimesh.creation.box((0.02, 0.1, 0.02)).apply_translation((0.04, 0.04, 0)),
        ]
    )
    scene = trimesh.Scene()
    scene.add_geometry(trimesh.creation.box((3, 1, 1)), node_name="cupboard")
    move = trimesh.transformations.translation_matrix((0, 1, 0))
    scene.add_geometry(bracket, node_name="handle", transform=move)
    counts: dict[str, list[str]] = {}
    for relative_to in ("scene", "node"):
        result = rlacd.decompose(scene, per_node=True, relative_to=relative_to, threads=1)
        counts[relative_to] = [hull.metadata["node"] for hull in result]
        worst = result.report.concavity
        assert len(worst.per_part) == len(result)
        assert result.report.hulls == len(result)
        assert result.report.mass.volume_abs == pytest.approx(3.0 + 0.1 * 0.02**2 + 0.08 * 0.02**2, rel=1e-6)
        assert [body.body for body in result.report.repair] == list(range(len(result.report.repair)))
    assert counts["scene"] == ["cupboard", "handle"]
    assert counts["node"].count("handle") == 2
    tight = rlacd.decompose(scene, per_node=True, threshold_abs=0.002, threads=1)
    assert [hull.metadata["node"] for hull in tight].count("handle") == 2


def boxes(*bounds: tuple[tuple[int, ...], tuple[int, ...]]) -> trimesh.Trimesh:
    return trimesh.util.concatenate([trimesh.creation.box(bounds=box) for box in bounds])


@pytest.mark.promise("per-node")
def test_no_hull_spans_nodes_that_interlock() -> None:
    """A socket that a tongue fills: each touches the other along five faces, and both together are one block."""
    socket = [((0, 0, 0), (3, 1, 1)), ((0, 0, 0), (1, 3, 1)), ((2, 0, 0), (3, 3, 1))]
    tongue = [((1, 1, 0), (2, 4, 1)), ((0, 3, 0), (3, 4, 1))]
    nodes, scene = {"socket": np.array(socket), "tongue": np.array(tongue)}, trimesh.Scene()
    scene.add_geometry(boxes(*socket), node_name="socket")
    scene.add_geometry(boxes(*tongue), node_name="tongue")
    assert len(rlacd.decompose(scene, threads=1)) == 1
    result = rlacd.decompose(scene, per_node=True, threads=1)
    assert sorted(hull.metadata["node"] for hull in result) == ["socket"] * 3 + ["tongue"] * 2
    random = np.random.default_rng(0)
    for hull in result:
        inside = random.dirichlet(np.full(len(hull.vertices), 0.2), 500) @ hull.vertices
        lower, upper = nodes[hull.metadata["node"]].swapaxes(0, 1)[:, :, None]
        outside = np.maximum(np.maximum(lower - inside, inside - upper), 0)
        assert np.linalg.norm(outside, axis=2).min(axis=0).max() < 0.1  # a hull of both reaches 0.5 into the other


def test_nodes_apart_cannot_have_a_navigable_space() -> None:
    with pytest.raises(OptionError, match="per_node"):
        rlacd.decompose(trimesh.creation.box(), per_node=True, criterion=rlacd.NavigableSpace(radius=0.2))


@pytest.mark.parametrize("scale", [1.0, 2.0])
def test_a_scene_in_memory_keeps_its_looks_and_is_not_changed(tmp_path: Path, scale: float) -> None:
    red = trimesh.creation.box((1, 1, 1))
    red.visual = trimesh.visual.ColorVisuals(red, vertex_colors=np.tile([255, 0, 0, 255], (8, 1)))
    turn = trimesh.transformations.rotation_matrix(0.4, (0, 0, 1))
    turn[:3, 3] = (3, 0, 0)
    scene = trimesh.Scene()
    scene.add_geometry(red, node_name="crate", transform=turn)
    scene.add_geometry(trimesh.creation.icosphere(2), node_name="ball")
    before = scene.bounds.copy()
    result = rlacd.decompose(scene, threads=1, scale=scale)
    read = trimesh.load_scene(result.save(tmp_path / "out.glb", keep_input=True), process=False)
    assert (np.asarray(read.geometry[read.graph["crate"][1]].visual.vertex_colors)[:, :3] == [255, 0, 0]).all()
    assert np.allclose(read.graph["crate"][0][:3, 3], scale * turn[:3, 3], atol=1e-6)
    assert np.allclose(read.bounds, result.source.bounds, atol=0.01)
    assert np.array_equal(scene.bounds, before)
    for hull in result:
        there = placed(read, f"{hull.metadata['node']}_hull_000")
        assert np.allclose(there.bounds, hull.bounds, atol=1e-5)


def test_an_input_without_a_scene_is_kept_in_grey(tmp_path: Path) -> None:
    path = tmp_path / "ball.stl"
    trimesh.creation.icosphere(2).export(path)
    result = rlacd.decompose(path, threads=1)
    read = trimesh.load_scene(result.save(tmp_path / "out.glb", keep_input=True), process=False)
    assert sorted(read.geometry) == ["ball", "hull_000"]
    with pytest.raises(OptionError, match=r"or write a \.glb"):
        result.save(tmp_path / "out.obj", keep_input=True)


def test_an_input_whose_looks_cannot_be_read_is_grey_and_a_warning_says_so(tmp_path: Path, monkeypatch: Any) -> None:
    path = tmp_path / "ball.obj"
    trimesh.creation.icosphere(2).export(path, include_texture=True)
    path.write_text("usemtl red\n" + path.read_text())
    result = rlacd.decompose(path, threads=1)
    monkeypatch.setattr("rlacd.io.read.obj.MOST_PARTS", 0)
    with pytest.warns(UserWarning, match=r"looks of ball\.obj could not be read"):
        result.save(tmp_path / "out.glb", keep_input=True)


def test_files_outside_the_folder_stay_outside(tmp_path: Path) -> None:
    """A hostile scene names a picture above its folder: it is not copied."""
    (tmp_path / "in").mkdir()
    (tmp_path / "secret.png").write_bytes(png())
    path = Rig().gltf(tmp_path / "in" / "cart.gltf")
    path.write_text(path.read_text().replace("paint.png", "../secret.png"))
    result = rlacd.decompose(path, threads=1, quality="fast")
    header, binary, _ = read_glb(result.save(tmp_path / "out.glb", file_type="unreal"))
    assert header["images"][0]["uri"] == "../secret.png"
    assert png() not in binary[len(Rig().binary) :]


@pytest.mark.parametrize("file_type", NAMES)
def test_hulls_of_an_earlier_run_give_way_to_new_ones(
    tmp_path: Path, apart: rlacd.Decomposition, file_type: str | None
) -> None:
    """Bodies and files are those of the first run, as if its hulls had never been there."""
    keep = file_type is None
    first = apart.save(tmp_path / "first.glb", file_type=file_type, keep_input=keep)
    again = rlacd.decompose(first, per_node=True, threads=1)
    assert [hull.metadata["node"] for hull in again] == [hull.metadata["node"] for hull in apart]
    assert all(np.array_equal(a.vertices, b.vertices) for a, b in zip(again, apart, strict=True))
    assert f"{len(apart)} of {len(apart) + 4} nodes, hulls of an engine" in again.report.warnings[0]

    second = again.save(tmp_path / "second.glb", file_type=file_type, keep_input=keep)
    before, after = (trimesh.load_scene(path, process=False) for path in (first, second))
    assert set(after.graph.nodes_geometry) == set(before.graph.nodes_geometry)
    assert after.area == pytest.approx(before.area, rel=1e-6)
    header, _, _ = read_glb(second)
    assert not any(node.get("children") == [] for node in header["nodes"])
    named = [node["name"] for node in header["nodes"] if "name" in node]
    assert len(named) == len(set(named))


def test_hulls_of_a_scene_in_memory_and_of_other_files_give_way(tmp_path: Path) -> None:
    post, old = trimesh.creation.box((1, 1, 3)), trimesh.creation.box((5, 5, 5))
    scene = trimesh.Scene({"post": post, "UCX_post_00": old})
    (tmp_path / "post.3mf").write_bytes(scene.export(file_type="3mf"))
    (tmp_path / "post.obj").write_text(scene.export(file_type="obj"))
    for source in (scene, tmp_path / "post.3mf", tmp_path / "post.obj"):
        result = rlacd.decompose(source, threads=1, quality="fast")
        assert [hull.volume for hull in result] == pytest.approx([3.0])
        assert "1 of 2 nodes, hulls of an engine (UCX_post_00) were left out" in result.report.warnings
        read = trimesh.load_scene(result.save(tmp_path / "out.glb", file_type="unreal"), process=False)
        assert read.extents.max() == pytest.approx(3.0)
        assert len(read.graph.nodes_geometry) == 2


def test_a_file_of_hulls_alone_is_decomposed() -> None:
    scene = trimesh.Scene({f"UCX_post_0{number}": trimesh.creation.box((1, 1, number + 1)) for number in range(2)})
    result = rlacd.decompose(scene, threads=1, quality="fast")
    assert result.report.warnings == ()
    assert max(hull.extents.max() for hull in result) == pytest.approx(2.0)
