"""From a file or an object in memory to one list of triangles.

Input: a path, a `trimesh.Trimesh` or `Scene`, or arrays. Output: an `InputMesh` whose vertices are finite and whose
faces are in range, in the input's own frame and unit. trimesh parses; this module decides what may be opened, bakes
scenes, and turns every failure into one sentence.
"""

from __future__ import annotations

import io
import os
import re
from collections.abc import Iterable, Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any, NamedTuple, TypeAlias

import numpy as np
import trimesh
from numpy.typing import ArrayLike

from rlacd.errors import EmptyMeshError, MeshDataError, MeshFileError, MissingExtraError
from rlacd.io.read.beside import FolderFiles
from rlacd.io.read.conventions import stated
from rlacd.io.read.engine_hulls import without_engine_hulls
from rlacd.io.read.gltf import Gltf, Triangles, read_gltf
from rlacd.io.read.limits import MOST_TRIANGLES
from rlacd.io.read.looks import has_looks
from rlacd.io.read.msh import msh_as_ply
from rlacd.io.read.obj import objects_of
from rlacd.io.read.off import is_off, plain_off
from rlacd.io.read.open_file import read_file
from rlacd.io.read.text import check_text, declared_triangles, is_text, plain_obj, plain_ply, plain_stl, plain_text
from rlacd.io.read.usd import USD, usd_scene
from rlacd.io.read.xml import collada_of, plain_3mf
from rlacd.memory import BYTES_READ, require_memory
from rlacd.solid.frame import FloatArray
from rlacd.solid.input_mesh import Asset, InputMesh, SourceNode
from rlacd.solid.products import heights
from rlacd.solid.topology import BoolArray, IntArray

Source: TypeAlias = str | os.PathLike[str] | trimesh.Trimesh | trimesh.Scene | tuple[ArrayLike, ArrayLike]

FORMATS = ("obj", "msh", "stl", "ply", "off", "glb", "gltf", "vrm", "dae", "zae", "3mf", "xyz", *USD)
"""The formats that are read. trimesh parses more, but those parsers have not been reviewed against hostile files."""

CONVERTERS = {
    "blend": "export it from Blender (File > Export > glTF 2.0)",
    "fbx": "import it into Blender and export it as glTF 2.0",
    **dict.fromkeys(("zip", "gz", "bz2", "xz", "zst", "7z", "rar", "tar", "tgz"), "unpack it, and give the mesh in it"),
    **dict.fromkeys(("step", "stp", "iges", "igs"), "export it from a CAD program, such as FreeCAD, as stl or obj"),
}
"""What to do with files that people have and that are not read."""


def load_mesh(source: Source) -> InputMesh:
    """Read a mesh of any format and bring all its bodies into one list of triangles.

    Parameters
    ----------
    source
        A path (obj, msh, stl, ply, off, glb, gltf, vrm, dae, zae, 3mf, xyz, usd), a mesh or scene of trimesh, or
        vertices ``[V, 3]`` with faces ``[F, 3]`` (or quads ``[F, 4]``). Scenes are baked: every instance of a geometry
        is placed by its transform. Paths and curves are ignored; point clouds give vertices without faces. Nodes of a
        scene that are hulls for an engine, by their names, are left out with a warning if there are others.

    Returns
    -------
    InputMesh

    Raises
    ------
    MeshFileError
        The file is missing, empty, truncated, or not in the format its name says; or it would take more memory or time
        than is reasonable.
    MeshDataError
        The arrays have the wrong shape, indices are out of range, or no face is finite.
    EmptyMeshError
        There are no points at all.
    MissingExtraError
        A USD file or one that Draco compressed, and the extra ``usd`` or ``draco`` is not installed.
    """
    if isinstance(source, os.PathLike):
        source = os.fspath(source)  # bytes are refused below
    if isinstance(source, str):
        return without_engine_hulls(_from_file(Path(source)))
    if isinstance(source, trimesh.Trimesh | trimesh.Scene | trimesh.PointCloud):
        kind = type(source).__name__
        baked = _bake(source, kind)
        looks = isinstance(source, trimesh.Scene) or (isinstance(source, trimesh.Trimesh) and source.visual.defined)
        return without_engine_hulls(replace(_clean(baked, kind), asset=Asset(source) if looks else None))
    if isinstance(source, tuple) and len(source) == 2:
        return _clean(_Baked(*_arrays(*source)), "arrays")
    raise MeshDataError(
        f"cannot take a mesh from {type(source).__name__}: give a path, a trimesh object, or a tuple (vertices, faces)"
    )


