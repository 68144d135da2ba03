"""What a file holds, told from its first bytes, and what to do with files that are not read."""

from __future__ import annotations

import re

CONVERTERS = {
    "blend": "export it from Blender (File > Export > glTF 2.0)",
    "fbx": "import it into Blender and export it as glTF 2.0",
    **dict.fromkeys(("zip", "gz", "bz2", "xz", "zst", "7z", "rar", "tar", "tgz"), "unpack it, and give the mesh in it"),
    **dict.fromkeys(("step", "stp", "iges", "igs"), "export it from a CAD program, such as FreeCAD, as stl or obj"),
    "xacro": "expand its macros with the tool xacro, and give the URDF",
    "urdf": "it describes a robot, which rlacd.rewrite_robot takes",
    "sdf": "robots are rewritten as .urdf and .xml (MJCF): give one of those, or a mesh",
}
"""What to do with files that people have and that are not read."""

OFF_KEYWORD = re.compile(rb"((?:ST|[CN4n])*)OFF(?![A-Za-z])|off(?![A-Za-z])")

_OBJ_WORDS = {b"v", b"vn", b"vt", b"vp", b"f", b"l", b"p", b"g", b"o", b"s", b"mtllib", b"usemtl"}


def format_of(content: bytes) -> str | None:
    """Guess the format of a file."""
    head = content[:4096].lstrip(b"\xef\xbb\xbf \t\r\n")
    if head.startswith(b"glTF"):
        return "glb"
    if head.startswith(b"ply\n") or head.startswith(b"ply\r"):
        return "ply"
    if head.startswith(b"PK\x03\x04"):
        known = {"usdz": b".usd" in head, "zae": b".dae" in content, "3mf": b".model" in content}
        return next((name for name, held in known.items() if held), None)
    lines = [line.split() for line in head.splitlines() if line.strip() and not line.lstrip().startswith(b"#")]
    if lines and OFF_KEYWORD.match(lines[0][0]):
        return "off"
    if head.startswith(b"<") and b"COLLADA" in head:
        return "dae"
    if head.startswith(b"{") and b'"asset"' in content:
        return "gltf"
    if len(content) >= 84 and len(content) == 84 + 50 * int.from_bytes(content[80:84], "little"):
        return "stl"
    if head.startswith(b"solid") and b"facet" in head:
        return "stl"
    words = {line[0] for line in lines[:-1]}
    return "obj" if b"v" in words and words <= _OBJ_WORDS else None
