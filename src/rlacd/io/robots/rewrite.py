"""Rewriting a robot: plan from the file, decompose each solid once, write hulls and file."""

from __future__ import annotations

import os
import time
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from rlacd.decomposition import Decomposition
from rlacd.errors import OptionError
from rlacd.io.read.contents import Triangles
from rlacd.io.robots import usd
from rlacd.io.robots.bodies import Body, Collider, Surface
from rlacd.io.robots.clearance import decomposed_robot
from rlacd.io.robots.decomposed import check_options
from rlacd.io.robots.matrix import chosen, excludes
from rlacd.io.robots.matrix import srdf as srdf_of
from rlacd.io.robots.mjcf_model import mujoco_reads
from rlacd.io.robots.read import kind_of, left_behind, opened, planned, robot_of_file, robot_of_stage
from rlacd.io.robots.references import References
from rlacd.io.robots.rewritten import Rewritten, rewritten, warnings_of
from rlacd.io.robots.spans import edited
from rlacd.io.write import file_stem, write_file
from rlacd.io.write.encode import encode_plain_obj, hull_name
from rlacd.io.write.folder import check_names, write_folder
from rlacd.io.write.target import check_file, check_folder, check_name, mesh_folder
from rlacd.options.fields import checked, path_like, read, shown
from rlacd.options.output import OutputOptions
from rlacd.options.robots import PairKind, Per, RobotOptions


def rewrite_robot(
    robot: str | os.PathLike[str],
    output: str | os.PathLike[str],
    *,
    package_dirs: Sequence[str] = (),
    keep_input: bool = False,
    per: Per = "link",
    links: Mapping[str, float] | None = None,
    samples: int = 500,
    exclude: str | Sequence[PairKind] = (),
    srdf: str | os.PathLike[str] | None = None,
    **options: Any,
) -> Rewritten:
    """Replace every collision mesh of a URDF, MJCF or USD file by its hulls, and keep everything else.

    Parameters
    ----------
    robot : path-like
        ``*.urdf``, ``*.xml`` for MJCF, or a USD stage (``*.usd``, ``*.usda``, ``*.usdc``). Its meshes are looked up
        relative to it and in packages (``package://NAME/...``), never outside the packages it refers to and
        `package_dirs`; a USD stage refers only to files in its folder or below.
    output : path-like
        The new file, of the same kind. Hulls go to a folder beside it, ``robot_acd_urdf`` for ``robot_acd.urdf``. For a
        USD stage it is a layer over the original, which it refers to, and holds the hulls.
    package_dirs : sequence of str
        ``NAME=FOLDER`` says where a package is; ``FOLDER`` alone may be read and is searched for packages.
    keep_input : bool
        Of a USD stage, write one file that holds all of it, instead of a layer over the original.
    per : "link" or "mesh"
        What is decomposed as one solid: all collision meshes of a link (URDF), body (MJCF) or rigid body (USD) that
        share their contact properties, or each mesh. Links that fixed joints connect stay apart; so do MJCF geoms with
        a name, and meshes that belong to no body.
    links : dict, optional
        For the links whose whole name matches a regular expression, another `threshold_abs`: ``{"finger.*": 0.001}``.
        The last that matches counts.
    samples : int
        Joint positions within their limits, beside that at rest, at which links are looked at: those whose meshes do
        not touch there do not touch as hulls either, and are cut finer where they would, or a warning names both. Needs
        the extra ``clear``. USD stages are looked at as they stand.
    exclude : sequence of "adjacent", "always" and "never"
        Pairs of bodies of an MJCF model to add as ``<exclude>``, by when their hulls touch at these positions.
    srdf : path-like, optional
        For a URDF, where to write them as ``<disable_collisions>`` for MoveIt.
    **options
        Those of `rlacd.decompose`, for each solid. The criterion is ``distance`` by default, and the threshold 1.5 % of
        the robot's longest side, with all joints at zero. `threshold` and `overlap` are relative to that, or with
        ``relative_to="mesh"`` to each solid, whose criterion and threshold are then those of `rlacd.decompose`. Lengths
        such as `threshold_abs` are in the robot's unit, after the scale of a mesh. A `timeout` applies to each solid.

    Returns
    -------
    Rewritten

    Raises
    ------
    MeshError
        The file or one of its meshes cannot be read, is not allowed to be read, or there is none to replace.
    OptionError
        An option is out of range, or `output` is not of the same kind as `robot`.
    OutputError
        The place cannot be written to.
    """
    source, place = Path(read(path_like(), "robot", robot)), Path(read(path_like(), "output", output))
    asked = RobotOptions(per, links, samples, exclude, None if srdf is None else os.fspath(srdf))
    check_options(options)
    if source.suffix.lower() in usd.ENDINGS:
        _check_place(source, place, usd.ENDINGS)
        return rewrite_stage(usd.read_colliders(source), place, options, asked, keep_input=keep_input)
    if keep_input:
        raise OptionError("keep_input (--keep-input) is for USD stages: URDF and MJCF keep their other files.")
    packages, began = checked(OutputOptions, "package_dirs", package_dirs) or (), time.perf_counter()
    kind = kind_of(source)
    _check_place(source, place, [source.suffix.lower()])
    check_folder(folder := mesh_folder(place, kind))
    root = opened(source, kind)
    _check_matrix(source, place, asked)
    plan, warnings = planned(root, kind, References(source, packages), place, folder, apart=asked.per == "mesh")
    if not plan.bodies:
        write_file(place, root.file.data)
        said = [f"{source} has no collision mesh, so this is a copy.", *warnings]
        return Rewritten(place, folder, [], said, time.perf_counter() - began, 0.0)
    done = decomposed_robot(description := robot_of_file(kind, source, plan), options, asked)
    stem = file_stem(place.stem)
    files, names = _hull_files(stem, done.results)
    copies = _copies(stem, plan.bodies) if kind == "mjcf" else {}
    files |= {name: encode_plain_obj(Triangles(mesh.vertices, mesh.faces)) for mesh, name in copies.items()}
    edits, said = excludes(root, chosen(done.pairs, asked.exclude))
    data = edited(root, [*plan.edit(names, {mesh.path: name for mesh, name in copies.items()}), *edits])
    warnings += [warning for warning in plan.warnings if warning not in warnings]
    check_names(folder, stem, list(files))
    write_folder(folder, stem, files, then=lambda: write_file(place, data))
    if asked.srdf is not None and (done.samples or len(plan.bodies) < 2):
        write_file(Path(asked.srdf), srdf_of(root.attributes.get("name", "robot"), done.pairs))
    warnings += [*warnings_of(done.results), *done.warnings, *said]
    return rewritten(description, done, names, (place, folder), warnings, began)