def _from_file(path: Path) -> InputMesh:
    """Read a file, with the conventions and the scene that it states."""
    content, extension, scene = _read(path)
    mesh = _clean(_bake(scene, path.name), path.name)
    up, metres = stated(extension, content, scene)
    mesh = replace(mesh, up=up, metres=metres, warnings=(*mesh.warnings, *_left_out(path, content, extension, scene)))
    if isinstance(scene, Gltf):
        return replace(mesh, asset=Asset(content, path, extension))
    if extension in USD:
        assert not isinstance(scene, Gltf)
        kept = len(mesh.nodes) > 1 or any(one.visual.defined for one in scene.geometry.values())
        return replace(mesh, asset=Asset(scene, extension=extension) if kept else None)
    kept = has_looks(path, content, extension, len(mesh.nodes))
    return replace(mesh, asset=Asset(content, path, extension) if kept else None)


def _left_out(path: Path, content: bytes, extension: str, scene: trimesh.Scene | Gltf) -> list[str]:
    """A sentence for each kind of content of a file that was not read."""
    if isinstance(scene, Gltf):
        return scene.warnings
    if extension == "stl" and not is_text(content, extension):
        more = len(content) - 84 - 50 * int.from_bytes(content[80:84], "little")
        return [f"{more} bytes after the last triangle of {path.name} were left out"] if more > 0 else []
    if extension == "dae":
        unread = {
            rb"skew": "skews of {} were left out",
            rb"instance_controller": "skinned or morphed meshes of {} are read as bound, at their nodes",
            rb"ph": "polygons with holes of {} were left out",
        }
        return [
            said.format(path.name)
            for tag, said in unread.items()
            if re.search(rb"<([\w.-]+:)?" + tag + rb"[\s/>]", content)
        ]
    return []


def _read(path: Path) -> tuple[bytes, str, trimesh.Scene | Gltf]:
    """Parse a file: its content, format and scene; raises MeshFileError with the most likely reason."""
    # Opened here, not by name in the parser: a name that looks like a URL must never be fetched.
    try:
        content = read_file(path)
    except FileNotFoundError as error:
        raise MeshFileError(f"{path} does not exist: check the spelling and the folder") from error
    except IsADirectoryError as error:
        raise MeshFileError(f"{path} is a folder: give a mesh file in it") from error
    except (OSError, ValueError) as error:
        reason = getattr(error, "strerror", None) or str(error)
        raise MeshFileError(f"{path} cannot be opened ({reason}): check its name and permissions") from error
    if not content.strip(b"\0 \t\r\n"):
        raise MeshFileError(f"{path} is empty: export the mesh again")
    extension = path.suffix.lower().lstrip(".")
    holds = _format_of(content)
    if extension == "usdz" and holds == "3mf":  # both are archives
        holds = extension
    if extension not in FORMATS:
        renamed = f"rename it to .{holds}, which it seems to hold" if holds else None
        hint = CONVERTERS.get(extension) or renamed or "convert it to glb, obj, stl or ply"
        raise MeshFileError(f"{path} is in a format that rlacd does not read: {hint}")
    extension = "glb" if extension == "vrm" else extension  # a VRM file is a GLB file
    if (declared := declared_triangles(content, extension)) is not None:
        require_memory(declared, BYTES_READ, path.name)
    if is_text(content, extension):
        content = plain_text(content)
    named = extension  # a zae file is unpacked to a dae file
    beside = FolderFiles(path.parent)
    try:
        plain, extension = _checked(path, content, extension)
        scene = _parsed(path, plain, extension, beside)
    except Exception as error:  # parsers may raise anything on damaged files
        if holds and holds not in (extension, named):
            raise MeshFileError(f"{path} is not {extension} but {holds}: rename it to .{holds}") from error
        if isinstance(error, MeshFileError | MissingExtraError):
            raise
        if isinstance(error, MemoryError):
            raise MeshFileError(f"{path} takes more memory than there is: simplify the mesh first") from error
        # A missing module means that the parser tried an encoding no mesh has: that says nothing about the file.
        reason = (
            "" if isinstance(error, ImportError) else f" ({str(error).splitlines()[0][:200]})" if str(error) else ""
        )
        raise MeshFileError(
            f"{path} cannot be read as {extension}: it is damaged or cut off{reason}; export it again"
        ) from error
    if holds and holds not in (extension, named) and not scene.geometry:
        raise MeshFileError(f"{path} is not {extension} but {holds}: rename it to .{holds}")
    return plain if extension in ("dae", "3mf") else content, extension, scene


def _parsed(path: Path, content: bytes, extension: str, beside: FolderFiles) -> trimesh.Scene | Gltf:
    if extension in ("glb", "gltf"):
        return read_gltf(path, content, beside.get)
    if extension in USD:
        return usd_scene(path)
    if extension == "obj" and (objects := objects_of(content)) is not None:
        return objects
    return trimesh.load_scene(
        io.BytesIO(content),
        file_type=extension,
        resolver=beside,
        allow_remote=False,
        process=False,
        skip_materials=True,
    )


