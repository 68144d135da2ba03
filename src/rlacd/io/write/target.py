"""Output path and format: decided and checked before any work begins."""

from __future__ import annotations

import os
import re
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import NamedTuple

from rlacd.errors import OptionError, OutputError
from rlacd.io.read import function_of
from rlacd.io.write.atomic import output_errors, refuse_link
from rlacd.options.fields import path_like, read, shown
from rlacd.options.names import PRIMITIVE_KINDS, PrimitiveKind
from rlacd.options.output import OutputOptions
from rlacd.options.presets import find_preset

FORMATS = ("glb", "obj", "ply", "stl")
"""Formats of hulls only; also those of the files in a folder. Each has an encoder in `rlacd.io.write.encode`."""


class Model(NamedTuple):
    """A format of hulls with their mesh, for a simulator or an engine."""

    label: str
    reader: str
    """The programs that read it."""
    endings: tuple[str, ...]
    with_meshes: bool = False
    """Whether it refers to mesh files beside it."""
    primitives: tuple[PrimitiveKind, ...] = ()
    """Those that it holds in place of hulls."""


MODELS = {
    "mjcf": Model("MJCF", "MuJoCo", ("xml",), True, PRIMITIVE_KINDS),
    # Many readers of URDF refuse a file with a capsule.
    "urdf": Model("URDF", "ROS, Bullet and most robot simulators", ("urdf",), True, ("sphere", "box", "cylinder")),
    "sdf": Model("SDF", "Gazebo", ("sdf",), True, PRIMITIVE_KINDS),
    "usd": Model("USD", "Isaac Sim and PhysX", ("usd", "usda", "usdc")),
    "unreal": Model("Unreal", "Unreal Engine", ("glb", "obj")),
    "godot": Model("Godot", "Godot", ("glb",)),
}

MODEL_OF = {ending: name for name, model in MODELS.items() for ending in model.endings if ending not in FORMATS}

_UNWRITABLE = re.compile("[\x00-\x1f\x7f\ud800-\udfff\ufffe\uffff]")

WITH_MESHES = tuple(name for name, model in MODELS.items() if model.with_meshes)

FOLDER_FORMAT = "obj"
SEPARATORS = tuple(mark for mark in (os.sep, os.altsep) if mark)


@dataclass(frozen=True)
class Target:
    """A checked output: one file, or a folder with one file per hull."""

    path: Path
    """The file or folder."""
    file_type: str
    """One of `FORMATS` or of `MODELS`."""
    is_folder: bool
    """Whether `path` is a folder."""


def hull_target(path: str | os.PathLike[str], asked: OutputOptions | None = None) -> Target:
    """Interpret `path` as `Decomposition.save` does and check that it can be written to, with what is asked for.

    Raises
    ------
    OutputError
        No permission, or a folder where a file is expected or the reverse.
    OptionError
        There is no name, or its ending is unknown; a format is unknown, or given for a single file with another ending;
        or something is asked for that the format does not know.
    """
    asked = asked or OutputOptions()
    target = _target(read(path_like(), "path", path), asked.file_type)
    is_glb = not target.is_folder and target.path.suffix.lower() == ".glb"
    for name, only, fits in (
        ("one_mesh", ".urdf", target.file_type == "urdf"),
        ("scene", ".xml (MJCF)", target.file_type == "mjcf"),
        ("keep_input", ".glb", is_glb),
    ):
        if getattr(asked, name) and not fits:
            flag = name.replace("_", "-")
            raise OptionError(f"{name} (--{flag}) works for {only} files only: leave it out, or write a {only} file.")
    return target


def file_kind(file_type: str | None, preset: str | None) -> tuple[str, str | None]:
    """The ending of a file, and its format where one was asked for: by its name, by the preset, or GLB."""
    if file_type is not None:
        return f".{ending_of(file_type)}", file_type
    engine = None if preset is None else find_preset(preset)
    return (".glb", None) if engine is None else (engine.ending, engine.file_type)


def ending_of(file_type: str) -> str:
    """The ending of a file of some format."""
    return MODELS[file_type].endings[0] if file_type in MODELS else file_type


