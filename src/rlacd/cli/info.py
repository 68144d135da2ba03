"""The command `rlacd info`: the contents of a mesh file, and how it would be repaired."""

from __future__ import annotations

import os
from collections import Counter
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from rlacd.cli.commands import Argument, Command, Option, options_of
from rlacd.cli.decompose import ROBOTS
from rlacd.cli.exit_codes import give
from rlacd.cli.lean import import_trimesh
from rlacd.cli.pipes import refuse_stdin
from rlacd.cli.terminal import counted
from rlacd.options.output import OutputOptions
from rlacd.plain_json import as_plain, printable, to_json


def _info(mesh: Path, as_json: bool, package_dirs: Sequence[str] | None) -> None:
    """Show what a file contains and how it would be repaired.

    Of a robot, show its links that collide.

    \b
    Examples:
      rlacd info chair.glb
      rlacd info chair.glb --json | jq .repair
      rlacd info robot.urdf
    """
    refuse_stdin(mesh)
    import_trimesh(mesh)
    if mesh.suffix.lower() in ROBOTS and mesh.is_file():
        facts = describe_robot(mesh, package_dirs or ())
        text = robot_text(facts)
    else:
        facts = describe(mesh)
        text = describe_text(facts)
    give(to_json(facts) if as_json else printable(text))


COMMAND = Command(
    "info",
    _info,
    [
        Argument("mesh", "FILE", "The mesh or robot to look at."),
        Option("as_json", "--json", is_flag=True, default=False, help="Print JSON instead of text."),
        *options_of(OutputOptions, only=("package_dirs",)),
    ],
)


def describe_robot(path: Path, package_dirs: Sequence[str] = ()) -> dict[str, Any]:
    """Read a robot and describe its links that collide as plain values.

    Returns ``file``, ``metres`` (its unit), ``size_abs`` (the longest side of the box around all of them, at rest),
    ``links`` (a dict each: ``name``, ``meshes`` by their files, ``triangles``, ``primitives``), ``warnings``; raises
    MeshError.
    """
    from rlacd.io.robots.read import read_robot

    robot = read_robot(path, package_dirs)
    links = []
    for body in robot.bodies:
        meshes = [mesh.file for collider in body.colliders for mesh in collider.meshes]
        files, triangles = [str(mesh.path) for mesh in meshes], sum(len(mesh.faces) for mesh in meshes)
        primitives = [each.kind for each in body.primitives]
        links.append({"name": body.name, "meshes": files, "triangles": triangles, "primitives": primitives})
    named = {"file": os.fspath(path), "metres": robot.metres, "size_abs": robot.size}
    return {**named, "links": links, "warnings": [*robot.warnings]}


def robot_text(facts: dict[str, Any]) -> str:
    """Format the result of `describe_robot` as a few lines of text."""
    links = facts["links"]
    width = max((len(link["name"]) for link in links), default=0)
    lines = [facts["file"], f"  size     {facts['size_abs'] * facts['metres']:.6g} m along the longest side, at rest"]
    lines.append(f"  links    {len(links)} that collide, {sum(bool(link['meshes']) for link in links)} with meshes")
    for link in links:
        held = f"{counted(len(link['meshes']), 'mesh', 'meshes'):>9}  {link['triangles']} triangles"
        kinds = Counter(link["primitives"])
        told = [held] * bool(link["meshes"])
        told += [counted(kinds[kind], kind, "boxes" if kind == "box" else f"{kind}s") for kind in kinds]
        lines.append(f"    {link['name']:{width}}  {', '.join(told)}")
    lines += [f"  warning: {warning}" for warning in facts["warnings"]]
    return "\n".join(lines) + "\n"


def describe(path: str | os.PathLike[str]) -> dict[str, Any]:
    """Load and repair a mesh file, and describe the findings as plain values.

    Parameters
    ----------
    path : path-like
        Any file `rlacd.decompose` takes.

    Returns
    -------
    dict
        ``file``, ``name``, ``vertices``, ``faces``, ``bounds`` (two corners, in the file's unit), ``scale`` (frame
        units per unit of the file), ``repair`` (a dict per body: ``body``, ``step``, ``faces_in``, ``faces_out``,
        ``deviation`` in frame units), ``deviation`` (how far triangles may be from the surfaces of a CAD file, in the
        file's unit, or None), ``solid`` (``faces``, and ``volume`` in the file's unit cubed), ``warnings``.

    Raises
    ------
    MeshError
        The file cannot be read or holds nothing usable.
    """
    from rlacd._native import mesh_volume
    from rlacd.io.read.load import load_mesh
    from rlacd.repair.repair import repair
    from rlacd.solid.topology import compacted

    mesh = load_mesh(path)
    solid = repair(mesh)
    used = compacted(mesh.vertices, mesh.faces)[0]
    return {
        "file": os.fspath(path),
        "name": mesh.name,
        "vertices": len(mesh.vertices),
        "faces": len(mesh.faces),
        "bounds": [used.min(axis=0).tolist(), used.max(axis=0).tolist()],
        "scale": float(solid.frame.scale),
        "deviation": mesh.deviation,
        "repair": [as_plain(body) for body in solid.bodies],
        "solid": {
            "faces": len(solid.faces),
            "volume": mesh_volume(solid.vertices, solid.faces) / float(solid.frame.scale) ** 3,
        },
        "warnings": list(solid.warnings),
    }


def describe_text(facts: dict[str, Any]) -> str:
    """Format the result of `describe` as a few lines of text."""
    size = [high - low for low, high in zip(*facts["bounds"], strict=True)]
    bodies = facts["repair"]
    held = f"{len(bodies)} bod{'y' if len(bodies) == 1 else 'ies'}"
    lines = [facts["file"], f"  holds    {facts['faces']} triangles, {facts['vertices']} vertices, {held}"]
    lines.append(f"  size     {size[0]:.6g} x {size[1]:.6g} x {size[2]:.6g}")
    if facts["deviation"] is not None:
        near = f"up to {facts['deviation']:.3g} from its surfaces"
        lines.append(f"  curved   triangles lie {near}, or nearer if a threshold needs it")
    lines.append(f"  repaired {facts['solid']['faces']} triangles, volume {facts['solid']['volume']:.6g}")
    for step, count in Counter(body["step"] for body in bodies).most_common():
        worst = max(body["deviation"] for body in bodies if body["step"] == step)
        moved = f", surface moved by up to {worst / facts['scale']:.3g}" if worst > 0 else ""
        lines.append(f"    {count:5d} x {step}{moved}")
    lines += [f"  warning: {warning}" for warning in facts["warnings"]]
    return "\n".join(lines) + "\n"
