"""Faces with more than three corners: prisms over concave outlines keep their area and volume in every format."""

from __future__ import annotations

import re
import struct
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import trimesh
from hypothesis import given, settings
from hypothesis import strategies as st

import rlacd
from rlacd.errors import MeshError
from rlacd.io.read.load import load_mesh
from rlacd.io.read.polygons import MOST_CORNERS, triangles_of

L = [(0, 0), (3, 0), (3, 1), (1, 1), (1, 3), (0, 3)]
"""An outline whose fan around any but two of its corners folds over."""

Prism = tuple[np.ndarray, list[list[int]]]


def prism(outline, turn: np.ndarray | None = None, height: float = 1.0, first: int = 0) -> Prism:
    """Points and outward polygons of a prism over an outline, which starts at the given corner."""
    flat = np.roll(np.asarray(outline, dtype=np.float64), -first, axis=0)
    count = len(flat)
    points = np.concatenate([np.c_[flat, np.zeros(count)], np.c_[flat, np.full(count, height)]])
    sides = [[i, (i + 1) % count, count + (i + 1) % count, count + i] for i in range(count)]
    polygons = [list(range(count))[::-1], list(range(count, 2 * count)), *sides]
    return points if turn is None else points @ turn.T, polygons


def area_and_perimeter(outline) -> tuple[float, float]:
    """By the shoelace formula."""
    x, y = np.asarray(outline, dtype=np.float64).T
    area = (x * np.roll(y, -1) - np.roll(x, -1) * y).sum() / 2
    return area, np.hypot(np.roll(x, -1) - x, np.roll(y, -1) - y).sum()


def assert_is_prism(mesh: trimesh.Trimesh, outline, height: float = 1.0) -> None:
    area, around = area_and_perimeter(outline)
    assert mesh.volume == pytest.approx(area * height, rel=1e-5)
    assert mesh.area == pytest.approx(2 * area + around * height, rel=1e-5)  # folded triangles add to it
    assert mesh.is_watertight


def obj(solid: Prism, name=lambda corner: str(corner + 1)) -> bytes:
    points, polygons = solid
    lines = ["v " + " ".join(map(repr, p)) for p in points.tolist()]
    lines += ["f " + " ".join(name(corner) for corner in polygon) for polygon in polygons]
    return ("\n".join(lines) + "\n").encode()


def off(solid: Prism) -> bytes:
    points, polygons = solid
    lines = ["OFF", f"{len(points)} {len(polygons)} 0", *(" ".join(map(repr, p)) for p in points.tolist())]
    return "\n".join([*lines, *(" ".join(map(str, [len(p), *p])) for p in polygons), ""]).encode()


def ply(solid: Prism, order: str, corner: str = "I", element: str = "face", *, odd: bool = False) -> bytes:
    """As Blender and others write it: other fields beside the positions, and a field of its own on each face.

    If odd, faces come before the points, each of which has a list of its own length.
    """
    points, polygons = solid
    kind = {"": "ascii", "<": "binary_little_endian", ">": "binary_big_endian"}[order]

    def row(*fields: tuple[str, list[Any]]) -> bytes:
        if not order:
            return (" ".join(str(value) for _, values in fields for value in values) + "\n").encode()
        return b"".join(struct.pack(f"{order}{len(values)}{code}", *values) for code, values in fields)

    head = f"element vertex {len(points)}\nproperty uchar red\n" + "property list uchar float w\n" * odd
    head += "".join(f"property double {axis}\n" for axis in "xyz")
    weights = [[("B", [i % 3 + 1]), ("f", [0.5] * (i % 3 + 1))] if odd else [] for i in range(len(points))]
    rows = (row(("B", [7]), *w, ("d", p)) for w, p in zip(weights, points.tolist(), strict=True))
    vertices = head, b"".join(rows)
    head = f"element {element} {len(polygons)}\nproperty uchar flags\n"
    head += f"property list uchar {'uint' if corner == 'I' else 'int'} vertex_indices\n"
    faces = head, b"".join(row(("B", [1, len(p)]), (corner, p)) for p in polygons)
    heads, bodies = zip(*((faces, vertices) if odd else (vertices, faces)), strict=True)
    return f"ply\nformat {kind} 1.0\n{''.join(heads)}end_header\n".encode() + b"".join(bodies)


