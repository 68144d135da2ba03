"""From a file or an object in memory to one list of triangles.

Input: a path, a `trimesh.Trimesh` or `Scene`, or arrays. Output: an `InputMesh` whose vertices are finite and whose
faces are in range, in the input's own frame and unit. A reader for each format parses; this module decides what may be
opened, bakes scenes, and turns every failure into one sentence.
"""

from __future__ import annotations

import os
from dataclasses import replace
from pathlib import Path
from typing import IO, Any, TypeAlias

import numpy as np
import trimesh
from numpy.typing import ArrayLike

from rlacd.errors import EmptyMeshError, MeshDataError, MeshError, MeshFileError, MissingExtraError, OptionError
from rlacd.io.read import CURVED, READERS, function_of
from rlacd.io.read.contents import USUAL, Contents, Fineness, damaged, one_shape, require_few, without_engine_hulls
from rlacd.io.read.in_memory import is_in_memory, opened
from rlacd.io.read.open_file import CONVERTERS, NO_MESHES, format_of, read_named
from rlacd.memory import BYTES_READ, require_memory
from rlacd.options.fields import shown
from rlacd.options.names import mesh_name
from rlacd.solid.arrays import BoolArray, FloatArray, Int64Array, heights
from rlacd.solid.input_mesh import Asset, InputMesh, no_points

Source: TypeAlias = (
    "str | os.PathLike[str] | trimesh.Trimesh | trimesh.Scene | list[trimesh.Trimesh] | tuple[ArrayLike, ArrayLike]"
    " | ArrayLike | IO[bytes]"
)


def load_mesh(
    source: Source, faces: ArrayLike | None = None, file_type: str | None = None, fineness: Fineness = USUAL
) -> InputMesh:
    """Read a mesh of any format and bring all its bodies into one list of triangles.

    Parameters
    ----------
    source
        A path, a mesh or scene of trimesh, a list of meshes, a file that is open in binary mode or its bytes, or
        vertices ``[V, 3]`` with faces ``[F, 3]`` (or quads ``[F, 4]``). Scenes are baked: every instance of a geometry
        is placed by its transform. Paths and curves are ignored; point clouds give vertices without faces. Nodes of a
        scene that are hulls for an engine, by their names, are left out with a warning if there are others.
    faces
        Of vertices that are the source.
    file_type
        The format of an open file or of bytes, where neither its name nor its content tells it.
    fineness
        How near the triangles of a file of curved surfaces have to be to them.

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
        The extra that reads the file is not installed: ``fbx``, ``usd``, ``cad`` for STEP and IGES, ``draco``.
    """
    if faces is not None:
        if isinstance(source, str | os.PathLike | trimesh.Trimesh | trimesh.Scene | trimesh.PointCloud):
            raise MeshDataError(
                f"{shown(faces)} is given where faces go, after vertices: give options by their names, such as "
                "threshold=0.05"
            )
        source = (source, faces)
    if is_in_memory(source):
        with opened(source, file_type) as place:
            return load_mesh(place)
    if file_type is not None:
        raise OptionError(f"file_type is {shown(file_type)}; it has to be left out, except for an open file or bytes.")
    if isinstance(source, os.PathLike):
        source = os.fspath(source)  # bytes are refused below
    if isinstance(source, str):
        path = Path(source)
        return without_engine_hulls(_baked(path.name, _read(path, fineness)))
    if isinstance(source, list | tuple) and source and all(isinstance(one, trimesh.Trimesh) for one in source):
        source = trimesh.Scene(source)
    arrays_of, geometry_of = (function_of(f"read.trimesh_scene:{name}") for name in ("arrays_of", "geometry_of"))
    if isinstance(source, trimesh.Trimesh | trimesh.Scene | trimesh.PointCloud):
        kind, looks = (
            mesh_name(source, type(source).__name__),
            hasattr(source, "geometry") or getattr(source, "visual", None),
        )
        asset = Asset(source) if looks is True or getattr(looks, "defined", False) else None
        contents = Contents(geometry_of(source, kind), asset=asset, metres=_metres(source))
        return without_engine_hulls(_baked(kind, contents))
    if isinstance(source, tuple) and len(source) == 2:
        return replace(_baked("arrays", Contents(one_shape("arrays", *arrays_of(*source)))), nodes=(), node_of=None)
    raise MeshDataError(
        f"cannot take a mesh from {type(source).__name__}: give a path, an open file, vertices and faces, or a trimesh "
        "object or a list of them"
    )


def _metres(source: Any) -> float | None:
    """How many metres the unit is that a trimesh object states; None if it states none that is known."""
    try:
        return None if source.units is None else float(trimesh.units.unit_conversion(source.units, "meters"))
    except (KeyError, ValueError):
        return None


