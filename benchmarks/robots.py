"""Whole robots: hulls, overlaps and MuJoCo's speed with each mesh decomposed for itself, and with links as solids."""

from __future__ import annotations

import hashlib
import json
import math
import re
import time
from collections.abc import Mapping, Sequence
from contextlib import suppress
from pathlib import Path
from typing import Any

import click
import numpy as np
import trimesh

import rlacd
from benchmarks.boxes import write_boxes
from benchmarks.cli import PATH
from benchmarks.methods import Method, make_method
from benchmarks.store import load_hulls, save_hulls
from benchmarks.tables import Ratio, Table
from benchmarks.worst import film
from rlacd.clear import Body, Motion, Solids, Surface, check
from rlacd.cli.exit_codes import exit_codes
from rlacd.decomposition import Decomposition
from rlacd.errors import RlacdError
from rlacd.io.robots import is_robot
from rlacd.io.robots.read import read_robot
from rlacd.io.robots.robot import Robot
from rlacd.io.write import write_file
from rlacd.options.robots import RobotOptions

STEPS, ROUNDS = 500, 3
"""Steps that are timed, and how often each model takes them, in turn with the other: the best counts."""

POSITIONS, SEED, LEAST = 200, 11, 1e-4
"""Contacts that the links do not have are counted at so many joint positions, which no run looks at, from so many
metres of depth on."""

BEFORE = {"coacd": "each mesh by CoACD", "own": "each mesh at its own scale", "hull": "one hull a mesh"}
"""What the default is compared with: hulls as obj2mjcf writes them, those that rlacd makes of each mesh alone, or those
that MuJoCo takes for meshes."""

HEAD = [
    *("robot", "meshes", "links", "hulls: {}", "now", "a link", "farthest, mm", "its size, mm"),
    *("false contacts: {}", "now", "of them told", "deepest, mm: {}", "now"),
    *("steps/s: {}", "now", "CPU s: {}", "now"),
]


def rewritten(robot: Path, way: str, options: dict[str, Any], packages: list[str], out: Path) -> dict[str, Any]:
    """Rewrite a robot in one way, unless a run before has, and report."""
    place, kept = out / robot.parent.name / robot.stem / f"{way}{robot.suffix}", out / "rows"
    kept = kept / f"{robot.parent.name}_{robot.stem}_{way}.json"
    if not kept.exists():
        place.parent.mkdir(parents=True, exist_ok=True)
        kept.parent.mkdir(parents=True, exist_ok=True)
        if way in ("coacd", "hull"):
            row = _by_mesh(way, robot, place, packages, out / "coacd")
        else:
            began = time.process_time()
            how: dict[str, Any] = {"per": "mesh", "relative_to": "mesh"} if way == "own" else {}
            done = rlacd.rewrite_robot(robot, place, package_dirs=packages, threads=1, **how, **options)
            cpu = time.process_time() - began
            told = {(pair.first, pair.second) for pair in done.pairs if pair.new_depth}
            false = _false(read_robot(robot, packages), {link.name: link.hulls for link in done.links}, told)
            row = {**done.as_dict(), "links": len(done.replaced), "cpu": cpu, **false}
        write_file(kept, json.dumps(row).encode())
    return {**json.loads(kept.read_bytes()), "place": place}


def _by_mesh(way: str, robot: Path, place: Path, packages: list[str], store: Path) -> dict[str, Any]:
    """Replace each mesh by its hull, or by what CoACD makes of it."""
    cpu = 0.0
    read, results = read_robot(robot, packages, apart=True), {}
    for collider in (collider for body in read.bodies for collider in body.colliders):
        mesh = collider.mesh()
        hulls, seconds = [mesh.convex_hull], 0.0
        if way == "coacd":
            made = _stored(make_method(way), np.asarray(mesh.vertices), np.asarray(mesh.faces, np.int32), store)
            hulls, seconds = made
        results[collider] = Decomposition.of(hulls, mesh)
        cpu += seconds
    read.write(place, results, None, RobotOptions(), whole=False)
    false = _false(read, {body.name: body.hulls(results) for body in read.bodies}, set())
    return {"hulls": sum(map(len, results.values())), "cpu": cpu, **false}