def dae(solid: Prism, one_list: bool = True) -> bytes:
    """With a normal for each corner, before its point; polygons in one list, or each in an element of its own."""
    points, polygons = solid
    rings = [" ".join(f"0 {corner}" for corner in p) for p in polygons]
    listed = f"<vcount>{' '.join(str(len(p)) for p in polygons)}</vcount><p>{' '.join(rings)}</p>"
    kind, inside = ("polylist", listed) if one_list else ("polygons", "".join(f"<p>{ring}</p>" for ring in rings))
    return f"""<?xml version="1.0" encoding="utf-8"?>
        <COLLADA xmlns="http://www.collada.org/2005/11/COLLADASchema" version="1.4.1">
        <asset><unit meter="1"/><up_axis>Z_UP</up_axis></asset>
        <library_geometries><geometry id="g"><mesh>
        <source id="n"><float_array id="n-a" count="3">0 0 1</float_array><technique_common>
        <accessor source="#n-a" count="1" stride="3"><param name="X" type="float"/><param name="Y" type="float"/>
        <param name="Z" type="float"/></accessor></technique_common></source>
        <source id="p"><float_array id="p-a" count="{points.size}">{" ".join(map(repr, points.ravel().tolist()))}
        </float_array><technique_common><accessor source="#p-a" count="{len(points)}" stride="3">
        <param name="X" type="float"/><param name="Y" type="float"/><param name="Z" type="float"/></accessor>
        </technique_common></source>
        <vertices id="v"><input semantic="POSITION" source="#p"/></vertices>
        <{kind} count="{len(polygons)}"><input semantic="NORMAL" source="#n" offset="0"/>
        <input semantic="VERTEX" source="#v" offset="1"/>{inside}</{kind}></mesh></geometry></library_geometries>
        <library_visual_scenes><visual_scene id="s"><node><instance_geometry url="#g"/></node></visual_scene>
        </library_visual_scenes><scene><instance_visual_scene url="#s"/></scene></COLLADA>""".encode()


def stl(solid: Prism) -> bytes:
    """Facets of as many corners as the polygons have, which no rule of the format allows, but some programs write."""
    points, polygons = solid
    loops = ("".join(f"vertex {' '.join(map(repr, points[corner].tolist()))}\n" for corner in p) for p in polygons)
    facets = "".join(f"facet normal 0 0 0\nouter loop\n{loop}endloop\nendfacet\n" for loop in loops)
    return f"solid a\n{facets}endsolid\n".encode()


WRITERS = {
    "dae": dae,
    "polygons.dae": lambda solid: dae(solid, one_list=False),
    "obj": obj,
    "off": off,
    "stl": stl,
    "ascii.ply": lambda solid: ply(solid, ""),
    "little.ply": lambda solid: ply(solid, "<"),
    "big.ply": lambda solid: ply(solid, ">"),
    "odd.ply": lambda solid: ply(solid, "", odd=True),
    "odd_binary.ply": lambda solid: ply(solid, "<", odd=True),
}


def read(path: Path, content: bytes) -> trimesh.Trimesh:
    path.write_bytes(content)
    mesh = load_mesh(path)
    return trimesh.Trimesh(mesh.vertices, mesh.faces)


def test_an_l_of_usd(tmp_path: Path) -> None:
    usd = pytest.importorskip("tests.io.test_load_usd")
    stage = usd.Usd.Stage.CreateNew(str(tmp_path / "l.usda"))
    usd.add_mesh(stage, "/l", *prism(L, first=3))
    stage.Save()
    loaded = load_mesh(tmp_path / "l.usda")
    assert_is_prism(trimesh.Trimesh(loaded.vertices, loaded.faces), L)


@settings(max_examples=60, deadline=None)
@given(
    radii=st.lists(st.floats(0.2, 2), min_size=4, max_size=30),
    kind=st.sampled_from(sorted(WRITERS)),
    seed=st.integers(0, 2**32 - 1),
    size=st.sampled_from([1e-3, 1.0, 1e4]),
)
@pytest.mark.promise("formats")
def test_prisms_over_stars_keep_area_and_volume(tmp_path_factory, radii, kind, seed, size) -> None:
    angles = np.linspace(0, 2 * np.pi, len(radii), endpoint=False)
    outline = size * np.array(radii)[:, None] * np.c_[np.cos(angles), np.sin(angles)]
    turn = trimesh.transformations.random_rotation_matrix(np.random.default_rng(seed).random(3))[:3, :3]
    folder = tmp_path_factory.mktemp("star")
    assert_is_prism(read(folder / f"star.{kind}", WRITERS[kind](prism(outline, turn, size))), outline, size)


