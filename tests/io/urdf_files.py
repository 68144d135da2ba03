"""Small URDF files, and their collision meshes as they are read."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import trimesh
from lxml import etree

from tests.models import table

EAR = """<?xml version="1.0"?>
<!-- made by hand -->
<robot name='ear'   >
\t<link name="base">
\t\t<inertial><mass value="1"/><inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/></inertial>
\t\t<visual>
\t\t\t<geometry><mesh filename="meshes/table.stl"/></geometry>
\t\t</visual>
\t\t<collision name="a &gt; b">
\t\t\t<origin xyz="0 0 1"/><!-- kept > -->
\t\t\t<geometry>
\t\t\t\t<mesh scale="0.5 0.5 2"
\t\t\t\t      filename = 'meshes/table.stl' />
\t\t\t</geometry>
\t\t</collision>
\t\t<collision><geometry><box size="1 1 1"/></geometry></collision>
\t</link>
\t<joint name="j" type="fixed"><parent link="base"/><child link="tip"/></joint>
\t<link name="tip"><inertial><mass value="1"/><inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/></inertial>
\t\t<collision><geometry><mesh filename="meshes/table.stl" scale="-1 1 1"/></geometry></collision>
\t\t<collision><geometry><mesh filename="meshes/table.stl" scale="0.5 0.5 2"/></geometry></collision></link>
</robot>   
<!-- the end -->"""


def part(*attributes: str) -> str:
    """A robot of one link, which collides as meshes of these attributes."""
    each = "".join(f"<collision><geometry><mesh {words}/></geometry></collision>" for words in attributes)
    return f"<robot name='r'><link name='l'>{each}</link></robot>"


def urdf(folder: Path, *attributes: str) -> Path:
    (folder / "r.urdf").write_text(part(*attributes))
    return folder / "r.urdf"


def without_collision_meshes(text: str) -> str:
    """Take out every collision that is a mesh, and the white space before all but the first of a run of them."""
    blocks = re.compile(r"<collision\b(?:(?!</collision>).)*?<mesh.*?</collision>", re.DOTALL)
    return re.sub(r"(?:@\s*)*@", "@", blocks.sub("@", text))


def collisions(path: Path) -> list[trimesh.Trimesh]:
    """Read the collision meshes of a URDF, scaled as it says."""
    found = []
    for mesh in etree.parse(str(path)).iterfind(".//collision/geometry/mesh"):
        read = trimesh.load_mesh(path.parent / mesh.get("filename"), process=False)
        scale = np.array([float(word) for word in mesh.get("scale", "1 1 1").split()])
        faces = read.faces if scale.prod() > 0 else read.faces[:, ::-1]
        found.append(trimesh.Trimesh(read.vertices * scale, faces, process=False))
    return found


def write_ear(folder: Path) -> Path:
    """A robot with the awkward parts real ones have, its mesh beside it."""
    (folder / "meshes").mkdir()
    table().export(folder / "meshes" / "table.stl")
    (folder / "ear.urdf").write_text(EAR)
    return folder / "ear.urdf"
