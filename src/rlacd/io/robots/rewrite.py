"""Rewriting a robot: plan from the file, decompose each mesh once, write hulls and file."""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import trimesh
from numpy.typing import NDArray

from rlacd.decompose_mesh import decompose
from rlacd.decomposition import Decomposition
from rlacd.errors import MeshError, MeshFileError, OptionError
from rlacd.io.read.contents import Triangles
from rlacd.io.read.load import load_mesh
from rlacd.io.read.open_file import read_named
from rlacd.io.robots import usd
from rlacd.io.robots.mjcf import mujoco_reads, plan_mjcf, read_model
from rlacd.io.robots.references import References
from rlacd.io.robots.spans import LARGEST_DESCRIPTION, Element, edited, parse
from rlacd.io.robots.urdf import MeshUse, Plan, plan_urdf
from rlacd.io.write import file_stem, write_file
from rlacd.io.write.encode import encode_plain_obj, hull_name
from rlacd.io.write.folder import check_names, write_folder
from rlacd.io.write.target import check_file, check_folder, check_name, mesh_folder
from rlacd.options import LENGTHS, Options
from rlacd.options.fields import checked, path_like, read, shown
from rlacd.options.output import OutputOptions
from rlacd.solid.frame import Frame
from rlacd.solid.hull import Hull

ENDINGS = {".urdf": "urdf", ".xml": "mjcf"}
ROOTS = {"urdf": "robot", "mjcf": "mujoco"}


@dataclass(frozen=True)
class RewrittenMesh:
    """One collision mesh: its file, the names of its hulls' files, and its decomposition at the scale of its use."""

    path: Path
    files: list[str]
    result: Decomposition


@dataclass(frozen=True)
class Rewritten:
    """The result of rewriting a robot.

    Attributes
    ----------
    path
        The new description.
    folder
        Where its hulls are, as OBJ files.
    meshes
        The collision meshes that were replaced, each once.
    warnings
        What the user should know: one sentence each.
    """

    path: Path
    folder: Path
    meshes: list[RewrittenMesh]
    warnings: list[str]

    @property
    def complete(self) -> bool:
        """False when a decomposition was stopped early."""
        return all(mesh.result.report.get("complete", True) for mesh in self.meshes)


def is_robot(path: str | os.PathLike[str]) -> bool:
    """Tell by its ending whether a file describes a robot."""
    return Path(path).suffix.lower() in ENDINGS


