"""Any file gives triangles or one clear sentence."""

import contextlib
import io
import re
import socket
import zipfile
from pathlib import Path

import numpy as np
import pytest
import trimesh

from rlacd.errors import EmptyMeshError, MeshDataError, MeshError, MeshFileError
from rlacd.io.read.load import load_mesh
from tests.assets import write_mesh
from tests.io.hostile.archives import zipped
from tests.io.hostile.gltf import gltf, gltf_tree, reference

FORMATS = ["obj", "stl", "ply", "off", "glb", "gltf", "dae", "3mf"]

BOX = trimesh.creation.box(extents=(1, 2, 3))
OBJ = "".join(f"v {x} {y} {z}\n" for x, y, z in BOX.vertices.tolist())
OBJ += "v 0 0 0\n" + "".join(f"f {a} {b} {c}\n" for a, b, c in (BOX.faces + 1).tolist())
DAE = BOX.export(file_type="dae")


def triangles(mesh):
    """The corners of all faces, in an order of their own."""
    rows = np.round(mesh.vertices[mesh.faces], 5)
    rows = np.stack([np.roll(t, -np.lexsort(t.T[::-1])[0], axis=0) for t in rows])
    return rows.reshape(-1, 9)[np.lexsort(rows.reshape(-1, 9).T[::-1])]


@pytest.mark.parametrize("extension", [*FORMATS, "vrm"])
@pytest.mark.promise("formats")
def test_every_format_gives_the_same_triangles_from_files_open_files_and_bytes(tmp_path, extension):
    kind = extension.replace("vrm", "glb")
    path = write_mesh(BOX, tmp_path / f"box.{kind}")
    path = path.rename(path.with_suffix(f".{extension}"))
    loaded = load_mesh(path)
    assert loaded.vertices.dtype == np.float64
    assert loaded.faces.dtype == np.int64
    np.testing.assert_allclose(triangles(loaded), triangles(BOX), atol=1e-5)
    assert loaded.asset is None or loaded.asset.is_gltf == (extension in ("glb", "gltf", "vrm"))
    content = path.read_bytes()
    with path.open("rb") as file:
        opened = load_mesh(file)
    assert opened.asset is None or opened.asset.path == path, "with what lies beside it"
    alone = [] if extension == "gltf" else [io.BytesIO(content), content]  # without the buffers beside it
    for mesh in (opened, *(load_mesh(one, file_type=extension.upper()) for one in alone), *map(load_mesh, alone[1:])):
        np.testing.assert_array_equal(mesh.vertices, loaded.vertices)
        np.testing.assert_array_equal(mesh.faces, loaded.faces)
    wrong = "off" if extension != "off" else "stl"
    with pytest.raises(MeshFileError, match=rf"mesh is not {wrong} but {kind}: use file_type={kind}"):
        load_mesh(content, file_type=wrong)
    with path.open("rb") as file, pytest.raises(MeshFileError, match=re.escape(f"{path} is not ")):
        load_mesh(file, file_type=wrong)


def test_meshes_in_a_list_are_bodies_of_one_object_and_arrays_may_be_two_arguments():
    other = BOX.copy().apply_translation((9, 0, 0))
    both = load_mesh([BOX, other])
    np.testing.assert_allclose(triangles(both), triangles(BOX + other))
    assert len(both.nodes) == 2
    np.testing.assert_array_equal(load_mesh(BOX.vertices, BOX.faces.tolist()).faces, BOX.faces)


@pytest.mark.parametrize("extension", FORMATS)
@pytest.mark.parametrize("share", [0.0, 0.02, 0.3, 0.7, 0.9])
@pytest.mark.promise("refused")
def test_a_file_cut_off_is_an_error_or_usable(tmp_path, extension, share):
    path = write_mesh(BOX, tmp_path / f"mesh.{extension}")
    content = path.read_bytes()
    path.write_bytes(content[: int(len(content) * share)])
    if extension == "obj" and share > 0:  # nothing in an obj file tells its length
        with contextlib.suppress(MeshError):
            load_mesh(path)
        return
    with pytest.raises(MeshFileError, match="again"):
        load_mesh(path)