def _false(robot: Robot, hulls: dict[str, Any], told: set[tuple[str, str]]) -> dict[str, Any]:
    """How often hulls touch where links do not, how often of pairs that were told, and how deep at most."""
    motion = robot.motion(POSITIONS, SEED)
    bodies = moving(robot, motion, hulls)
    found = [
        (offence.depth, (bodies[i].name, bodies[j].name) in told)
        for (i, j), touching in check(bodies, motion).items()
        for offence in touching.offences
        if offence.depth * robot.metres > LEAST
    ]
    return {"false": len(found), "told": sum(said for _, said in found), "deepest": max(found, default=(0.0,))[0]}


def moving(robot: Robot, motion: Motion, hulls: Mapping[str, Sequence[trimesh.Trimesh]]) -> list[Body]:
    """The links as they were read and as hulls, in the order of the motion."""
    meshes = {body.name: body.mesh() for body in robot.bodies}
    solids = motion.solids or [Solids(body.primitives) for body in robot.bodies]
    return [
        Body(name, _surface(meshes.get(name, trimesh.Trimesh())), [*map(_surface, hulls.get(name, []))], own.primitives)
        for name, own in zip(motion.links, solids, strict=True)
    ]


def _stored(method: Method, vertices: Any, faces: Any, store: Path) -> tuple[list[trimesh.Trimesh], float]:
    """The hulls of a mesh, and the CPU seconds that they took, now or in a run before."""
    given = np.ascontiguousarray(vertices).tobytes() + np.ascontiguousarray(faces).tobytes() + method.version.encode()
    path = store / f"{hashlib.sha256(given).hexdigest()[:24]}.npz"
    if not path.exists():
        store.mkdir(parents=True, exist_ok=True)
        began = time.process_time()
        save_hulls(path, method.run(vertices, faces, method.default, 1), {"cpu": time.process_time() - began})
    hulls, account = load_hulls(path)
    return [trimesh.Trimesh(*hull, process=False).convex_hull for hull in hulls], float(account["cpu"])


def _surface(mesh: trimesh.Trimesh) -> Surface:
    return Surface(np.asarray(mesh.vertices), np.asarray(mesh.faces))


def measure(robot: Path, before: str, options: dict[str, Any], packages: list[str], out: Path) -> dict[str, Any]:
    """Rewrite a robot in both ways, and step both models in turn."""
    ways = {"before": before, "whole": "whole"}
    row: dict[str, Any] = {key: rewritten(robot, way, options, packages, out) for key, way in ways.items()}
    if row["whole"]["links"]:
        speeds = [math.nan] * len(ways)
        with suppress(ValueError):  # MuJoCo refuses the robot, whatever it collides as
            speeds = _speeds([_model(row[key]["place"]) for key in ways])
        for key, speed in zip(ways, speeds, strict=True):
            row[key]["speed"] = speed
    return {"robot": robot.parent.name if robot.stem == "robot" else robot.stem, **row}


def _model(path: Path) -> Any:
    """The model as MuJoCo reads it, over a floor; of a URDF without what it shows, and movable whatever it weighs."""
    import mujoco

    text = path.read_text(encoding="utf-8")
    if path.suffix == ".urdf":
        text = re.sub(r"<visual\b.*?</visual>|<mujoco>.*?</mujoco>", "", text, flags=re.DOTALL)
        settings = f'meshdir="{path.parent}" strippath="false" boundmass="1e-3" boundinertia="1e-6"'
        head = rf'\1<mujoco><compiler {settings} balanceinertia="true"/></mujoco>'
        path = path.with_name(f"{path.stem}_lean.urdf")
        path.write_text(re.sub(r"(<robot\b[^>]*>)", head, text, count=1), encoding="utf-8")
    return mujoco.MjModel.from_xml_path(str(path))


def _speeds(models: list[Any]) -> list[float]:
    """Steps a second of each model, all from rest."""
    import mujoco

    best = [math.inf] * len(models)
    for _ in range(ROUNDS):
        for index, model in enumerate(models):
            data = mujoco.MjData(model)
            began = time.process_time()
            mujoco.mj_step(model, data, nstep=STEPS)
            best[index] = min(best[index], time.process_time() - began)
    return [STEPS / seconds for seconds in best]


