"""Whole robots: hulls a link, farthest, and MuJoCo's speed with each mesh at its own scale and with links as solids."""

from __future__ import annotations

import json
import math
import re
import time
from pathlib import Path
from typing import Any

import click

import rlacd
from benchmarks.cli import PATH
from benchmarks.tables import Ratio, Table
from rlacd.cli.exit_codes import exit_codes
from rlacd.errors import RlacdError
from rlacd.io.robots import is_robot
from rlacd.io.write import write_file

STEPS, ROUNDS = 500, 3
"""Steps that are timed, and how often each model takes them, in turn with the other: the best counts."""

WAYS: dict[str, dict[str, Any]] = {"own": {"per": "mesh", "relative_to": "mesh"}, "whole": {}}
"""Each mesh at its own scale, and the default."""

HEAD = [
    *("robot", "meshes", "links", "hulls: each mesh at its own scale", "now", "a link"),
    *("farthest, mm", "its size, mm", "steps/s: own scale", "now", "CPU s: own scale", "now"),
]


def rewritten(robot: Path, way: str, options: dict[str, Any], packages: list[str], out: Path) -> dict[str, Any]:
    """Rewrite a robot in one way, unless a run before has, and report."""
    place, kept = out / robot.stem / f"{way}{robot.suffix}", out / robot.stem / f"{way}.json"
    if not kept.exists():
        place.parent.mkdir(parents=True, exist_ok=True)
        began = time.process_time()
        done = rlacd.rewrite_robot(robot, place, package_dirs=packages, threads=1, **WAYS[way], **options)
        row = {**done.report(), "links": len(done.links), "cpu": time.process_time() - began}
        write_file(kept, json.dumps(row).encode())
    return {**json.loads(kept.read_bytes()), "place": place}


def measure(robot: Path, options: dict[str, Any], packages: list[str], out: Path) -> dict[str, Any]:
    """Rewrite a robot in both ways, and step both models in turn."""
    row: dict[str, Any] = {way: rewritten(robot, way, options, packages, out) for way in WAYS}
    if row["whole"]["links"]:
        for way, speed in zip(WAYS, _speeds([_model(row[way]["place"]) for way in WAYS]), strict=True):
            row[way]["speed"] = speed
    return {"robot": robot.stem, **row}


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
    own, whole = row["own"], row["whole"]
    far, size = (1000 * whole["metres"] * (whole[what] or math.nan) for what in ("farthest_abs", "size_abs"))
    return [
        *(row["robot"], whole["meshes"], whole["links"], own["hulls"], whole["hulls"]),
        *(f"{whole['hulls'] / whole['links']:.1f}", f"{far:.1f}", f"{size:.0f}"),
        *(f"{way[what]:.{digits}f}" for what, digits in (("speed", 0), ("cpu", 1)) for way in (own, whole)),
    ]


@click.command()
@click.argument("folder", type=PATH)
@click.argument("robots", nargs=-1)
@click.option("--out", "-o", type=PATH, required=True, help="Folder of results, which a next run goes on with.")
@click.option("--package-dir", "packages", multiple=True, help="As of rlacd decompose.")
@click.option("--quality", default="fast", show_default=True, help="Of both ways.")
def app(folder: Path, robots: tuple[str, ...], out: Path, packages: tuple[str, ...], quality: str) -> None:
    """Rewrite all robots (URDF, MJCF) of a folder, or those named, and step them in MuJoCo. Needs rlacd[sim].

    \b
    python -m benchmarks robots $(python -c "import example_robot_data as e; print(e.path)") --out RUN
    """
    with exit_codes():
        paths = [folder / name for name in robots] or sorted(path for path in folder.rglob("*") if is_robot(path))
        rows = []
        for path in paths:
            try:
                row = measure(path, {"quality": quality}, [*packages], out)
            except (RlacdError, ValueError) as error:
                click.echo(f"{path.stem}: {error}")
                continue
            if row["whole"]["links"]:
                rows.append(row)
                click.echo(_line(row))
        click.echo(Table(HEAD, [_line(row) for row in rows]))
        for what, one, other in (
            ("hulls a link", ("whole", "hulls"), ("whole", "links")),
            ("hulls, own scale / now", ("own", "hulls"), ("whole", "hulls")),
            ("steps a second, now / own scale", ("whole", "speed"), ("own", "speed")),
            ("CPU seconds, now / own scale", ("whole", "cpu"), ("own", "cpu")),
        ):
            values = ([row[way][key] for row in rows] for way, key in (one, other))
            click.echo(f"{what}, geometric mean: {Ratio.of(*values)}")