@pytest.mark.parametrize(
    "name",
    [
        lambda corner: f"{corner + 1}/{corner + 1}/1",
        lambda corner: f"{corner + 1}//1",
        lambda corner: str(corner - 2 * len(L)),
    ],
    ids=["point/texture/normal", "point//normal", "counted from the end"],
)
def test_corners_of_an_obj_are_named_in_every_way(tmp_path: Path, name) -> None:
    content = obj(prism(L, first=3), name)
    assert_is_prism(read(tmp_path / "l.obj", content), L)
    dressed = content.replace(b"\nf ", b"\n  f\t").replace(b" 12", b" \\\n 12").replace(b"\n", b"\r\n")
    assert_is_prism(read(tmp_path / "dressed.obj", dressed), L)
    assert_is_prism(read(tmp_path / "said.obj", content.replace(b"\n  f", b" # a face\n  f")), L)


def test_looks_stay_on_the_triangles_of_a_concave_face(tmp_path: Path) -> None:
    content = obj(prism(L, first=3), lambda corner: f"{corner + 1}/{corner + 1}")
    textures = b"".join(b"vt %f %f\n" % (i / 12, i / 12) for i in range(12))
    (tmp_path / "l.obj").write_bytes(textures + content)
    rlacd.decompose(tmp_path / "l.obj", quality="fast").save(tmp_path / "out.glb", keep_input=True)
    kept = [one for name, one in trimesh.load_scene(tmp_path / "out.glb").geometry.items() if "hull" not in name]
    assert kept[0].visual.uv is not None
    assert sum(one.area for one in kept) == pytest.approx(2 * 5 + 12, rel=1e-5)


COMB = np.linspace(0, 2 * np.pi, MOST_CORNERS + 2, endpoint=False)

ODD = {
    "crosses itself": [(0, 0), (2, 2), (2, 0), (0, 2)],
    "on a line": [(0, 0), (1, 0), (3, 0), (2, 0)],
    "a point": [(1, 1)] * 5,
    "touches itself": [(0, 0), (4, 0), (4, 4), (2, 0), (0, 4)],
    "there and back": [(0, 0), (2, 0), (2, 2), (2, 0), (1, 0), (0, 2)],
    "not finite": [(0, 0), (2, 0), (np.nan, 1), (np.inf, 2), (0, 2)],
    "huge": [(0, 0), (1e308, 0), (1e307, 1e307), (0, 1e308)],
    "an edge": [(0, 0), (1, 0)],
    "very long": (1 + np.arange(len(COMB)) % 2)[:, None] * np.c_[np.cos(COMB), np.sin(COMB)],
}


@pytest.mark.parametrize("outline", ODD.values(), ids=ODD)
def test_odd_faces_give_as_many_triangles_as_a_fan(outline) -> None:
    points, polygons = prism(outline)
    counts = np.array([len(p) for p in polygons])
    with np.errstate(invalid="raise", over="raise"):  # only finite polygons are taken apart
        found = triangles_of(points, counts, np.concatenate(polygons))
    assert len(found) == (counts - 2).clip(0).sum()
    owner = np.repeat(np.arange(len(polygons)), (counts - 2).clip(0))
    assert all(set(face) <= set(polygons[i]) for face, i in zip(found.tolist(), owner.tolist(), strict=True))


@pytest.mark.parametrize("sides", [5, 7, 9])
def test_a_face_that_crosses_itself_stays_a_fan(sides) -> None:
    """Any other triangles fold over as well."""
    turn = 4 * np.pi * np.arange(sides) / sides
    points = np.c_[np.cos(turn), np.sin(turn), np.zeros(sides)]
    points[1] *= 1.5
    fan = [[0, i, i + 1] for i in range(1, sides - 1)]
    assert triangles_of(points, np.array([sides]), np.arange(sides)).tolist() == fan


@pytest.mark.parametrize("order", ["", "<", ">"])
def test_strips_of_a_ply_file_are_triangles_of_alternating_turn(tmp_path: Path, order: str) -> None:
    """A box: strips that -1 ends, and one in a list of its own."""
    points = np.array([[x, y, z] for z in (0, 1) for x, y in ((0, 0), (1, 0), (1, 1), (0, 1))], dtype=float)
    strips = [[0, 1, 4, 5, -1, 1, 2, 5, 6, -1, 2, 3, 6, 7, -1, 3, 0, 7, 4, -1, 0, 3, 1, 2], [4, 5, 7, 6]]
    content = ply((points, strips), order, "i", "tristrips")
    solid = read(tmp_path / "box.ply", content)
    assert solid.is_volume
    assert solid.volume == pytest.approx(1)
    with pytest.raises(MeshError, match="damaged"):
        read(tmp_path / "box.ply", content.replace(b"vertex_indices", b"strips_of_what"))