@pytest.mark.parametrize(
    ("extension", "lie"),
    [("stl", "obj"), ("ply", "stl"), ("off", "ply"), ("glb", "dae"), ("dae", "glb"), ("3mf", "txt")],
)
def test_a_wrong_extension_names_the_right_one(tmp_path, extension, lie):
    wrong = write_mesh(BOX, tmp_path / f"mesh.{extension}").rename(tmp_path / f"mesh.{lie}")
    with pytest.raises(MeshFileError, match=f"rename it to .{extension}"):
        load_mesh(wrong)


def off(letters="", *, header="{keyword}\n{counts}", comments=False):
    """The box as the OFF file of some letters, each of which puts numbers on the lines of vertices."""
    more = " ".join(
        text for key, text in {"N": "0 0 1", "C": "255 0 0 255", "ST": "0.5 0.25"}.items() if key in letters
    )
    lines = [f"{x!r} {y!r} {z!r} {more}" for x, y, z in BOX.vertices.tolist()]
    lines += [f"3 {a} {b} {c}" + " 0.1 0.2 0.3" * (i % 2) for i, (a, b, c) in enumerate(BOX.faces.tolist())]
    if comments:
        lines = [word for line in lines for word in ("# a line\n", f"  {line}\t# {line} 7")]
    return "\n".join([header.format(keyword=f"{letters}OFF", counts="8 12 0"), *lines])


LETTERS = ["", "N", "C", "ST", "CN", "STCN"]


HEADERS = [
    "{keyword}\n{counts}",
    "{keyword} {counts}",
    "# a\n\n{keyword} # b\n\n{counts} # c\n",
    "\ufeff{keyword}\r\n{counts}\r",
]


@pytest.mark.parametrize(
    ("letters", "header"),
    [*zip(LETTERS, [*HEADERS, *HEADERS], strict=False)]
    + [("", header) for header in ("OFF{counts}", "{counts}", "off\n{counts}")],
)
def test_every_variant_of_off_gives_the_same_triangles(tmp_path, letters, header):
    path = tmp_path / "box.off"
    for comments in (False, True):
        path.write_text(off(letters, header=header, comments=comments), encoding="utf-8", newline="")
        np.testing.assert_array_equal(triangles(load_mesh(path)), triangles(BOX))


@pytest.mark.parametrize("letters", LETTERS)
def test_counts_of_every_variant_of_off_are_held_against_the_file(tmp_path, letters):
    path = tmp_path / "box.off"
    whole = off(letters).split("\n")
    for lines in (whole[:-1], whole[:5], [whole[0], "8 1000000000000 0", *whole[2:]]):
        path.write_text("\n".join(lines))
        with pytest.raises(MeshFileError, match=r"cut off \(its header declares 8 vertices and 1"):
            load_mesh(path)
    for counts in ("8", "-8 12 0", "many few", "9" * 40 + " 1"):
        path.write_text("\n".join([whole[0], counts, *whole[2:]]))
        with pytest.raises(MeshFileError, match="export it again"):
            load_mesh(path)