def rewrite_stage(
    stage: usd.Colliders, place: Path, options: Mapping[str, Any], asked: RobotOptions, *, keep_input: bool = False
) -> Rewritten:
    """Rewrite a USD stage that has been read, as `rewrite_robot` does."""
    began = time.perf_counter()
    _check_place(stage.source, place, usd.ENDINGS)
    check_options(options)
    _check_matrix(stage.source, place, asked)
    robot, prims = robot_of_stage(stage, apart=asked.per == "mesh")
    done = decomposed_robot(robot, options, asked)
    data, warnings, files = usd.encode_layer(stage, place, prims, done.results, flat=keep_input)
    warnings += [*warnings_of(done.results), *done.warnings, *left_behind(files, stage.source.parent, place)]
    names = {collider: [*map(hull_name, range(len(result)))] for collider, result in done.results.items()}
    if not robot.bodies:
        warnings.append(f"{stage.source} has no mesh that collides, so the layer changes nothing.")
    write_file(place, data)
    return rewritten(robot, done, names, (place, place), warnings, began)


def _check_matrix(source: Path, place: Path, robot: RobotOptions) -> None:
    """Check that what is asked about pairs of links is for this kind of file."""
    ending = source.suffix.lower()
    if robot.exclude and ending != ".xml":
        raise OptionError("exclude (--exclude) is for MJCF; for a URDF give srdf (--srdf).")
    if robot.srdf is not None:
        if ending != ".urdf":
            raise OptionError("srdf (--srdf) is for a URDF; for MJCF give exclude (--exclude).")
        if os.path.realpath(robot.srdf) in map(os.path.realpath, (source, place)):
            raise OptionError(f"srdf (--srdf) {robot.srdf} would overwrite the URDF; choose another name.")
        check_file(Path(robot.srdf))


def _check_place(source: Path, place: Path, endings: Sequence[str]) -> None:
    """Check, before any work, that what `source` becomes can be written to `place`; raises as `rewrite_robot`."""
    if place.suffix.lower() not in endings:
        raise OptionError(f"{source} can only be rewritten as another {' or '.join(endings)}, not {shown(str(place))}.")
    if os.path.realpath(source) == os.path.realpath(place):
        raise OptionError(f"{place} would overwrite the input; choose another name.")
    check_name(place)
    check_file(place)


def _hull_files(
    stem: str, results: Mapping[Collider, Decomposition]
) -> tuple[dict[str, bytes], dict[Collider, list[str]]]:
    """The files of all hulls, and the names of each collider's; what is the same is written once."""
    files: dict[str, bytes] = {}
    names: dict[Collider, list[str]] = {}
    done: dict[Any, list[str]] = {}
    taken: set[str] = set()
    for collider, result in results.items():
        key = id(result), collider.meshes[0].key
        if key not in done:
            name = _stem(collider.name, taken)
            done[key] = [f"{stem}_{name}_{i:03d}.obj" for i in range(len(result))]
            files |= {at: encode_plain_obj(collider.in_file(h)) for at, h in zip(done[key], result, strict=True)}
        names[collider] = done[key]
    return files, names


def _copies(stem: str, bodies: Sequence[Body]) -> dict[Surface, str]:
    """Names for copies of the meshes that MuJoCo cannot read."""
    meshes = [mesh.surface for body in bodies for collider in body.colliders for mesh in collider.meshes]
    unread, taken = [mesh for mesh in dict.fromkeys(meshes) if not mujoco_reads(mesh.path)], set[str]()
    return {mesh: f"{stem}_{_stem(mesh.path.stem, taken)}_visual.obj" for mesh in unread}


def _stem(name: str, taken: set[str]) -> str:
    """A name for files; one that would collide on any file system gets a number."""
    plain = stem = file_stem(name)
    number = 1
    while stem.lower() in taken:
        number += 1
        stem = f"{plain}_{number}"
    taken.add(stem.lower())
    return stem
