"""From a file or an object in memory to one list of triangles.

Input: a path, a `trimesh.Trimesh` or `Scene`, or arrays. Output: an `InputMesh` whose vertices are finite and whose
faces are in range, in the input's own frame and unit. Parsing is trimesh's; this file decides what may be opened, bakes
scenes, and turns whatever goes wrong into one sentence.
"""

from __future__ import annotations

import io
import os
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any, TypeAlias

import numpy as np
import trimesh
from numpy.typing import ArrayLike
from trimesh.exchange.load import mesh_formats
from trimesh.resolvers import Resolver

from rlacd.errors import EmptyMeshError, MeshDataError, MeshFileError
from rlacd.solid.frame import FloatArray
from rlacd.solid.topology import BoolArray, IntArray

Source: TypeAlias = str | os.PathLike[str] | trimesh.Trimesh | trimesh.Scene | tuple[ArrayLike, ArrayLike]

# Triangles are all we need of a file: no colours, and no images, whose decoders are the riskier part of any loader.
_DATA_FILES = {".bin", ".gltf", ".glb", ".xml", ".model"}


@dataclass(frozen=True)
class InputMesh:
    """Triangles as they were given.

    Attributes
    ----------
    vertices
        float64 ``[V, 3]``, finite, in the input's unit. Those no face uses are kept.
    faces
        int64 ``[F, 3]``, in range; empty for a point cloud.
    name
        File name, or what kind of object was given.
    warnings
        What was left out.
    """

    vertices: FloatArray
    faces: IntArray
    name: str
    warnings: tuple[str, ...]


def load_mesh(source: Source) -> InputMesh:
    """Read a mesh of any format and bring all its bodies into one list of triangles.

    Parameters
    ----------
    source
        A path (obj, stl, ply, off, glb, gltf, dae, 3mf and whatever else trimesh reads), a mesh or scene of trimesh, or
        vertices ``[V, 3]`` with faces ``[F, 3]`` (or quads ``[F, 4]``). Scenes are baked: every instance of a geometry
        is placed by its transform. Paths and curves are ignored; point clouds give vertices without faces.

    Returns
    -------
    InputMesh

    Raises
    ------
    MeshFileError
        The file is missing, empty, cut off, or not what its name says.
    MeshDataError
        The arrays have the wrong shape, indices are out of range, or no face is finite.
    EmptyMeshError
        There is no point at all.
    """
    if isinstance(source, str | os.PathLike):
        path = Path(source)
        return _clean(*_bake(_read(path)), path.name)
    if isinstance(source, trimesh.Trimesh | trimesh.Scene | trimesh.PointCloud):
        return _clean(*_bake(source), type(source).__name__)
    if isinstance(source, tuple) and len(source) == 2:
        return _clean(*_arrays(*source), "arrays")
    raise MeshDataError(
        f"cannot take a mesh from {type(source).__name__}: give a path, a trimesh object, or a tuple (vertices, faces)"
    )


def _read(path: Path) -> trimesh.Scene:
    """Parse a file; raises MeshFileError with the likeliest reason."""
    # The content is opened here and not by name: a name that looks like an address must never be fetched.
    try:
        if path.is_dir():
            raise MeshFileError(f"{path} is a folder: give a mesh file in it")
        if not path.exists():
            raise MeshFileError(f"{path} does not exist: check the spelling and the folder")
        if not path.is_file():
            raise MeshFileError(f"{path} is not a regular file: save the mesh to a file first")
        content = path.read_bytes()
    except OSError as error:
        raise MeshFileError(f"{path} cannot be opened ({error.strerror}): check its name and permissions") from error
    if not content.strip(b"\0 \t\r\n"):
        raise MeshFileError(f"{path} is empty: export the mesh again")
    extension = path.suffix.lower().lstrip(".")
    holds = _format_of(content)
    if extension not in mesh_formats():
        hint = f"rename it to .{holds}, which it seems to hold" if holds else "convert it to glb, obj, stl or ply"
        raise MeshFileError(f"{path} has no mesh format's extension: {hint}")
    if extension == "stl" and holds in (None, "stl"):
        _check_stl_is_whole(path, content)
    try:
        scene = trimesh.load_scene(
            io.BytesIO(content),
            file_type=extension,
            resolver=_FolderResolver(path.parent),
            allow_remote=False,
            process=False,
            skip_materials=True,
        )
    except Exception as error:  # parsers of damaged files raise anything
        if holds and holds != extension:
            raise MeshFileError(f"{path} is not {extension} but {holds}: rename it to .{holds}") from error
        # A parser that misses a module was trying an encoding no mesh has: that says nothing about the file.
        reason = (
            "" if isinstance(error, ImportError) else f" ({str(error).splitlines()[0][:200]})" if str(error) else ""
        )
        raise MeshFileError(
            f"{path} cannot be read as {extension}: it is damaged or cut off{reason}; export it again"
        ) from error
    if extension == "off":
        _check_off_is_whole(path, content)
    if holds and holds != extension and not scene.geometry:
        raise MeshFileError(f"{path} is not {extension} but {holds}: rename it to .{holds}")
    return scene


