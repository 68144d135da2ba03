"""Path-traced pictures of meshes on a transparent background, on any CPU.

Mitsuba 3 renders without a display, GPU or OpenGL library, so it also works in a bare container, where VTK's wheels
find no OpenGL and abort the process. It runs in a process of its own: the renderer keeps Python's lock, and all other
threads would stand still; and other libraries disturb it: CoACD hides its plugins.
"""

from __future__ import annotations

import os
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from rlacd.errors import OutputError, import_extra
from rlacd.io.read.apart import Answered, served
from rlacd.io.write.palette import srgb_from_linear
from rlacd.pool import Blobs, ProcessLimits, Request, Values, WorkerDiedError
from rlacd.pool.local import Worker

FIELD_OF_VIEW = 22.0  # degrees, vertical; narrow, so that perspective barely changes the size of equal hulls
ELEVATION, AZIMUTH = np.deg2rad(24.0), np.deg2rad(-58.0)


@dataclass(frozen=True)
class Body:
    """A mesh to draw: triangles [F, 3, 3], z up, and its linear RGB reflectance [3]."""

    triangles: npt.NDArray[np.float64]
    color: npt.NDArray[np.float64]


@dataclass(frozen=True)
class Spheres:
    """Spheres to draw: centres [B, 3], radii [B], z up, and their linear RGB reflectance [3]."""

    centres: npt.NDArray[np.float64]
    radii: npt.NDArray[np.float64]
    color: npt.NDArray[np.float64]


def render(
    bodies: Sequence[Body],
    width: int,
    height: int,
    *,
    samples: int,
    spheres: Spheres | None = None,
) -> npt.NDArray[np.uint8]:
    """Render `bodies`, framed to fit, as sRGB bytes and coverage [height, width, 4]; deterministic.

    Parameters
    ----------
    bodies : sequence of Body
        Of any size and position; the camera frames them.
    width, height : int
        Pixels.
    samples : int
        Light paths per pixel: more are slower and less grainy.
    spheres : Spheres, optional
        Drawn too, but ignored by the camera's framing.

    Raises
    ------
    MissingExtraError
        Mitsuba is not installed.
    """
    mi = import_extra("mitsuba", "a picture", "view")
    mi.set_variant("scalar_rgb")  # needs no compiler at run time
    points = np.concatenate([body.triangles.reshape(-1, 3) for body in bodies])
    low, high = points.min(axis=0), points.max(axis=0)
    view = _view(points - (low + high) / 2.0, width / height)
    # The scene is centred and scaled, since the renderer computes in float32.
    size = float(np.linalg.norm(high - low)) or 1.0
    scene: dict[str, Any] = {
        "type": "scene",
        "integrator": {"type": "path", "max_depth": 3, "hide_emitters": True},
        "sensor": _sensor(mi, view / size, width, height),
        "sky": {"type": "constant", "radiance": {"type": "rgb", "value": 0.42}},
        "key": _lamp(mi),
    }
    for index, body in enumerate(bodies):
        placed = (body.triangles - (low + high) / 2.0) / size
        scene[f"body_{index}"] = _mesh(mi, placed, body.color)
    if spheres is not None:
        surface = {"type": "diffuse", "reflectance": {"type": "rgb", "value": spheres.color.tolist()}}
        centres = ((spheres.centres.reshape(-1, 3) - (low + high) / 2.0) / size).tolist()
        for index, (centre, radius) in enumerate(zip(centres, (spheres.radii / size).tolist(), strict=True)):
            scene[f"sphere_{index}"] = {"type": "sphere", "center": centre, "radius": radius, "surface": surface}
    light = np.array(mi.render(mi.load_dict(scene), spp=samples))
    covered = np.clip(light[..., 3:], 0.0, 1.0)
    colors = srgb_from_linear(np.clip(light[..., :3] / np.maximum(covered, 1e-6), 0.0, 1.0))
    return np.concatenate([colors, np.rint(255.0 * covered).astype(np.uint8)], axis=2)


def _view(points: npt.NDArray[np.float64], aspect: float) -> npt.NDArray[np.float64]:
    """Camera position from which all `points` (about the origin) are inside the picture."""
    toward_eye = np.array([np.cos(ELEVATION) * np.cos(AZIMUTH), np.cos(ELEVATION) * np.sin(AZIMUTH), np.sin(ELEVATION)])
    right = np.cross([0.0, 0.0, 1.0], toward_eye)
    right /= np.linalg.norm(right)
    up = np.cross(toward_eye, right)
    half = 0.92 * np.tan(np.deg2rad(FIELD_OF_VIEW) / 2.0)  # a margin of 8%
    # A point is inside if |up . p| <= half * depth, depth = distance - toward_eye . p; likewise to the right.
    needed = np.maximum(np.abs(points @ up) / half, np.abs(points @ right) / (half * aspect)) + points @ toward_eye
    eye: npt.NDArray[np.float64] = toward_eye * needed.max()
    return eye


