"""Where robots' hulls touch worst though the links do not: a film of the way there and back, as a GIF.

The file before and the one now are read again, so that what is drawn is what simulators get.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import trimesh
from numpy.typing import NDArray

from rlacd.clear import Body, Motion, check
from rlacd.io.robots.read import read_robot
from rlacd.io.robots.robot import Robot, turned
from rlacd.solid.arrays import FloatArray
from rlacd.viewer.render import Body as Drawn
from rlacd.viewer.render import render_apart

SIZE, SAMPLES, FRAMES, PACE, COLORS = 300, 48, 10, 0.08, 48
"""Pixels of a side of a panel, light paths of each, frames of the way, seconds between them, colours of the film."""

FROM, SHADE = 0.5, 0.25
"""Where the way from rest to the worst position begins, and how much darker the next of three links is."""

WRONG, RIGHT = np.array([0.75, 0.02, 0.02]), np.array([0.3, 0.5, 0.75])
"""Linear colours of hulls of links that touch though they do not in the input, and of others, in shades."""


def film(path: Path, robots: Sequence[tuple[Path, Mapping[str, Path]]], packages: Sequence[str]) -> None:
    """Write the film: a line for each robot, a column for each way: a file, by its caption."""
    from PIL import Image, ImageDraw, ImageFont

    lines = []
    for source, ways in robots:
        panels = [*_panels(read_robot(source, packages), [*ways.values()], packages)]
        lines.append([np.concatenate(row, axis=1) for row in zip(*panels, strict=True)])
    pictures = []
    for rows in zip(*lines, strict=True):
        picture = Image.fromarray(np.concatenate(rows))
        for y, (_, ways) in enumerate(robots):
            for x, caption in enumerate(ways):
                font = ImageFont.load_default(size=14)
                ImageDraw.Draw(picture).text((SIZE * x + 8, SIZE * y + 6), caption, font=font, fill="black")
        pictures.append(picture)
    palette = pictures[-1].quantize(COLORS, dither=Image.Dither.NONE)
    shown = [each.quantize(palette=palette, dither=Image.Dither.NONE) for each in pictures]
    there, stays = [round(1000 * PACE)] * (len(shown) - 1), [1200]
    shown, durations = [*shown, *shown[-2:0:-1]], [*there, *stays, *there[1:]]
    shown[0].save(path, save_all=True, append_images=shown[1:], duration=durations, loop=0, optimize=True)


def _panels(robot: Robot, ways: Sequence[Path], packages: Sequence[str]) -> Iterator[list[NDArray[np.uint8]]]:
    """The frames of each way, to where that of the first is worst."""
    from benchmarks.robots import POSITIONS, SEED, moving

    motion = robot.motion(POSITIONS, SEED)
    each = [moving(robot, motion, _hulls(read_robot(way, packages, apart=True))) for way in ways]
    found = [touching for touching in check(each[0], motion).values() if touching.offences]
    worst = max(found, key=lambda touching: touching.depth).offences[0].sample if found else 0
    rest, away = motion.positions[0], motion.positions[worst]
    steps = [motion.at((rest + share * (away - rest)).tolist()) for share in np.linspace(FROM, 1, FRAMES)]
    all_of_it = np.concatenate([mesh.vertices for at in steps for mesh in robot.shapes(_poses(robot, at))])
    for bodies in each:
        drawn = render_apart([(_scene(bodies, at, all_of_it), None) for at in steps], SIZE, SIZE, SAMPLES)
        yield [_on_white(picture) for picture in drawn]


def _poses(robot: Robot, motion: Motion) -> list[FloatArray]:
    return [*motion.poses[0, : len(robot.bodies)]]


def _hulls(robot: Robot) -> dict[str, list[trimesh.Trimesh]]:
    """The meshes of a robot's links, in the frames of these."""
    return {body.name: [turned(one.meshes[0].to_body, one.mesh()) for one in body.colliders] for body in robot.bodies}


def _scene(bodies: Sequence[Body], motion: Motion, framed: FloatArray) -> list[Drawn]:
    """What is drawn where the links are, and points that the picture has to hold."""
    wrong = {number for pair, found in check(bodies, motion).items() if found.offences for number in pair}
    scene = [Drawn(np.repeat(framed[:, None], 3, axis=1), RIGHT)]
    for number, (body, pose) in enumerate(zip(bodies, motion.poses[0], strict=True)):
        own = [turned(pose, trimesh.Trimesh(one.vertices, one.faces, process=False)) for one in body.shapes]
        color = (1 - SHADE * (number % 3)) * (WRONG if number in wrong else RIGHT)
        scene += [Drawn(np.asarray(mesh.triangles), color) for mesh in own]
    return scene


def _on_white(picture: Any) -> NDArray[np.uint8]:
    color, covered = picture[..., :3], picture[..., 3:] / 255
    return np.asarray(np.rint(color * covered + 255 * (1 - covered)), np.uint8)
