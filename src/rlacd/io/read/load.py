"""From a file or an object in memory to one list of triangles.

Input: a path, a `trimesh.Trimesh` or `Scene`, or arrays. Output: an `InputMesh` whose vertices are finite and whose
faces are in range, in the input's own frame and unit. trimesh parses; this module decides what may be opened, bakes
scenes, and turns every failure into one sentence.
"""

from __future__ import annotations

import io
import os
from collections.abc import Iterator
from pathlib import Path
from typing import Any, TypeAlias
from urllib.parse import unquote

import numpy as np
import trimesh
from numpy.typing import ArrayLike
from trimesh.resolvers import Resolver

from rlacd.errors import EmptyMeshError, MeshDataError, MeshFileError
from rlacd.io.read.gltf import plain_gltf
from rlacd.io.read.limits import MOST_TRIANGLES
from rlacd.io.read.off import is_off, plain_off
from rlacd.io.read.open_file import LARGEST, read_file
from rlacd.io.read.text import check_text, declared_triangles, plain_obj, plain_ply, plain_stl
from rlacd.io.read.xml import check_3mf, collada_of
from rlacd.memory import BYTES_READ, require_memory
from rlacd.solid.frame import FloatArray
from rlacd.solid.input_mesh import InputMesh
from rlacd.solid.topology import BoolArray, IntArray

Source: TypeAlias = str | os.PathLike[str] | trimesh.Trimesh | trimesh.Scene | tuple[ArrayLike, ArrayLike]

FORMATS = ("obj", "stl", "ply", "off", "glb", "gltf", "dae", "zae", "3mf", "xyz")
"""The formats that are read. trimesh parses more, but those parsers have not been reviewed against hostile files."""

# Only triangles are needed: no colours, and no images, whose decoders are the riskier part of any loader.
_DATA_FILES = {".bin"}


def load_mesh(source: Source) -> InputMesh:
    """Read a mesh of any format and bring all its bodies into one list of triangles.

    Parameters
    ----------
    source
        A path (obj, stl, ply, off, glb, gltf, dae, zae, 3mf, xyz), a mesh or scene of trimesh, or vertices ``[V, 3]``
        with faces ``[F, 3]`` (or quads ``[F, 4]``). Scenes are baked: every instance of a geometry is placed by its
        transform. Paths and curves are ignored; point clouds give vertices without faces.

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
    """
    if isinstance(source, str | os.PathLike):
        path = Path(source)
        return _clean(*_bake(_read(path), path.name), path.name)
    if isinstance(source, trimesh.Trimesh | trimesh.Scene | trimesh.PointCloud):
        kind = type(source).__name__
        return _clean(*_bake(source, kind), kind)
    if isinstance(source, tuple) and len(source) == 2:
        return _clean(*_arrays(*source), "arrays")
    raise MeshDataError(
        f"cannot take a mesh from {type(source).__name__}: give a path, a trimesh object, or a tuple (vertices, faces)"
    )


def _read(path: Path) -> trimesh.Scene:
    """Parse a file; raises MeshFileError with the most likely reason."""
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
    if extension not in FORMATS:
        hint = f"rename it to .{holds}, which it seems to hold" if holds else "convert it to glb, obj, stl or ply"
        raise MeshFileError(f"{path} is in no format that is read here: {hint}")
    if (declared := declared_triangles(content, extension)) is not None:
        require_memory(declared, BYTES_READ, path.name)
    beside = _FolderResolver(path.parent)
    try:
        content, extension = _checked(path, content, extension, beside)
        scene = trimesh.load_scene(
            io.BytesIO(content),
            file_type=extension,
            resolver=beside,
            allow_remote=False,
            process=False,
            skip_materials=True,
        )
    except Exception as error:  # parsers may raise anything on damaged files
        if holds and holds != extension:
            raise MeshFileError(f"{path} is not {extension} but {holds}: rename it to .{holds}") from error
        if isinstance(error, MeshFileError):
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
    if holds and holds != extension and not scene.geometry:
        raise MeshFileError(f"{path} is not {extension} but {holds}: rename it to .{holds}")
    return scene


def _checked(path: Path, content: bytes, extension: str, beside: _FolderResolver) -> tuple[bytes, str]:
    """Return the content to parse, in a form that is safe for the parser; raises MeshFileError."""
    match extension:
        case "gltf" | "glb":
            return plain_gltf(path, content, beside.get), extension
        case "3mf":
            check_3mf(path, content)
        case "dae" | "zae":
            return collada_of(path, content, extension), "dae"
        case "stl":
            return plain_stl(path, content), extension
        case "ply":
            return plain_ply(path, content), extension
        case "obj":
            return plain_obj(path, content), extension
        case "off":
            return plain_off(path, content), extension
        case _:
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
        return "zae" if b".dae" in content else "3mf"
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