def _checked(path: Path, content: bytes, extension: str) -> tuple[bytes, str]:
    """Return the content to parse, in a form that is safe for the parser; raises MeshFileError."""
    match extension:
        case "3mf":
            return plain_3mf(path, content), extension
        case "dae" | "zae":
            return collada_of(path, content, extension), "dae"
        case "stl":
            return plain_stl(path, content), extension
        case "ply":
            return plain_ply(path, content), extension
        case "obj":
            return plain_obj(path, content), extension
        case "msh":
            return msh_as_ply(path, content), "ply"
        case "off":
            return plain_off(path, content), extension
        case _ if extension not in (*USD, "glb", "gltf"):
            check_text(path, content)
    return content, extension


def _format_of(content: bytes) -> str | None:
    """Guess the format of a file from its first bytes."""
    head = content[:4096].lstrip(b"\xef\xbb\xbf \t\r\n")
    if head.startswith(b"glTF"):
        return "glb"
    if head.startswith(b"ply\n") or head.startswith(b"ply\r"):
        return "ply"
    if head.startswith(b"PK\x03\x04"):
        known = {"usdz": b".usd" in head, "zae": b".dae" in content, "3mf": b".model" in content}
        return next((name for name, held in known.items() if held), None)
    if is_off(head):
        return "off"
    if head.startswith(b"<") and b"COLLADA" in head:
        return "dae"
    if head.startswith(b"{") and b'"asset"' in content:
        return "gltf"
    if len(content) >= 84 and len(content) == 84 + 50 * int.from_bytes(content[80:84], "little"):
        return "stl"
    if head.startswith(b"solid") and b"facet" in head:
        return "stl"
    lines = [line.split(None, 1)[0] for line in head.splitlines()[:-1] if line.strip()]
    if b"v" in lines and all(line in _OBJ_WORDS or line.startswith(b"#") for line in lines):
        return "obj"
    return None


_OBJ_WORDS = {b"v", b"vn", b"vt", b"vp", b"f", b"l", b"p", b"g", b"o", b"s", b"mtllib", b"usemtl"}


class _Baked(NamedTuple):
    """Triangles, and the node that places each."""

    vertices: FloatArray
    faces: IntArray
    nodes: tuple[SourceNode, ...] = ()
    node_of: IntArray | None = None


def _bake(source: trimesh.Trimesh | trimesh.Scene | trimesh.PointCloud | Gltf, name: str) -> _Baked:
    """Concatenate all triangles of a scene, with every instance transformed; if there are none, its points."""
    vertices: list[FloatArray] = []
    faces: list[IntArray] = []
    points: list[FloatArray] = []
    nodes: list[SourceNode] = []
    count = 0
    for node, geometry in _instances(source, name):
        if not isinstance(geometry, trimesh.Trimesh | trimesh.PointCloud | Triangles):
            continue
        v, f = _arrays(geometry.vertices, getattr(geometry, "faces", ()))
        if not np.array_equal(node.transform, np.eye(4)):
            with np.errstate(all="ignore"):  # what is not finite is left out, with a warning
                v = heights(v, node.transform[:3, :3]) + node.transform[:3, 3]
                f = f[:, ::-1] if np.linalg.det(node.transform[:3, :3]) < 0 else f
        if len(f) == 0:
            points.append(v)
            continue
        if f.min() < 0 or f.max() >= len(v):
            _raise_out_of_range(f, len(v))
        vertices.append(v)
        faces.append(f + count)
        nodes.append(node)
        count += len(v)
    if vertices:
        node_of = np.repeat(np.arange(len(nodes)), [len(f) for f in faces])
        return _Baked(np.concatenate(vertices), np.concatenate(faces), tuple(nodes), node_of)
    return _Baked(np.concatenate(points) if points else np.empty((0, 3)), np.empty((0, 3), dtype=np.int64))


def _instances(source: Any, name: str) -> Iterator[tuple[SourceNode, Any]]:
    """Yield each node and its geometry, once per instance."""
    if isinstance(source, Gltf):
        _require_few((geometry for _, geometry in source.geometry), name)
        yield from source.geometry
    elif not isinstance(source, trimesh.Scene):
        yield SourceNode("mesh", "mesh", np.eye(4)), source
    else:
        data = source.graph.transforms.node_data
        instances = [(node, source.geometry[data[node]["geometry"]]) for node in source.graph.nodes_geometry]
        _require_few((geometry for _, geometry in instances), name)
        placed = {source.graph.base_frame: np.eye(4)}
        for node, geometry in instances:
            yield SourceNode(str(node), node, _placed(source.graph, node, placed, name)), geometry