@pytest.mark.parametrize(
    ("name", "content", "says"),
    [
        ("a.off", b"OFF BINARY\n" + bytes(200), "binary OFF file"),
        ("a.off", b"STCNOFF BINARY\n" + bytes(200), "binary OFF file"),
        ("a.off", b"nOFF\n3\n1 0 0\n1 2 3\n", "nOFF or 4OFF, for any number of dimensions"),
        ("a.off", b"4OFF\n3 1 0\n0 0 0 1\n1 0 0 1\n0 1 0 1\n3 0 1 2\n", "nOFF or 4OFF, for any number of dimensions"),
        ("a.off", b"OFF\n4 2 0\n0 0 0\n1 0 0\n0 1 0\n0 0 1\n4 0 1 2\n3 0 1 3\n", "fewer corners than it declares"),
        ("a.off", b"OFF\n4 2 0\n0 0 0\n1 0 0\n0 1 0\n0 0 1\n-3 0 1 2\n3 0 1 3\n", "fewer corners than it declares"),
        ("a.off", b"OFF\n", "lacks the counts"),
        ("a.off", b"NOFF", "lacks the counts"),
        ("a.off", b"# OFF", "lacks the counts"),
        ("a.stl", BOX.export(file_type="stl_ascii").rpartition("endsolid")[0].encode(), "damaged or cut off"),
        ("a.stl", BOX.export(file_type="stl_ascii").replace(".", ",").encode(), "'-?.,.*' is no number"),
        ("a.stl", BOX.export(file_type="stl_ascii").replace(".", "·").encode("latin-1"), "'-?.·.*' is no number"),
        ("a.xyz", b"0 0 0\n1 0 0 1\n0 1 0\n", "damaged or cut off"),
        ("a.obj", OBJ.replace("0.5", "0,5").encode(), "'-?0,50*' is no number"),
        ("a.obj", f"{OBJ}f 1 2 3.0\n".encode(), "'3.0' is no whole number"),
        ("a.obj", b"version https://git-lfs.github.com/spec/v1\noid sha256:0\n", "run  git lfs pull"),
        ("a.glb", b"<!DOCTYPE html><html>", "is a web page"),
        ("a.glb", b"glTF\1\0\0\0" + bytes(20), "another version than glTF 2.0"),
        ("a.ply", BOX.export(file_type="ply").replace(b" z\n", b" w\n"), "'z' is missing"),
        ("a.obj", b"v 1 2\n" + OBJ.encode(), "a vertex of 2 coordinates"),
        *(("a.obj", f"{OBJ}f 1 2 {corner}\n".encode(), "counts from 1") for corner in ("0", "0/1", "-0", "0//1 # 1")),
        ("a.dae", DAE.replace(b"<library_geometries>", b"<library_geometries>\0", 1), "damaged or cut off"),
        ("a.zae", zipped({"box.dae": DAE.replace(b"</p>", b" x</p>", 1)}), "they are damaged"),
        ("a.blend", b"BLENDER-v400", "export it from Blender"),
        ("a.mjcf", b"<mujoco/>", "files for MuJoCo end in .xml"),
        ("a.obj.gz", b"\x1f\x8b\x08", "unpack it"),
        ("a.zip", zipped({"a.obj": OBJ}), "unpack it"),
        ("a.obj", zipped({"a.obj": OBJ}), ""),
        ("a.7z", b"7z\xbc\xaf\x27\x1c", "unpack it"),
    ],
)
def test_what_is_not_read_is_refused_for_what_it_is(tmp_path, name, content, says):
    (tmp_path / name).write_bytes(content)
    with pytest.raises(MeshFileError, match=says) as said:
        load_mesh(tmp_path / name)
    text = str(said.value)
    assert "\n" not in text
    assert "rename" not in text
    assert "3mf" not in text


def test_instances_are_placed_and_mirrored_ones_face_outward(tmp_path):
    scene = trimesh.Scene()
    scene.add_geometry(BOX, geom_name="box")
    mirror = np.diag([-1.0, 1, 1, 1])
    mirror[0, 3] = 10
    scene.graph.update(frame_to="second", matrix=mirror, geometry="box")
    path = tmp_path / "two.glb"
    scene.export(path)
    for loaded in (load_mesh(path), load_mesh(scene)):
        assert len(loaded.faces) == 2 * len(BOX.faces)
        np.testing.assert_allclose(np.ptp(loaded.vertices, axis=0), [11, 2, 3], atol=1e-6)
        assert trimesh.Trimesh(loaded.vertices, loaded.faces).volume == pytest.approx(12)


def test_arrays_and_quads():
    square = [[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]]
    assert load_mesh((square, [[0, 1, 2, 3]])).faces.tolist() == [[0, 1, 2], [0, 2, 3]]
    assert load_mesh((square, np.array([[0, 1, 2]], dtype=np.uint8))).faces.dtype == np.int64