def _read(path: Path, fineness: Fineness) -> Contents:
    """Parse a file; raises MeshFileError with the most likely reason."""
    content = read_named(path)  # here, not by name in a parser: a name like a URL must not be fetched
    if not content.strip(b"\0 \t\r\n"):
        raise MeshFileError(f"{path} is empty: export the mesh again")
    for mark, said in NO_MESHES.items():
        if content[:99].lower().startswith(mark):
            raise MeshFileError(f"{path} {said}")
    holds, extension = format_of(content), path.suffix.lower().lstrip(".")
    if extension == "usdz" and holds == "3mf":  # both are archives
        holds = extension
    as_named = holds in (None, {"vrm": "glb", "stp": "step"}.get(extension, extension))
    renamed = None if as_named else f"rename it to .{holds}"
    if extension not in READERS:
        hint = f"{renamed}, which it seems to hold" if renamed else "convert it to glb, obj, stl or ply"
        raise MeshFileError(f"{path} is in a format that rlacd does not read: {CONVERTERS.get(extension, hint)}")
    try:
        how = (fineness,) if extension in CURVED else ()
        contents: Contents = function_of(READERS[extension])(path, content, *how)
    except Exception as error:  # parsers may raise anything on damaged files
        if renamed:
            raise MeshFileError(f"{path} is not {extension} but {holds}: {renamed}") from error
        if isinstance(error, MeshError | MissingExtraError):
            raise
        if isinstance(error, MemoryError):
            raise MeshFileError(f"{path} takes more memory than there is: simplify the mesh first") from error
        if isinstance(error, FileNotFoundError):
            raise MeshFileError(f"{path} refers to {error}") from error
        # A missing module means that the parser tried an encoding no mesh has: that says nothing about the file.
        why = f"{error} is missing" if isinstance(error, KeyError) else str(error)
        raise damaged(path, extension, "" if isinstance(error, ImportError) else why) from error
    if renamed and not any(len(shape.vertices) for _, shape in contents.geometry):
        raise MeshFileError(f"{path} is not {extension} but {holds}: {renamed}")
    return contents


def _baked(name: str, contents: Contents) -> InputMesh:
    """Bring all triangles into the coordinates of the scene; if there are none, its points."""
    require_few(((shape.faces, shape.vertices) for _, shape in contents.geometry), name)
    solid = any(len(shape.faces) for _, shape in contents.geometry)
    vertices, faces = [np.empty((0, 3))], [np.empty((0, 3), dtype=np.int64)]
    nodes, count = [], 0
    for node, (v, f) in contents.geometry:
        if len(f) and (f.min() < 0 or f.max() >= len(v)):
            wrong = int(f[(f < 0) | (f >= len(v))][0])
            from_one = f.min() == 1 and f.max() == len(v)
            why = "count them from 0, not 1" if from_one else "the mesh is damaged"
            raise MeshDataError(f"a face uses vertex {wrong}, but there are {len(v)} (counted from 0): {why}")
        if solid and not len(f):
            continue
        if not np.array_equal(node.transform, np.eye(4)):
            with np.errstate(all="ignore"):  # what is not finite is left out, with a warning
                v = heights(v, node.transform[:3, :3]) + node.transform[:3, 3]
                f = f[:, ::-1] if np.linalg.det(node.transform[:3, :3]) < 0 else f
        vertices.append(v)
        faces.append(f + count)
        nodes += [node] * solid
        count += len(v)
    node_of = np.repeat(np.arange(len(nodes)), [len(f) for f in faces[1:]]) if solid else None
    mesh = _usable(name, np.concatenate(vertices), np.concatenate(faces), node_of)
    if len(mesh.vertices) == 0:
        why = f" ({'; '.join(contents.warnings)})" if contents.warnings else ""
        raise EmptyMeshError(f"{name} holds no triangles and no points{why}: check the export")
    mesh = replace(mesh, warnings=(*mesh.warnings, *contents.warnings), nodes=tuple(nodes))
    mesh = replace(mesh, asset=contents.asset, deviation=contents.deviation)
    return replace(mesh, up=contents.up, metres=contents.metres)


def _usable(name: str, vertices: FloatArray, faces: Int64Array, node_of: Int64Array | None) -> InputMesh:
    """Drop faces and vertices that are not finite, and faces that are a single point, unless all are."""
    require_memory(len(faces), BYTES_READ, name)
    warnings = []
    finite: BoolArray = np.asarray(np.isfinite(vertices).all(axis=1))
    if not finite.all():
        usable = finite[faces].all(axis=1)
        if len(faces) and not usable.any():
            raise MeshDataError(f"every face of {name} uses a vertex that is NaN or infinite: correct its coordinates")
        bad, unusable = np.count_nonzero(~finite), np.count_nonzero(~usable)
        warnings = [f"{bad} vertices are NaN or infinite: they and the {unusable} faces that use them were left out"]
        faces = (np.cumsum(finite) - 1)[faces[usable]]
        node_of = None if node_of is None else node_of[usable]
        vertices = vertices[finite]
    first = vertices[faces[:, 0]]  # a node of scale 0, a way to hide it, must not stretch the box of the others
    speck = (first == vertices[faces[:, 1]]).all(axis=1) & (first == vertices[faces[:, 2]]).all(axis=1)
    specks = no_points()
    if speck.any() and not speck.all():
        specks = first[speck]
        faces, node_of = faces[~speck], None if node_of is None else node_of[~speck]
    arrays = np.ascontiguousarray(vertices), np.ascontiguousarray(faces)
    return InputMesh(*arrays, name, tuple(warnings), node_of=node_of, specks=specks)
