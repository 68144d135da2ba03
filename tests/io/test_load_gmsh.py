"""Meshes of Gmsh, written by Gmsh 4.15 itself and, those of cells of several kinds, by meshio 5.3."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest
import trimesh

from fuzz.seeds import GMSH
from rlacd.errors import MeshFileError
from rlacd.io.read.load import load_mesh

FILES = sorted(path.name for path in GMSH.glob("*.msh"))


@pytest.mark.parametrize("name", FILES)
@pytest.mark.promise("formats")
def test_the_surface_of_every_kind_of_file_is_closed_and_holds_its_volume(name: str) -> None:
    mesh = load_mesh(GMSH / name)
    surface = trimesh.Trimesh(mesh.vertices, mesh.faces, process=False)
    assert surface.is_watertight
    assert surface.is_winding_consistent
    # A box of 1, 2, 3; and a cube, with a pyramid, half a cube, and a tetrahedron on three of its sides.
    whole = 1 + 1 / 3 + 1 / 2 + 1 / 6 if name.startswith("cells") else 6.0
    assert surface.volume == pytest.approx(whole, abs=1e-9)
    assert name.startswith("cells") or surface.area == pytest.approx(22.0, abs=1e-9)
    assert set(np.unique(mesh.faces)) == set(range(len(mesh.vertices))), "nodes inside are no points of the surface"
    assert [re.sub(r"^\d+ ", "", said) for said in mesh.warnings] == (
        [f"elements of {name} are curved: they were read by their corners"] if "curved" in name else []
    )


@pytest.mark.parametrize("name", FILES)
@pytest.mark.promise("hostile-files")
def test_no_part_of_a_file_is_taken_for_the_whole(name: str, tmp_path: Path) -> None:
    content = (GMSH / name).read_bytes()
    end = content.rindex(b"$EndElements")
    for length in {*range(20, end, max(end // 60, 1)), end}:
        (tmp_path / name).write_bytes(content[:length])
        with pytest.raises(MeshFileError):
            load_mesh(tmp_path / name)


TEXT = (GMSH / "box_triangles_22_text.msh").read_bytes() if FILES else b""


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        (rb"2\.2 0 8", b"4 0 8", "MSH 4 "),
        (rb"2\.2 0 8", b"2.2 0 4", "numbers of 4 bytes"),
        (rb"\$Nodes\n\d+", b"$Nodes\n7", "declares 7 nodes"),
        (rb"\$Elements\n\d+", b"$Elements\n7", "declares 7 elements"),
        (rb"(?m)^(\d+) 2 2 ", rb"\1 21 2 ", "kind 21"),
        (rb"(?m)^(\d+) 2 2 .*$", rb"\1 15 2 0 1 1", "no triangles, quads or cells"),
        (rb"(?m)^(\d+) 2 2 (\d+ \d+) \d+ ", rb"\1 2 2 \2 999 ", "a node that is not there"),
        (rb"(?m)^2 (\S+ \S+ \S+)$", rb"1 \1", "the same number"),
        (rb"\$EndNodes\n", b"$EndNodes\n$Nodes\n0\n$EndNodes\n", "more than one"),
    ],
)
def test_what_is_not_read_is_refused(old: bytes, new: bytes, said: str, tmp_path: Path) -> None:
    changed = re.sub(old, new, TEXT)
    assert changed != TEXT
    (tmp_path / "a.msh").write_bytes(changed)
    with pytest.raises(MeshFileError, match=said):
        load_mesh(tmp_path / "a.msh")