@pytest.mark.parametrize("bad", [np.nan, np.inf, -np.inf])
def test_faces_with_vertices_that_are_not_finite_are_left_out(bad):
    vertices = np.array([[bad, 0, 0], [0, 0, 0], [1, 0, 0], [0, 1, 0]])
    loaded = load_mesh((vertices, [[0, 1, 2], [1, 2, 3]]))
    np.testing.assert_array_equal(loaded.vertices[loaded.faces], vertices[[[1, 2, 3]]])
    assert "1 faces" in loaded.warnings[0]
    with pytest.raises(MeshDataError, match="NaN or infinite"):
        load_mesh((vertices, [[0, 1, 2]]))


@pytest.mark.parametrize(
    ("changes", "says"),
    [
        ({"nodes": "ab"}, "damaged"),
        ({"nodes": ["x"]}, "damaged"),
        ({"nodes": [None]}, "damaged"),
        ({"meshes": "ab"}, "damaged"),
        ({"scenes": "s"}, "damaged"),
        ({"extensionsRequired": ["FOO_bar"]}, "requires the extension 'FOO_bar'"),
        (
            {"nodes": [{"children": [2]}, {"children": [2]}, {"mesh": 0}], "scenes": [{"nodes": [0, 1]}]},
            "below two others",
        ),
        ({"nodes": [{"children": [True]}, {"mesh": 0}]}, "True is no index"),
        ({"asset": {"version": "1.0"}}, "another version than glTF 2"),
        ({"buffers": [{"byteLength": 9, "uri": "a.dat"}]}, "refers to 'a.dat', which has to be in its folder"),
        *(
            ({key: [one | change for one in gltf_tree()[key]]}, r"it declares \d+ rows but has no room for them")
            for key, change in (
                ("accessors", {"count": 999}),
                ("accessors", {"byteOffset": 4}),
                ("bufferViews", {"byteStride": 1}),
            )
        ),
    ],
    ids=str,
)
def test_damage_in_gltf_is_refused_in_plain_words(tmp_path, changes, says):
    (tmp_path / "mesh.gltf").write_bytes(gltf(**changes))
    with pytest.raises(MeshFileError, match=says):
        load_mesh(tmp_path / "mesh.gltf")


def test_nothing_is_fetched(tmp_path, monkeypatch):
    def refuse(*args, **kwargs):
        raise AssertionError("loading opened a socket")

    monkeypatch.setattr(socket, "socket", refuse)
    monkeypatch.setattr(socket, "create_connection", refuse)
    path = tmp_path / "mesh.gltf"
    path.write_bytes(reference("http://localhost:1/mesh.bin"))
    with pytest.raises(MeshFileError):
        load_mesh(path)
    with pytest.raises(MeshFileError, match=r"http://localhost:1/mesh\.stl is an address, and nothing is fetched"):
        load_mesh("http://localhost:1/mesh.stl")


def test_real_files_of_every_kind(corpus):
    files = sorted((corpus / "raw").iterdir())
    assert {f.suffix for f in files} >= {".glb", ".dae", ".obj", ".stl"}
    for path in files:
        loaded = load_mesh(path)
        reference = trimesh.load_scene(
            io.BytesIO(path.read_bytes()), file_type=path.suffix[1:], process=False
        ).to_mesh()
        assert len(loaded.faces) == len(reference.faces)
        np.testing.assert_allclose(loaded.vertices.min(axis=0), reference.vertices.min(axis=0), atol=1e-6)
        np.testing.assert_allclose(loaded.vertices.max(axis=0), reference.vertices.max(axis=0), atol=1e-6)


