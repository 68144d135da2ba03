"""Hulls as files: GLB, OBJ, PLY, STL, a folder with one file per hull, or a model for a simulator or an engine."""

from __future__ import annotations

import os
import re
import warnings
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import trimesh

from rlacd.errors import ImplausibleBodyWarning, OutputError
from rlacd.io.read import function_of
from rlacd.io.write.atomic import write_file
from rlacd.io.write.encode import ENCODERS, ENGINE_NAMES, encode_glb, encode_obj, hull_name
from rlacd.io.write.folder import write_folder
from rlacd.io.write.model import (
    MeshFile,
    RigidBody,
    hollow,
    implausible,
    model_of,
    node_name,
    shapes_of,
    visuals_of,
)
from rlacd.io.write.target import FORMATS, MODELS, WITH_MESHES, Target, hull_target, mesh_folder
from rlacd.options.output import OutputOptions
from rlacd.result import Result

__all__ = ["FORMATS", "MODELS", "file_stem", "hull_target", "save", "write_file"]

SIMULATED = (*WITH_MESHES, "usd")
"""Formats whose readers take lengths to be in metres."""


def save(result: Result, path: str | os.PathLike[str], **options: Any) -> Path:
    """Write a decomposition, with the options of `rlacd.Decomposition.save`.

    Raises
    ------
    OutputError, OptionError
        As for `hull_target` and `model_of`, and if the disk fails while writing.
    MissingExtraError
        The format needs an extra that is not installed.
    """
    asked = OutputOptions(**options)
    target = hull_target(path, asked)
    ending = target.path.suffix.lower().lstrip(".")
    unused = [name for name in ("density", "mass") if getattr(asked, name) is not None]
    if unused and target.file_type not in SIMULATED:
        warnings.warn(f"{unused[0]} had no effect: {target.path.name} holds no mass", UserWarning, stacklevel=3)
    if (data := _with_scene(result, target.file_type, ending, bool(asked.keep_input))) is not None:
        write_file(target.path, data)
        return target.path
    if target.file_type not in MODELS:
        return _save_hulls(result.hulls, target, result.name)
    model = model_of(result, asked)
    if target.file_type in SIMULATED:
        for doubt in (implausible(model), None if asked.mass is not None else hollow(result)):
            if doubt is not None:
                warnings.warn(doubt, ImplausibleBodyWarning, stacklevel=3)
    if target.file_type in WITH_MESHES:
        _save_with_meshes(result, replace(model, is_scene=bool(asked.scene)), target, bool(asked.one_mesh))
    elif target.file_type == "usd":
        write_file(target.path, function_of("write.usd:encode_usd")(model, ending))
    else:
        write_file(target.path, _for_engine(model, target.file_type, ending))
    return target.path


def _with_scene(result: Result, file_type: str, ending: str, keep_input: bool) -> bytes | None:
    """GLB of the input's own scene with its hulls; None if something else is to be written.

    With `keep_input`, an input without a scene is the triangles in grey.
    """
    has_scene, kept = result.input is not None and result.input.asset is not None, "write.keep:encode_kept"
    if ending == "glb" and has_scene and file_type in ENGINE_NAMES:
        return bytes(function_of(kept)(result, ENGINE_NAMES[file_type], colored=False))
    if not keep_input or not result.hulls:
        return None
    if has_scene:
        return bytes(function_of(kept)(result, lambda name, index, _: f"{name}_{hull_name(index)}", colored=True))
    visual = (node_name(result.name), result.source) if len(result.source.faces) else None
    return encode_glb(result.hulls, visual=visual)


def _for_engine(model: RigidBody, engine: str, ending: str) -> bytes:
    """The input as one node, and the hulls named for the engine, which makes an asset of every material of theirs."""
    name = node_name(model.name)
    names = [ENGINE_NAMES[engine](name, index, primitive) for index, primitive in enumerate(model.primitives)]
    encode = encode_glb if ending == "glb" else encode_obj
    return encode(model.hulls, names, None if model.visual is None else (name, model.visual), colored=False)


def _save_with_meshes(result: Result, model: RigidBody, target: Target, one_mesh: bool) -> None:
    folder, stem = mesh_folder(target.path, target.file_type), file_stem(model.name)
    shapes = shapes_of(model, stem, MODELS[target.file_type].primitives, one_mesh=one_mesh)
    mjcf = target.file_type == "mjcf"
    visuals = visuals_of(model, stem, function_of("write.converted:painted_parts")(result.input) if mjcf else ())
    meshes = [shape for shape in (*visuals, *shapes) if isinstance(shape, MeshFile)]
    files = {file.name: file.data for file in meshes}
    files |= {file.picture_name: file.look.picture for file in meshes if file.look and file.look.picture}
    encode = function_of(f"write.simulators:encode_{target.file_type}")
    described = encode(model, shapes, visuals, folder.name)
    write_folder(folder, stem, files, then=lambda: write_file(target.path, described))


def _save_hulls(hulls: Sequence[trimesh.Trimesh], target: Target, stem: str) -> Path:
    if not hulls:
        raise OutputError("there are no hulls to write; decompose a mesh first.")
    encode = ENCODERS[target.file_type]
    if target.is_folder:
        stem = file_stem(stem)
        files = {f"{stem}_{i:03d}.{target.file_type}": encode([hull]) for i, hull in enumerate(hulls)}
        write_folder(target.path, stem, files)
    else:
        write_file(target.path, encode(hulls))
    return target.path


def file_stem(name: str) -> str:
    """Make a valid file name of any name: some names are not allowed, and the length limit is in bytes."""
    plain = re.sub(r'[\x00-\x1f/\\:*?"<>|]', "_", name).strip(". ")
    return plain.encode(errors="replace")[:150].decode(errors="ignore").strip(". ") or "mesh"
