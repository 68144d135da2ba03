"""Balls as a file: a table of numbers, or spheres to look at."""

from __future__ import annotations

import os
from pathlib import Path

import numpy as np
import trimesh

from rlacd.io.write.atomic import write_file
from rlacd.io.write.target import checked_place
from rlacd.solid.balls import Balls

COLOR = (86, 156, 214, 90)  # translucent, so that the hulls show through


def check_balls(path: str | os.PathLike[str]) -> Path:
    """Check, before any work, that balls can be written to `path`.

    Raises
    ------
    OptionError
        The ending is unknown.
    OutputError
        The place cannot be written to.
    """
    return checked_place(path, "the balls", [*_ENCODERS])


def save_balls(balls: Balls, path: str | os.PathLike[str]) -> Path:
    """Write balls to a file; see `rlacd.Decomposition.save_balls`.

    Raises
    ------
    OptionError, OutputError
        As for `check_balls`, and if the disk fails while writing.
    """
    place = check_balls(path)
    write_file(place, _ENCODERS[place.suffix.lower()](balls))
    return place


def _encode_csv(balls: Balls) -> bytes:
    rows = np.column_stack([balls.centres, balls.radii]).tolist()
    return "\n".join(["x,y,z,radius", *(",".join(map(repr, row)) for row in rows), ""]).encode("ascii")


def _encode_glb(balls: Balls) -> bytes:
    sphere = trimesh.creation.icosphere(subdivisions=1)
    corners = balls.centres[:, None] + balls.radii[:, None, None] * sphere.vertices
    faces = np.arange(len(balls))[:, None, None] * len(sphere.vertices) + sphere.faces
    mesh = trimesh.Trimesh(corners.reshape(-1, 3), faces.reshape(-1, 3), process=False)
    material = trimesh.visual.material.PBRMaterial(
        name="balls", baseColorFactor=COLOR, alphaMode="BLEND", metallicFactor=0.0, roughnessFactor=1.0
    )
    mesh.visual = trimesh.visual.TextureVisuals(material=material)
    return bytes(trimesh.Scene({"balls": mesh}).export(file_type="glb"))


_ENCODERS = {".csv": _encode_csv, ".glb": _encode_glb}