@pytest.mark.parametrize("kind", ["float", "double"])
@pytest.mark.parametrize("tail", [b"", b"\n", b"\n\n  \n", b"\r\n"])
def test_text_ply_is_read_whole_or_refused(kind: str, tail: bytes, tmp_path: Path) -> None:
    rng = np.random.default_rng(3)
    points, faces = rng.normal(size=(40, 3)), rng.integers(0, 40, (60, 3))
    head = f"ply\nformat ascii 1.0\ncomment by hand\nelement vertex 40\nproperty {kind} x\nproperty {kind} nx\n"
    head += (
        f"property {kind} y\nproperty {kind} z\nelement face 60\nproperty list uchar int vertex_indices\nend_header\n"
    )
    lines = [f"{x!r} 0.5 {y:.3e} {z}" for x, y, z in points.tolist()]
    lines += [f"3 {a} {b} {c}" for a, b, c in faces.tolist()]
    path = tmp_path / "soup.ply"
    path.write_bytes(head.encode() + "\n".join(lines).encode() + tail)
    mesh = load_mesh(path)
    np.testing.assert_allclose(mesh.vertices, np.array([line.split() for line in lines[:40]], float)[:, [0, 2, 3]])
    assert mesh.faces.tolist() == faces.tolist()
    path.write_bytes(path.read_bytes().replace(b"format ascii", b"format\tASCII"))
    np.testing.assert_array_equal(load_mesh(path).vertices, mesh.vertices)
    twice = head.replace("element face", "element face 60\nproperty list uchar int vertex_indices\nelement face")
    for wrong in (twice, head[3:]):
        path.write_bytes(wrong.encode() + "\n".join(lines).encode() + tail)
        with pytest.raises(MeshFileError, match="damaged"):
            load_mesh(path)
    extra = head.replace(
        "end_header", "property int a\nproperty list uchar int vertex_indices\nproperty int a\nend_header"
    )
    path.write_text(extra + "\n".join([*lines[:40], *(f"{line} 7 1 5 8" for line in lines[40:])]))
    assert load_mesh(path).faces.tolist() == faces.tolist(), "the first of a name is read"
    path.write_text(head.replace("list uchar int", "int") + "\n".join([*lines[:40], *"1" * 60]))
    with pytest.raises(MeshFileError, match="its faces have no list vertex_indices"):
        load_mesh(path)
    for end in ("", "3 1 nan 2", "3 1 2", "3 1 0 2 5", "3 1 0.5 2", "3 1 -1 2", "3 1 40 2"):
        path.write_bytes(head.encode() + "\n".join([*lines[:-1], end]).encode() + tail)
        with pytest.raises(MeshFileError, match=r"damaged|cut off"):
            load_mesh(path)


@pytest.mark.parametrize(
    "content",
    [
        b"\xef\xbb\xbf" + OBJ.encode(),
        OBJ.replace("v ", "v\t").encode(),
        b"# K\xf6rper\n" + OBJ.encode(),
        OBJ.replace("\n", "\r").encode(),
        OBJ.replace("\n", "\r\n").replace("f ", "f \\\r\n", 3).encode(),
        re.sub(r"(?m)^(v .*)$", r"\1 1 0 0", OBJ, count=3).encode(),
    ],
)
def test_an_obj_is_read_whole_whatever_its_encoding_and_line_ends(tmp_path, content):
    (tmp_path / "box.obj").write_bytes(content)
    np.testing.assert_array_equal(triangles(load_mesh(tmp_path / "box.obj")), triangles(BOX))


def test_what_an_obj_holds_beside_faces_is_told(tmp_path):
    (tmp_path / "box.obj").write_text(
        OBJ + "l 1 2\np 1\ncstype bezier\ncurv 0 1 1 2\nsurf 0 1 0 1 1 2\nend\ncall lid.obj\n"
    )
    mesh = load_mesh(tmp_path / "box.obj")
    assert len(mesh.faces) == 12
    assert mesh.warnings == tuple(
        f"{what} in box.obj were left out"
        for what in ("points and lines", "free-form curves and surfaces", "calls to other files")
    )


def test_an_stl_is_read_whole_whatever_its_encoding_and_line_ends(tmp_path):
    text_stl = b"solid K\xf6rper\n" + BOX.export(file_type="stl_ascii").encode().split(b"\n", 1)[1]
    for content in (text_stl, text_stl.replace(b"\n", b"\r"), BOX.export(file_type="stl") + b"more"):
        (tmp_path / "box.stl").write_bytes(content)
        loaded = load_mesh(tmp_path / "box.stl")
        np.testing.assert_array_equal(triangles(loaded), triangles(BOX))
    assert loaded.warnings == ("4 bytes after the last triangle of box.stl were left out",)


