"""The page's scene: a decomposition as plain values, with arrays as base64 text.

Positions are float32 in the normalised frame, which keeps them small for inputs of any unit and position.
"""

from __future__ import annotations

import base64
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from rlacd.fit import Unit
from rlacd.result import Result
from rlacd.solid.frame import Frame
from rlacd.solid.hull import PRIMITIVE
from rlacd.viewer.coloring import color_hulls
from rlacd.viewer.heat import HeatMesh, frame_of
from rlacd.viewer.picture import disjoint
from rlacd.viewer.robot import RobotResult, robot_scene


def scene(decomposition: Result, up: str = "z") -> dict[str, Any]:
    """Describe a decomposition for the page.

    Parameters
    ----------
    decomposition : Result
    up : {"x", "y", "z"}
        The axis of the input that points up.

    Returns
    -------
    dict
        ``name``; ``up``; ``unit``, the ``name`` and ``length`` in the frame of the unit in which lengths are told;
        ``scale``, frame units per unit of the input; the unchanged ``report``; ``input``, a
        list of ``{vertices, faces}``: of each link of a robot, else one, or none for a cloud of points; ``parts``, a
        list of ``{vertices, faces, color, rank, error, volume, primitive, link}`` with ``rank`` the index of the hue,
        ``error`` the criterion's measurement (or None), ``volume`` in the normalised frame, ``primitive`` its kind (or
        None) and ``link`` the number of a robot's link (or None); ``kept``, a list of ``{vertices, faces, link}`` of a
        robot's primitives, which stay beside the hulls; ``balls``, ``{centres, radii, shown, of}`` or None,
        with the numbers of balls shown and in all; ``robot``, how it moves, or None.
    """
    frame = frame_of(decomposition)
    source, report = decomposition.source, decomposition.report
    fit = report.fit
    errors: list[float | None] = list((fit and fit.per_part) or [])
    errors = errors if len(errors) == len(decomposition) else [None] * len(decomposition)
    rgb, ranks = color_hulls(decomposition.hulls)
    balls = None
    if decomposition.balls is not None and len(decomposition.balls):
        some = disjoint(decomposition.balls)
        shown = min(len(some), 4000)  # more are slow to draw
        centres, radii = frame.to_frame(some.centres[:shown]), some.radii[:shown] * frame.scale
        balls = {"centres": floats(centres), "radii": floats(radii), "shown": shown, "of": len(decomposition.balls)}
    robot = decomposition if isinstance(decomposition, RobotResult) else None
    bare = input_scene(decomposition.name, source.vertices, source.faces, up, report.unit, frame)
    links: list[int] | list[None] = [None] * len(rgb) if robot is None else [*robot.link_of]
    return {
        **bare,
        "input": bare["input"] if robot is None else [_mesh(frame.to_frame(m.vertices), m.faces) for m in robot.meshes],
        "robot": None if robot is None else robot_scene(robot, frame),
        "report": report,
        "kept": [
            {**_mesh(frame.to_frame(mesh.vertices), mesh.faces), "link": link}
            for link, own in enumerate([] if robot is None else robot.kept)
            for mesh in own
        ],
        "parts": [
            {
                **_mesh(frame.to_frame(hull.vertices), hull.faces),
                "color": "#" + bytes(color.tolist()).hex(),
                "rank": int(rank),
                "error": error,
                "volume": float(hull.volume) * frame.scale**3,
                "primitive": hull.metadata.get(PRIMITIVE, {}).get("kind"),
                "link": link,
            }
            for hull, color, rank, error, link in zip(decomposition, rgb, ranks, errors, links, strict=True)
        ],
        "balls": balls,
    }


def input_scene(
    name: str, vertices: ArrayLike, faces: ArrayLike, up: str, unit: Unit, frame: Frame | None = None
) -> dict[str, Any]:
    """Describe an input without hulls yet: as `scene`, without parts or report."""
    points, corners = np.asarray(vertices, dtype=np.float64), np.asarray(faces)
    frame = frame or Frame.of(points[np.unique(corners)] if len(corners) else points)
    return {
        "name": name,
        "up": up,
        "unit": {"name": unit.name, "length": unit.scaled(frame.scale).length_abs},
        "scale": frame.scale,
        "report": None,
        "input": [_mesh(frame.to_frame(points), corners)] if len(corners) else [],
        "robot": None,
        "kept": [],
        "parts": [],
        "balls": None,
    }


def heat_scene(heat: list[HeatMesh]) -> dict[str, Any]:
    """Describe an error heat map for the page.

    Returns
    -------
    dict
        ``parts``, a list of ``{vertices, faces, distance}``, and ``max``, the largest distance in the normalised frame.
    """
    return {
        "parts": [{**_mesh(part.vertices, part.faces), "distance": floats(part.distance)} for part in heat],
        "max": max((float(part.distance.max()) for part in heat), default=0.0),
    }


def floats(values: ArrayLike) -> str:
    """Base64 of little-endian float32."""
    return base64.b64encode(np.asarray(values).astype("<f4").tobytes()).decode("ascii")


def _mesh(vertices: ArrayLike, faces: ArrayLike) -> dict[str, str]:
    corners = np.asarray(faces).astype("<u4").tobytes()
    return {"vertices": floats(vertices), "faces": base64.b64encode(corners).decode("ascii")}