def _check_stl_is_whole(path: Path, content: bytes) -> None:
    """Compare the length of a binary STL file with the count in its header; a short one would be read as text."""
    if b"\0" not in content[:512]:
        return
    count = int.from_bytes(content[80:84], "little")
    if len(content) < 84 + 50 * count:
        raise MeshFileError(f"{path} is cut off: its header promises {count} triangles; export it again")


def _check_off_is_whole(path: Path, content: bytes) -> None:
    """Compare the lines of an OFF file with the counts in its header, which the parser takes on trust."""
    lines = [line for line in (raw.split(b"#")[0].strip() for raw in content.splitlines()) if line]
    words = b" ".join(lines[:2]).replace(b"COFF", b" ").replace(b"OFF", b" ").split()
    body = len(lines) - (1 if len(lines[0].split()) > 2 else 2)
    counts = [int(word) for word in words[:2] if word.isdigit()]
    if len(counts) == 2 and body < sum(counts):
        promised = f"{counts[0]} vertices and {counts[1]} faces"
        raise MeshFileError(f"{path} is cut off: its header promises {promised}; export it again")


def _format_of(content: bytes) -> str | None:
    """Guess the format of a file from its first bytes."""
    head = content[:4096].lstrip(b"\xef\xbb\xbf \t\r\n")
    if head.startswith(b"glTF"):
        return "glb"
    if head.startswith(b"ply\n") or head.startswith(b"ply\r"):
        return "ply"
    if head.startswith(b"PK\x03\x04"):
        return "3mf"
    if head.startswith((b"OFF", b"COFF")):
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
    """Hands out data files of one folder and nothing else.

    A name that leads out of the folder, by ``..``, an absolute path or a link, does not exist for it; nor do images
    and material libraries.
    """

    def __init__(self, folder: Path) -> None:
        self._folder = folder.resolve()

    def get(self, name: str) -> bytes:
        """Return the content of a file in the folder."""
        path = (self._folder / str(name).strip()).resolve()
        if path.suffix.lower() not in _DATA_FILES or not path.is_relative_to(self._folder) or not path.is_file():
            raise FileNotFoundError(f"{name!r} is not a data file beside the mesh")
        return path.read_bytes()

    def write(self, name: str, data: Any) -> None:
        """Refuse: loading writes nothing."""
        raise PermissionError(name)

    def namespaced(self, namespace: str) -> _FolderResolver:
        """Refuse to leave the folder."""
        raise FileNotFoundError(namespace)

    def keys(self) -> Iterator[str]:
        """List nothing: files are asked for by name."""
        return iter(())


def _bake(source: trimesh.Trimesh | trimesh.Scene | trimesh.PointCloud) -> tuple[FloatArray, IntArray]:
    """Concatenate all triangles of a scene, every instance in its place; points are kept if there are no triangles."""
    vertices: list[FloatArray] = []
    faces: list[IntArray] = []
    points: list[FloatArray] = []
    count = 0
    for geometry, transform in _instances(source):
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


def _instances(source: Any) -> Iterator[tuple[Any, FloatArray | None]]:
    if not isinstance(source, trimesh.Scene):
        yield source, None
        return
    for node in source.graph.nodes_geometry:
        transform, name = source.graph[node]
        transform = np.asarray(transform, dtype=np.float64)
        yield source.geometry[name], None if np.array_equal(transform, np.eye(4)) else transform


def _arrays(vertices: Any, faces: Any) -> tuple[FloatArray, IntArray]:
    """Check the shapes and kinds of arrays; quads become two triangles each."""
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
    """Check the indices and drop what is not finite."""
    if len(faces) and (faces.min() < 0 or faces.max() >= len(vertices)):
        _raise_out_of_range(faces, len(vertices))
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