def test_msh_of_mujoco_is_read_and_damage_in_it_refused(tmp_path):
    points, faces = BOX.vertices.astype("<f4"), BOX.faces.astype("<i4")
    whole = np.array([8, 8, 8, 12], "<i4").tobytes() + points.tobytes() + bytes(8 * 20) + faces.tobytes()
    (tmp_path / "box.msh").write_bytes(whole)
    np.testing.assert_array_equal(triangles(load_mesh(tmp_path / "box.msh")), triangles(BOX))
    for content in (whole[:-1], whole + b"\0", whole[:7], b"\xff" * 16 + whole[16:], b"$MeshFormat\n4.1 0 8\n"):
        (tmp_path / "box.msh").write_bytes(content)
        with pytest.raises(MeshFileError, match=r"again|Gmsh"):
            load_mesh(tmp_path / "box.msh")


@pytest.mark.parametrize("word", ["o", "g"])
def test_objects_of_an_obj_are_nodes_or_else_its_groups(tmp_path, word):
    """Quads, a concave face, indices from the end, and a name that comes again."""
    text = "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\n"
    text += f"{word} door\nf 1 2 3 4\n{word} frame left\nv 0 0 1\nv 2 0 1\nv 1 0.1 1\nv 1 2 1\nf -4 -3 -1 -2\n"
    text += f"{word} door\nf 1 2 3\n"
    path = tmp_path / "scene.obj"
    path.write_text(text, encoding="utf-8")
    mesh = load_mesh(path)
    assert [node.name for node in mesh.nodes] == ["door", "frame left"]
    corners = [mesh.vertices[mesh.faces[mesh.node_of == i]] for i in range(2)]
    areas = [np.linalg.norm(np.cross(c[:, 1] - c[:, 0], c[:, 2] - c[:, 0]), axis=1).sum() / 2 for c in corners]
    assert areas == pytest.approx([1.5, 1.05])
    path.write_text(text.replace("frame left", "door"), encoding="utf-8")
    assert len(load_mesh(path).nodes) == 1


def test_supports_of_a_3mf_file_are_left_out_and_what_it_requires_and_is_not_read_refused(tmp_path):
    trimesh.Scene([BOX, BOX.copy().apply_translation((9, 0, 0))]).export(tmp_path / "usual.3mf")
    with zipfile.ZipFile(tmp_path / "usual.3mf") as usual:
        model = usual.read("3D/3dmodel.model")
    path = tmp_path / "other.3mf"
    path.write_bytes(zipped({"3D/3dmodel.model": model.replace(b'type="model"', b'type="support"', 1)}))
    mesh = load_mesh(path)
    assert len(mesh.faces) == len(BOX.faces)
    assert mesh.warnings == ("support structures of other.3mf were left out: 1",)
    needs = model.replace(b"<model ", b'<model requiredextensions="p b" ', 1)
    path.write_bytes(zipped({"3D/3dmodel.model": needs}))
    with pytest.raises(MeshFileError, match="beamlattice/2017/02', which is not read"):
        load_mesh(path)
    path.write_bytes(zipped({"3D/3dmodel.model": re.sub(rb"<item .*?/>", b"", model)}))
    with pytest.raises(EmptyMeshError, match="its build places no object"):
        load_mesh(path)


def test_the_model_of_a_3mf_file_may_have_any_name(tmp_path):
    trimesh.Scene(BOX).export(tmp_path / "usual.3mf")
    with zipfile.ZipFile(tmp_path / "usual.3mf") as usual, zipfile.ZipFile(tmp_path / "other.3mf", "w") as other:
        for name in usual.namelist():
            content = usual.read(name).replace(b"3D/3dmodel.model", b"parts/box.model")
            other.writestr(name.replace("3D/3dmodel.model", "parts/box.model"), content)
    np.testing.assert_allclose(triangles(load_mesh(tmp_path / "other.3mf")), triangles(BOX), atol=1e-5)
