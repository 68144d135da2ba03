"""A film of tasks in MuJoCo, side by side with the hulls of two tools, as a GIF."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import trimesh

from benchmarks.engines import STEP, Hulls, InMujoco
from benchmarks.tasks import TASKS
from rlacd.solid.arrays import FloatArray

SIZE, PACE, COLORS = 300, 0.05, 48
"""Pixels of a side of a panel, seconds between frames, colours."""

SHOWN: dict[str, tuple[Sequence[float], float, float, float, float]] = {
    "gears that mesh": ((0.05, 0.0, 0.05), 0.42, 90.0, -55.0, 2.4),
    "mug on hook": ((-0.01, -0.03, 0.25), 0.45, 60.0, -35.0, 2.4),
}
"""Each task, where the camera looks, its distance, azimuth, elevation, and how many seconds are shown."""


def film(path: Path, exact: Mapping[str, trimesh.Trimesh], ways: Mapping[str, Hulls]) -> None:
    """Write the film: a line of panels for each task, a column for each tool."""
    from PIL import Image

    lines = [[_frames(task, exact, hulls) for hulls in ways.values()] for task in SHOWN]
    many = min(len(frames) for line in lines for frames in line)
    joined = [
        np.concatenate([np.concatenate([frames[n] for frames in line], axis=1) for line in lines]) for n in range(many)
    ]
    last = [joined[-1]] * 20
    pictures = [Image.fromarray(each).quantize(COLORS, dither=Image.Dither.NONE) for each in [*joined, *last]]
    pictures[0].save(
        path, save_all=True, append_images=pictures[1:], duration=round(1000 * PACE), loop=0, optimize=True
    )


def _frames(task: str, exact: Mapping[str, trimesh.Trimesh], hulls: Hulls) -> list[FloatArray]:
    import mujoco

    where, distance, azimuth, elevation, seconds = SHOWN[task]
    world = InMujoco(TASKS[task](), exact, hulls)
    _paint(world)
    camera = mujoco.MjvCamera()
    camera.lookat[:] = where
    camera.distance, camera.azimuth, camera.elevation = distance, azimuth, elevation
    frames: list[Any] = []
    with mujoco.Renderer(world.model, SIZE, SIZE) as renderer:
        for step in range(round(seconds / STEP)):
            world.step()
            if step % round(PACE / STEP) == 0:
                renderer.update_scene(world.data, camera)
                frames.append(renderer.render())
    return frames


def _paint(world: InMujoco) -> None:
    """A hue for each body, a shade of it for each hull; the floor is white."""
    model, shades = world.model, np.random.default_rng(3).uniform(0.75, 1.0, world.model.ngeom)
    for geom, shade in enumerate(shades):
        turn = 2 * np.pi * (0.381966 * model.geom_bodyid[geom] + np.array([0, 1 / 3, 2 / 3]))  # the golden angle
        model.geom_rgba[geom, :3] = shade * (0.65 + 0.3 * np.cos(turn))
    world.model.geom_rgba[0] = (0.93, 0.93, 0.93, 1)
    world.model.vis.headlight.ambient[:] = 0.4
    world.model.vis.headlight.diffuse[:] = 0.5