def _target(text: str, wanted: str | None) -> Target:
    if not text:
        raise OptionError("the output has no name; give a file such as hulls.glb, or a folder such as hulls/.")
    place = Path(text)
    ending = place.suffix.lower().lstrip(".")
    if wanted is None and ending in MODEL_OF and not text.endswith(SEPARATORS):
        wanted = ending
    if (wanted := MODEL_OF.get(str(wanted), wanted)) in MODELS:
        return _model_target(text, str(wanted))
    if wanted not in (None, *FORMATS):
        raise OptionError(f"unknown format {wanted!r}; use one of {', '.join((*FORMATS, *MODELS))}.")

    with output_errors(place):
        is_folder = text.endswith(SEPARATORS) or (place.is_dir() and ending not in FORMATS) or (wanted and not ending)
        if is_folder:
            check_folder(place)
            return Target(place, wanted or FOLDER_FORMAT, is_folder=True)

    if ending not in FORMATS:
        known = ", ".join(f".{name}" for name in (*FORMATS, *MODEL_OF))
        said = f"whose ending is .{ending}" if ending else "which has no ending"
        said += " (files for MuJoCo end in .xml)" if ending == "mjcf" else ""
        raise OptionError(f"cannot write {shown(str(place))}, {said}; use one of {known}, or a name ending in /.")
    if wanted not in (None, ending):
        raise OptionError(f"the format {wanted} contradicts the name {shown(str(place))}; give one of the two.")
    check_file(place)
    return Target(place, ending, is_folder=False)


def mesh_folder(path: Path, file_type: str) -> Path:
    """Return the folder of a multi-file model's meshes: ``chair_urdf`` for ``chair.urdf``.

    The format is part of the name, so that two models of one body do not overwrite each other's meshes.
    """
    return path.with_name(f"{path.stem}_{file_type}")


def check_name(path: Path) -> None:
    """Raise OptionError if a file's name cannot be written in XML, since its mesh folder is named after it."""
    if _UNWRITABLE.search(path.name):
        raise OptionError(f"cannot write {str(path)!r}: XML cannot hold its name; choose another name.")


def _model_target(text: str, file_type: str) -> Target:
    place = Path(text)
    endings = [f".{ending}" for ending in MODELS[file_type].endings]
    if text.endswith(SEPARATORS) or place.suffix.lower() not in endings:
        raise OptionError(f"{file_type} needs a file whose name ends in {' or '.join(endings)}, not {text}.")
    check_file(place)
    if file_type == "usd":
        function_of("write.usd:require_usd")()
    if file_type in WITH_MESHES:
        check_name(place)
        check_folder(mesh_folder(place, file_type))
    return Target(place, file_type, is_folder=False)


def check_file(path: Path) -> None:
    """Raise `OutputError` if `path` cannot become a file, without touching the disk."""
    with output_errors(path):
        refuse_link(path)
        if path.is_dir():
            raise OutputError(f"cannot write {path}: it is a folder; end the name with / to fill it.")
        if path.exists() and not path.is_file():
            raise OutputError(f"cannot write {path}: it is not an ordinary file; choose another name.")
        _check_parent(path)


def checked_place(path: str | os.PathLike[str], what: str, endings: Sequence[str]) -> Path:
    """Check, before any work, that a file with one of some endings can be written, the first of which is named.

    Raises
    ------
    OptionError
        The ending is another.
    OutputError
        The place cannot be written to.
    """
    place = Path(read(path_like(), "path", path))
    if place.suffix.lower() not in endings:
        known = " or ".join(filter(None, (", ".join(endings[:-1]), endings[-1])))
        raise OptionError(f"cannot write {what} {shown(str(place))}: it must end in {known}; rename it.")
    check_file(place)
    return place


def check_folder(folder: Path) -> None:
    """Raise `OutputError` if `folder` cannot be filled, without touching the disk."""
    if folder.is_dir():
        if not os.access(folder, os.W_OK | os.X_OK):
            raise OutputError(f"cannot write into {folder}: you may not; choose another place.")
    elif folder.exists() and not folder.is_dir():  # another run's may have appeared between the two questions
        raise OutputError(f"cannot write into {folder}: it is a file, not a folder; choose another name.")
    else:
        _check_parent(folder)


def _check_parent(path: Path) -> None:
    # resolve() follows a link to the actual target. Missing folders are created with the file.
    parent = path.resolve().parent
    while not parent.exists() and parent != parent.parent:
        parent = parent.parent
    if not parent.is_dir():
        raise OutputError(f"cannot write {path}: {parent} is a file, not a folder; choose another name.")
    if not os.access(parent, os.W_OK | os.X_OK):
        raise OutputError(f"cannot write {path}: you may not write to {parent}; choose another place.")