def rewrite_robot(
    robot: str | os.PathLike[str],
    output: str | os.PathLike[str],
    *,
    package_dirs: Sequence[str] = (),
    keep_input: bool = False,
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
    **options
        Those of `rlacd.decompose`, for each mesh. Lengths such as `threshold_abs` are in the robot's unit, after the
        scale of a mesh; a `timeout` applies to each mesh.

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
    _check_options(options)
    if source.suffix.lower() in usd.ENDINGS:
        _check_place(source, place, usd.ENDINGS)
        return rewrite_stage(usd.read_colliders(source), place, options, keep_input=keep_input)
    if keep_input:
        raise OptionError("keep_input (--keep-input) is for USD stages: URDF and MJCF keep their other files.")
    packages = checked(OutputOptions, "package_dirs", package_dirs) or ()
    kind, root, folder = _opened(source, place)
    references = References(source, packages)
    plan, warnings = _plan(root, kind, references, place, folder)
    if not plan.uses:
        write_file(place, root.file.data)
        return Rewritten(place, folder, [], [f"{source} has no collision mesh, so this is a copy.", *warnings])
    stem = file_stem(place.stem)
    meshes: dict[MeshUse, RewrittenMesh] = {}
    files: dict[str, bytes] = {}
    copies: dict[MeshUse, str] = {}
    for use, name in zip(plan.uses, _stems([use.path for use in plan.uses]), strict=True):
        result, said = _decomposed(use, options)
        hulls = {f"{stem}_{name}_{i:03d}.obj": encode_plain_obj(_unscaled(h, use)) for i, h in enumerate(result.hulls)}
        if kind == "mjcf" and not mujoco_reads(use.path):
            copies[use] = f"{stem}_{name}_visual.obj"
            plain = Triangles(result.source.vertices / use.scale, _oriented(result.source.faces, use))
            files[copies[use]] = encode_plain_obj(plain)  # without the scale, which is applied when it is read
        files |= hulls
        meshes[use] = RewrittenMesh(use.path, list(hulls), result)
        warnings += [*said, *(f"{use.path.name}: {warning}" for warning in result.report.get("warnings", []))]
    named = {use: mesh.files for use, mesh in meshes.items()}
    edits = plan.edit(named, {use: mesh.result.source for use, mesh in meshes.items()}, copies)
    data = edited(root, edits)
    warnings += [warning for warning in plan.warnings if warning not in warnings] + _fewer(meshes, options)
    check_names(folder, stem, list(files))
    write_folder(folder, stem, files, then=lambda: write_file(place, data))
    return Rewritten(place, folder, list(meshes.values()), warnings)


def rewrite_stage(
    stage: usd.Colliders, place: Path, options: Mapping[str, Any], *, keep_input: bool = False
) -> Rewritten:
    """Rewrite a USD stage that has been read, as `rewrite_robot` does."""
    _check_place(stage.source, place, usd.ENDINGS)
    _check_options(options)
    data, done, warnings, files = usd.encode_layer(stage, place, lambda mesh: _coarse(mesh, options), flat=keep_input)
    warnings += _left_behind(files, stage.source.parent, place)
    meshes = [RewrittenMesh(Path(path), [*map(hull_name, range(len(hulls)))], hulls) for path, hulls in done.items()]
    if not meshes:
        warnings.append(f"{stage.source} has no mesh that collides, so the layer changes nothing.")
    write_file(place, data)
    return Rewritten(place, place, meshes, warnings)


def _check_place(source: Path, place: Path, endings: Sequence[str]) -> None:
    """Check, before any work, that what `source` becomes can be written to `place`; raises as `rewrite_robot`."""
    if place.suffix.lower() not in endings:
        raise OptionError(f"{source} can only be rewritten as another {' or '.join(endings)}, not {shown(str(place))}.")
    if os.path.realpath(source) == os.path.realpath(place):
        raise OptionError(f"{place} would overwrite the input; choose another name.")
    check_name(place)
    check_file(place)


def _opened(source: Path, place: Path) -> tuple[str, Element, Path]:
    """The kind of a robot file, its root, and the folder for its hulls, which is checked before any work."""
    if not is_robot(source):
        raise MeshFileError(f"{source} is not a robot file: its name has to end in {' or '.join(ENDINGS)}.")
    _check_place(source, place, [source.suffix.lower()])
    kind = ENDINGS[source.suffix.lower()]
    folder = mesh_folder(place, kind)
    check_folder(folder)
    root = parse(source, read_named(source, LARGEST_DESCRIPTION))
    if root.tag != ROOTS[kind]:
        raise MeshFileError(f"{source} is not {kind.upper()}: it starts with <{root.tag}>, not <{ROOTS[kind]}>.")
    return kind, root, folder


def _check_options(options: Mapping[str, Any]) -> None:
    Options.of({name: value for name, value in options.items() if name != "progress"})
    for name in ("unit", "scale", "per_node"):
        if options.get(name):
            raise OptionError(f"{name} is for a single mesh; a robot file states it for each of its meshes.")


def _plan(root: Element, kind: str, references: References, place: Path, folder: Path) -> tuple[Plan, list[str]]:
    source = root.file.folder
    if kind == "urdf":
        plan = plan_urdf(root, references, lambda old, hull: _reference(old, hull, references, folder))
    else:
        compiler = read_model(root, references, lambda path: read_named(path, LARGEST_DESCRIPTION))
        within = os.path.relpath(source / compiler.mesh_folder, source)  # the same from the new file
        target = os.path.relpath(folder.absolute(), Path(os.path.abspath(place.absolute().parent / within)))
        plan = plan_mjcf(compiler, references, lambda _, hull: (Path(target) / hull).as_posix())
    return plan, [*plan.warnings, *_left_behind(plan.relative, source, place)]


def _left_behind(files: Sequence[str], source: Path, place: Path) -> list[str]:
    """Warn about other files that are named relative to a folder which the result does not lie in."""
    if not files or os.path.realpath(place.absolute().parent) == os.path.realpath(source):
        return []
    said = f"{len(files)} other files, such as {files[0]}, are referred to relative to {source}"
    lost = f"will not be found from {place.absolute().parent}: write the result beside the input, or copy them too"
    return [f"{said} and {lost}."]


def _reference(old: str, hull: str, references: References, folder: Path) -> str:
    """Refer to a hull the way the mesh was: by its package if it lies in that package, else relative to the file."""
    package = references.package_of(old)
    target = Path(os.path.abspath(folder)) / hull
    if package is not None and target.is_relative_to(package):
        scheme, rest = old.split("://", 1)
        return f"{scheme}://{rest.split('/', 1)[0]}/{target.relative_to(package).as_posix()}"
    return f"{folder.name}/{hull}"


def _fewer(meshes: Mapping[MeshUse, RewrittenMesh], options: Mapping[str, Any]) -> list[str]:
    """Say that one length for the whole robot may do, where meshes of other sizes each became many hulls."""
    hulls = sum(len(mesh.files) for mesh in meshes.values())
    reports = [mesh.result.report for mesh in meshes.values()]
    scales = [report["scale"] for report in reports]
    stated = any(options.get(name) is not None for name in ("threshold_abs", "max_hulls", "timeout"))
    stated |= options.get("criterion") not in (None, "concavity")
    if stated or max(scales) < 2 * min(scales) or hulls < MANY_HULLS * len(meshes):
        return []
    length = float(f"{1.05 * reports[0]['options']['threshold'] / min(scales):.2g}")  # 5 %: never rounded below it
    said = f"{len(meshes)} meshes became {hulls} hulls, because the threshold is relative to each"
    return [f"{said}; --threshold-abs {length:g}, about that of the largest, may give fewer."]


MANY_HULLS = 10
"""Hulls per mesh from which on a length is suggested."""


def _coarse(mesh: trimesh.Trimesh, options: Mapping[str, Any]) -> Decomposition:
    """Decompose a mesh with a length as the threshold; one that is larger than the mesh is cut to it."""
    given = dict(options)
    if isinstance(given.get("threshold_abs"), (int, float)):
        scale = Frame.of(mesh.vertices[np.unique(mesh.faces)] if len(mesh.faces) else mesh.vertices).scale
        given["threshold_abs"] = min(given["threshold_abs"], LENGTHS["threshold"][1] / scale)
    return decompose((mesh.vertices, mesh.faces), **given)


def _decomposed(use: MeshUse, options: Mapping[str, Any]) -> tuple[Decomposition, list[str]]:
    """Decompose a mesh, in the unit that a COLLADA file states: ROS, Gazebo and Bullet apply it.

    Whether such a file whose y axis points up is turned differs between them, so that is a warning.
    """
    try:
        read = load_mesh(use.path)
        is_collada = use.path.suffix.lower() == ".dae"
        unit = (read.metres or 1.0) if is_collada else 1.0
        mesh = trimesh.Trimesh(read.vertices * unit * use.scale, _oriented(read.faces, use), process=False)
        turned = f"{use.path.name} declares {read.up.upper()}_UP, and some programs rotate such a file when they read"
        said = [f"{turned} it; its hulls keep its coordinates."] if is_collada and read.up != "z" else []
        return _coarse(mesh, options), said
    except MeshError as error:
        if str(use.path) in str(error):
            raise
        raise type(error)(f"{use.path}: {error}") from error


def _unscaled(hull: trimesh.Trimesh, use: MeshUse) -> trimesh.Trimesh:
    """Divide a hull by the description's scale, which is applied again when the hull is read."""
    with np.errstate(over="ignore"):
        points = np.ascontiguousarray(hull.vertices / use.scale)
    if not np.isfinite(points).all():
        raise MeshFileError(f"{use.path} has the scale {use.scale}, which cannot be inverted: correct the scale.")
    exact = Hull.of(points)
    if exact is not None:
        return trimesh.Trimesh(exact.vertices, exact.faces, process=False)
    return trimesh.Trimesh(points, _oriented(hull.faces, use), process=False)


def _oriented(faces: NDArray[Any], use: MeshUse) -> NDArray[Any]:
    """Turn faces around if the scale mirrors."""
    return faces if np.prod(np.sign(use.scale)) > 0 else faces[:, ::-1]


def _stems(paths: Sequence[Path]) -> list[str]:
    """Name each mesh after its file; names that would collide on any file system get a number."""
    stems: list[str] = []
    for path in paths:
        plain = stem = file_stem(path.stem)
        number = 1
        while stem.lower() in {other.lower() for other in stems}:
            number += 1
            stem = f"{plain}_{number}"
        stems.append(stem)
    return stems