def _sensor(mi: Any, eye: npt.NDArray[np.float64], width: int, height: int) -> dict[str, Any]:
    film: dict[str, Any] = {"type": "hdrfilm", "pixel_format": "rgba", "rfilter": {"type": "gaussian"}}
    return {
        "type": "perspective",
        "fov": FIELD_OF_VIEW,
        "fov_axis": "y",
        "near_clip": 1e-3,
        "far_clip": 1e4,
        "to_world": mi.ScalarTransform4f().look_at(origin=eye.tolist(), target=[0, 0, 0], up=[0, 0, 1]),
        "film": film | {"width": width, "height": height},
        "sampler": {"type": "multijitter"},
    }


def _lamp(mi: Any) -> dict[str, Any]:
    """Beside the uniform sky, one lamp gives the shadows a direction."""
    position = [1.2, -2.2, 3.2]
    facing = mi.ScalarTransform4f().look_at(origin=position, target=[0, 0, 0], up=[0, 1, 0])
    light = {"type": "area", "radiance": {"type": "rgb", "value": 12.0}}
    return {"type": "rectangle", "to_world": facing @ mi.ScalarTransform4f().scale(1.1), "light": light}


def _mesh(mi: Any, triangles: npt.NDArray[np.float64], color: npt.NDArray[np.float64]) -> Any:
    # Two-sided: the input's triangles may be oriented either way.
    surface = {"type": "diffuse", "reflectance": {"type": "rgb", "value": color.tolist()}}
    properties = mi.Properties()
    properties["bsdf"] = mi.load_dict({"type": "twosided", "surface": surface})
    properties["face_normals"] = True
    mesh = mi.Mesh("body", vertex_count=3 * len(triangles), face_count=len(triangles), props=properties)
    arrays = mi.traverse(mesh)
    arrays["vertex_positions"] = triangles.astype(np.float32).ravel()
    arrays["faces"] = np.arange(3 * len(triangles), dtype=np.uint32)
    arrays.update()
    return mesh


SERVER = "rlacd.viewer.render:draw"


def render_apart(
    scenes: Sequence[tuple[Sequence[Body], Spheres | None]], width: int, height: int, samples: int
) -> list[npt.NDArray[np.uint8]]:
    """Do what `render` does for each scene; spheres are half transparent.

    Raises
    ------
    MissingExtraError
        Mitsuba is not installed.
    OutputError
        The process died.
    """
    how = {"width": width, "height": height, "samples": samples}
    worker, drawn = Worker(), []
    try:
        for bodies, spheres in scenes:
            arrays = [*bodies, *([] if spheres is None else [spheres])]
            blobs = {
                f"{i} {name}": array.tobytes() for i, body in enumerate(arrays) for name, array in vars(body).items()
            }
            values = {"bodies": len(bodies), "spheres": spheres is not None, "how": how}
            pixels = worker.ask(Request(SERVER, values, blobs, limits=ProcessLimits(memory=0))).blobs["pixels"]
            drawn.append(np.frombuffer(pixels, dtype=np.uint8).reshape(height, width, 4))
    except WorkerDiedError as died:
        raise OutputError(f"the picture could not be drawn: {died}.") from died
    finally:
        worker.close()
    return drawn


@served
def draw(values: Values, blobs: Blobs) -> Answered:
    """Render one scene, and leave processors to whoever else needs them."""
    if hasattr(os, "nice") and os.nice(0) == 0:
        os.nice(10)
    arrays = {name: np.frombuffer(blob) for name, blob in blobs.items()}
    count = values["bodies"]
    bodies = [Body(arrays[f"{i} triangles"].reshape(-1, 3, 3), arrays[f"{i} color"]) for i in range(count)]
    pixels = render(bodies, **values["how"])
    if values["spheres"]:
        balls = Spheres(*(arrays[f"{count} {name}"] for name in ("centres", "radii", "color")))
        pixels = ((pixels.astype(np.uint16) + render(bodies, spheres=balls, **values["how"]) + 1) // 2).astype(np.uint8)
    return {}, {"pixels": pixels.tobytes()}