class _FolderResolver(Resolver):  # type: ignore[misc]
    """Serves data files of one folder only.

    A name that leads out of the folder, by ``..``, an absolute path or a link, counts as missing; so do images and
    material libraries.
    """

    def __init__(self, folder: Path) -> None:
        self._folder = folder.resolve()
        self._read: dict[Path, bytes] = {}

    def get(self, name: str) -> bytes:
        """Return the content of a file in the folder, cached, since a file may be named any number of times.

        Raises
        ------
        FileNotFoundError
            There is no such file, or it may not be read.
        """
        for spelled in dict.fromkeys((name, unquote(name))):
            try:
                path = (self._folder / spelled.strip()).resolve()
                if path.suffix.lower() not in _DATA_FILES or not path.is_relative_to(self._folder):
                    continue
                if path not in self._read:
                    self._read[path] = read_file(path, LARGEST - sum(map(len, self._read.values())))
            except (OSError, ValueError, RuntimeError):  # a name with a NUL, circular links
                continue
            return self._read[path]
        raise FileNotFoundError(f"{name!r:.200} is not a data file beside the mesh")

    def write(self, name: str, data: Any) -> None:
        """Refuse: loading writes nothing."""
        raise PermissionError(name)

    def namespaced(self, namespace: str) -> _FolderResolver:
        """Stay in the same folder."""
        raise FileNotFoundError(namespace)

    def keys(self) -> Iterator[str]:
        """List nothing: files are asked for by name."""
        return iter(())


def _bake(source: trimesh.Trimesh | trimesh.Scene | trimesh.PointCloud, name: str) -> tuple[FloatArray, IntArray]:
    """Concatenate all triangles of a scene, with every instance transformed; if there are none, its points."""
    vertices: list[FloatArray] = []
    faces: list[IntArray] = []
    points: list[FloatArray] = []
    count = 0
    for geometry, transform in _instances(source, name):
        if isinstance(geometry, trimesh.Trimesh):
            v, f = _arrays(geometry.vertices, geometry.faces)
            if transform is not None:
                v = v @ transform[:3, :3].T + transform[:3, 3]
                if np.linalg.det(transform[:3, :3]) < 0:
                    f = f[:, ::-1]
            if len(f) == 0:
                points.append(v)
                continue
            if f.min() < 0 or f.max() >= len(v):
                _raise_out_of_range(f, len(v))
            vertices.append(v)
            faces.append(f + count)
            count += len(v)
        elif isinstance(geometry, trimesh.PointCloud):
            v, _ = _arrays(geometry.vertices, [])
            points.append(v if transform is None else v @ transform[:3, :3].T + transform[:3, 3])
    if vertices:
        return np.concatenate(vertices), np.concatenate(faces)
    return (np.concatenate(points) if points else np.empty((0, 3))), np.empty((0, 3), dtype=np.int64)


def _instances(source: Any, name: str) -> Iterator[tuple[Any, FloatArray | None]]:
    """Yield each geometry of a scene with its transform, None for the identity, once per instance."""
    if not isinstance(source, trimesh.Scene):
        yield source, None
        return
    data = source.graph.transforms.node_data
    instances = [(node, source.geometry[data[node]["geometry"]]) for node in source.graph.nodes_geometry]
    count = sum(len(getattr(geometry, "faces", ())) for _, geometry in instances)
    if count > MOST_TRIANGLES:
        raise MeshDataError(f"{name} places {count} triangles, more than {MOST_TRIANGLES}: simplify it first")
    placed = {source.graph.base_frame: np.eye(4)}
    for node, geometry in instances:
        transform = _placed(source.graph, node, placed, name)
        yield geometry, None if np.array_equal(transform, np.eye(4)) else transform


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
            raise MeshDataError(f"the node {node!r:.80} of {name} is placed in itself: export the scene again")
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
        raise MeshDataError(f"the node {node!r:.80} of {name} is placed nowhere: export the scene again") from error


def _arrays(vertices: Any, faces: Any) -> tuple[FloatArray, IntArray]:
    """Check the shapes and dtypes of arrays; quads become two triangles each."""
    try:
        v = np.asarray(vertices, dtype=np.float64)
        f = np.asarray(faces)
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


def _clean(vertices: FloatArray, faces: IntArray, name: str) -> InputMesh:
    """Check the indices and drop faces and vertices that are not finite."""
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
        vertices = vertices[finite]
    if len(vertices) == 0:
        raise EmptyMeshError(f"{name} holds no points, so there is nothing to decompose: check the export")
    return InputMesh(np.ascontiguousarray(vertices), np.ascontiguousarray(faces), name, tuple(warnings))