BOX = [(0, 0), (2, 0), (2, 2), (0, 2)]


@pytest.mark.parametrize("prefix", [b"", b"c:"])
def test_collada_is_read_as_it_defines(tmp_path: Path, prefix: bytes) -> None:
    """The layout of accessors and controllers, whatever the prefix of the tags; what is not read is named."""

    def load(content: bytes) -> tuple[trimesh.Trimesh, tuple[str, ...]]:
        content = content.replace(b"Z_UP", b"Y_UP")
        if prefix:
            content = re.sub(rb"<(/?)(?=[A-Za-z])", rb"<\1" + prefix, content).replace(b"xmlns=", b"xmlns:c=")
        (tmp_path / "box.dae").write_bytes(content)
        mesh = load_mesh(tmp_path / "box.dae")
        assert mesh.up == "y"
        return trimesh.Trimesh(mesh.vertices, mesh.faces), mesh.warnings

    box = dae(prism(BOX), one_list=False)
    solid, warned = load(box)
    assert warned == ()
    assert solid.volume == pytest.approx(4)
    skew, lookat = b"<skew>45 1 0 0 0 2 0</skew>", b"<lookat>0 0 0 1 0 0 0 0 1</lookat>"
    for moved in (skew, lookat, b"<matrix>1 0 0</matrix>", b"<scale>2 x 2</scale>"):
        with pytest.raises(MeshError, match=r"a <skew> or <lookat> there is not read"):
            load(box.replace(b"<node>", b"<node>" + moved))
    holed = b"<polygons><ph><p>0 0</p><h>0 0</h></ph></polygons>"
    with pytest.raises(MeshError, match=r"box\.dae has polygons with holes, .*: triangulate them"):
        load(box.replace(b"<polygons", holed + b"<polygons"))
    unused = b'<geometry id="h"><mesh>' + holed + b"</mesh></geometry></library_geometries>"
    harmless = box.replace(b"</library_geometries>", unused).replace(b"<node>", b"<node><skew>0 1 0 0 0 2 0</skew>")
    whole, warned = load(harmless.replace(b"</node>", b"</node><node>" + skew + lookat + b"</node>"))
    np.testing.assert_array_equal(whole.vertices, solid.vertices)
    assert warned == ()
    for missing in (b"geometry", b"controller", b"node"):
        missing = b"<instance_" + missing + b' url="#gone"/>'
        whole, warned = load(box.replace(b"</node>", missing + b"</node>"))
        np.testing.assert_array_equal(whole.vertices, solid.vertices)
        assert warned[-1] == "'#gone', which a node of box.dae places, is missing"

    hand = box.replace(b"<node>", b"<node>" * 60).replace(b"</node>", b"</node>" * 60)  # the bones down to a finger
    np.testing.assert_array_equal(load(hand)[0].vertices, solid.vertices)

    spread = box.replace(b'count="8" stride="3">', b'count="8" stride="4" offset="2"><param type="float"/>', 1)
    numbers = re.search(rb'<float_array id="p-a"[^>]*>([^<]*)', spread)
    rows = np.array(numbers[1].split()).reshape(-1, 3).tolist()
    padded = b"9 9 " + b" ".join(b"9 " + b" ".join(row) for row in rows)
    whole = spread.replace(numbers[1], padded)
    np.testing.assert_array_equal(load(whole)[0].vertices, solid.vertices)
    with pytest.raises(MeshError, match="leads out of its array"):
        load(spread)

    broken = box.replace(
        b"<polygons", b'<polylist count="1"><input semantic="VERTEX" source="#none"/></polylist><polygons'
    )
    whole, (warned_of,) = load(broken)
    np.testing.assert_array_equal(whole.vertices, solid.vertices)
    assert "were left out: they are damaged ('#none' is missing)" in warned_of

    skin = b"""<library_controllers><controller id="c"><skin source="#g"><bind_shape_matrix>2 0 0 0 0 2 0 0 0 0 2 0
        0 0 0 1</bind_shape_matrix></skin></controller></library_controllers><library_visual_scenes>"""
    bent = box.replace(b"<library_visual_scenes>", skin)
    bent = bent.replace(b'<instance_geometry url="#g"/>', b'<instance_controller url="#c"/>')
    twice, (warned_of,) = load(bent)
    assert twice.volume == pytest.approx(4 * 8)
    assert "as bound, at their nodes" in warned_of