def _require_few(geometries: Iterable[Any], name: str) -> None:
    """Points count as well, at three for a triangle: it may be that no face uses them."""
    counts = (
        max(len(getattr(geometry, "faces", ())), len(getattr(geometry, "vertices", ())) // 3) for geometry in geometries
    )
    count = sum(counts)
    if count > MOST_TRIANGLES:
        raise MeshDataError(f"{name} places {count} triangles, more than {MOST_TRIANGLES}: simplify it first")


def _placed(graph: Any, node: Any, placed: dict[Any, FloatArray], name: str) -> FloatArray:
    """Return a node's transform [4, 4]; the transforms of its ancestors are multiplied only once."""
    chain: list[tuple[Any, Any]] = []
    at = node
    while at not in placed:
        parent = graph.transforms.parents.get(at)
        if parent is None:
            return _placed_otherwise(graph, node, name)
        chain.append((parent, at))
        if len(chain) > len(graph.transforms.parents):
            raise MeshDataError(f"the node {node!r:.80} of {name} is placed inside itself: export the scene again")
        at = parent
    for parent, child in reversed(chain):
        edge = graph.transforms.edge_data[parent, child]
        placed[child] = placed[parent] @ np.asarray(edge.get("matrix", np.eye(4)), dtype=np.float64)
    return placed[node]


def _placed_otherwise(graph: Any, node: Any, name: str) -> FloatArray:
    """Return the transform of a node that is not below the base: a scene in memory may have reversed edges."""
    try:
        return np.asarray(graph[node][0], dtype=np.float64)
    except ValueError as error:
        raise MeshDataError(
            f"the node {node!r:.80} of {name} has no place in its scene: export the scene again"
        ) from error


def _arrays(vertices: Any, faces: Any) -> tuple[FloatArray, IntArray]:
    """Check the shapes and dtypes of arrays; quads become two triangles each."""
    try:
        if np.iscomplexobj(vertices) or np.ma.is_masked(vertices) or np.ma.is_masked(faces):
            raise MeshDataError("vertices are complex, or vertices or faces are masked: give plain real arrays")
        v = np.asarray(vertices, dtype=np.float64)
        f = np.asarray(faces)
    except MeshDataError:
        raise
    except (TypeError, ValueError) as error:
        raise MeshDataError("vertices and faces must be rectangular arrays of numbers: [V, 3] and [F, 3]") from error
    v = v.reshape(-1, 3) if v.size == 0 else v
    f = f.reshape(-1, 3).astype(np.int64) if f.size == 0 else f
    if v.ndim != 2 or v.shape[1] != 3:
        raise MeshDataError(f"vertices have shape {list(v.shape)}, not [V, 3]: give one row of x, y, z per vertex")
    if f.ndim != 2 or f.shape[1] not in (3, 4):
        raise MeshDataError(f"faces have shape {list(f.shape)}, not [F, 3]: triangulate the polygons first")
    if not np.issubdtype(f.dtype, np.integer):
        raise MeshDataError(f"faces are {f.dtype}, not integers: give indices into the vertices, counted from 0")
    f = f.astype(np.int64)
    return v, (np.concatenate([f[:, [0, 1, 2]], f[:, [0, 2, 3]]]) if f.shape[1] == 4 else f)


def _raise_out_of_range(faces: IntArray, count: int) -> None:
    wrong = int(faces[(faces < 0) | (faces >= count)][0])
    raise MeshDataError(f"a face uses vertex {wrong} but there are {count} (counted from 0): the file is damaged")


def _clean(baked: _Baked, name: str) -> InputMesh:
    """Check the indices and drop faces and vertices that are not finite."""
    vertices, faces, nodes, node_of = baked
    if len(faces) and (faces.min() < 0 or faces.max() >= len(vertices)):
        _raise_out_of_range(faces, len(vertices))
    require_memory(len(faces), BYTES_READ, name)
    warnings = []
    finite: BoolArray = np.asarray(np.isfinite(vertices).all(axis=1))
    if not finite.all():
        usable = finite[faces].all(axis=1)
        if len(faces) and not usable.any():
            raise MeshDataError(f"every face of {name} uses a vertex that is NaN or infinite: export the mesh again")
        warnings.append(
            f"{int((~finite).sum())} vertices are NaN or infinite: they and the {int((~usable).sum())} faces that use "
            "them were left out"
        )
        faces = (np.cumsum(finite) - 1)[faces[usable]]
        node_of = None if node_of is None else node_of[usable]
        vertices = vertices[finite]
    if len(vertices) == 0:
        raise EmptyMeshError(f"{name} holds no points, so there is nothing to decompose: check the export")
    arrays = np.ascontiguousarray(vertices), np.ascontiguousarray(faces)
    return InputMesh(*arrays, name, tuple(warnings), nodes=nodes, node_of=node_of)