def _line(row: dict[str, Any]) -> list[object]:
    own, whole = row["before"], row["whole"]
    far, size = (1000 * whole["metres"] * (whole[what] or math.nan) for what in ("added_abs", "size_abs"))
    return [
        *(row["robot"], whole["meshes"], whole["links"], own["hulls"], whole["hulls"]),
        *(f"{whole['hulls'] / whole['links']:.1f}", f"{far:.1f}", f"{size:.0f}"),
        *(own["false"], whole["false"], whole["told"]),
        *(f"{1000 * whole['metres'] * way['deepest']:.2f}" for way in (own, whole)),
        *(f"{way[what]:.{digits}f}" for what, digits in (("speed", 0), ("cpu", 1)) for way in (own, whole)),
    ]


def _shown(robot: Path, row: dict[str, Any], before: str) -> tuple[Path, dict[str, Path]]:
    """A robot, and the file of each way by its caption."""
    ways = {"before": BEFORE[before], "whole": "rlacd"}
    own = {name: row[key] for key, name in ways.items()}
    return robot, {f"{name}: {r['hulls']} hulls, false contacts: {r['false']}": r["place"] for name, r in own.items()}


def _paths(folder: Path, robots: Sequence[str], out: Path) -> list[Path]:
    named = [folder / name for name in robots] or sorted(path for path in folder.rglob("*") if is_robot(path))
    return [*named, *write_boxes(out / "boxes")]


@click.command()
@click.argument("folder", type=PATH)
@click.argument("robots", nargs=-1)
@click.option("--out", "-o", type=PATH, required=True, help="Folder of results, which a next run goes on with.")
@click.option("--before", type=click.Choice([*BEFORE]), default="coacd", show_default=True, help="Compared with.")
@click.option("--package-dir", "packages", multiple=True, help="As of rlacd decompose.")
@click.option("--quality", default="fast", show_default=True, help="Of rlacd.")
@click.option("--film", "shown", type=PATH, help="A GIF of the worst positions of those named, too.")
def app(
    folder: Path,
    robots: tuple[str, ...],
    out: Path,
    before: str,
    packages: tuple[str, ...],
    quality: str,
    shown: Path | None,
) -> None:
    """Rewrite all robots (URDF, MJCF) of a folder, or those named, and six of boxes; step them in MuJoCo. Needs
    rlacd[sim,clear], and CoACD, which takes a minute or so a mesh.

    \b
    python -m benchmarks robots $(python -c "import example_robot_data as e; print(e.path)") --out RUN
    """
    if shown is not None and not robots:
        raise click.UsageError("--film shows robots that are named; name some.")
    with exit_codes():
        out, rows, drawn = out.absolute(), [], []
        for path in _paths(folder, robots, out):
            try:
                row = measure(path, before, {"quality": quality}, [*packages], out)
            except (RlacdError, ValueError) as error:
                click.echo(f"{path.stem}: {error}")
                continue
            if row["whole"]["links"]:
                rows.append(row)
                click.echo(_line(row))
                drawn += [_shown(path, row, before)] if path in [folder / name for name in robots] else []
        if shown is not None and drawn:
            film(shown, drawn, packages)
        click.echo(Table([head.format(BEFORE[before]) for head in HEAD], [_line(row) for row in rows]))
        click.echo(f"CPU seconds now, sum: {sum(row['whole']['cpu'] for row in rows):.0f}")
        for what, one, other in (
            ("hulls a link", ("whole", "hulls"), ("whole", "links")),
            ("hulls, before / now", ("before", "hulls"), ("whole", "hulls")),
            ("steps a second, now / before", ("whole", "speed"), ("before", "speed")),
            ("CPU seconds, now / before", ("whole", "cpu"), ("before", "cpu")),
        ):
            if before == "hull" and what.startswith("CPU"):
                continue
            values = np.array([[row[way][key] for way, key in (one, other)] for row in rows])
            known = values[np.isfinite(values).all(axis=1)]
            click.echo(f"{what}, geometric mean of {len(known)}: {Ratio.of(*known.T)}")
