"""Meshes that are one mesh in several places: moved, turned, mirrored or scaled."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from rlacd.solid.arrays import FloatArray, dots, heights, length
from rlacd.solid.component import Component, Part
from rlacd.solid.frame import ROUNDING, Frame
from rlacd.solid.hull import Hull
from rlacd.solid.input_mesh import InputMesh


@dataclass(frozen=True)
class Similarity:
    """What maps the vertices of one mesh onto those of its twin.

    Attributes
    ----------
    frames : tuple of Frame
        Of the mesh and of its twin.
    origins : tuple of float64 [3]
        A vertex of the mesh and of its twin, in their frames.
    rows : float64 [3, 3]
        An orthogonal matrix times `ratio`, from frame to frame.
    ratio : float
        How much larger the twin is in its frame than the mesh in its own.
    """

    frames: tuple[Frame, Frame]
    origins: tuple[FloatArray, FloatArray]
    rows: FloatArray
    ratio: float

    @classmethod
    def between(cls, one: InputMesh, other: InputMesh) -> Similarity | None:
        """Find it from four vertices; None if it does not map all to within rounding. The meshes have equal faces."""
        frames = Frame.of(one.vertices), Frame.of(other.vertices)
        points, there = (f.to_frame(mesh.vertices) for f, mesh in zip(frames, (one, other), strict=True))
        points, there, origins = points - points[0], there - there[0], (points[0], there[0])
        axes, others = _axes(points, chosen := _spread(points)), _axes(there, chosen)
        if axes is None or others is None:
            return None
        if heights(points, axes)[chosen[2], 2] * heights(there, others)[chosen[2], 2] < 0:
            others[2] *= -1  # a mirror image
        ratio = length(there[chosen[0]]) / length(points[chosen[0]])
        rows = ratio * np.stack([heights(others.T, axes[:, i].copy()) for i in range(3)], axis=1)
        if np.abs(heights(points, rows) - there).max() > ROUNDING:
            return None
        return cls(frames, origins, rows, ratio)

    @property
    def factor(self) -> float:
        """How much larger the twin is."""
        return self.ratio * self.frames[0].scale / self.frames[1].scale

    def __call__(self, points: FloatArray) -> FloatArray:
        """Move points [N, 3], in the input's unit."""
        moved = heights(self.frames[0].to_frame(points) - self.origins[0], self.rows) + self.origins[1]
        return self.frames[1].to_input(moved)

    def moved(self, corners: Sequence[FloatArray], whole: Component, frame: Frame) -> list[Part] | None:
        """Parts of the twin's solid, in its frame, for hulls of such corners [N, 3]; None if one becomes flat."""
        hulls = [hull for each in corners if (hull := Hull.of(frame.to_frame(self(each)))) is not None]
        return [Part(hull, (), whole) for hull in hulls] if len(hulls) == len(corners) else None


def _spread(points: FloatArray) -> tuple[int, int, int]:
    """The points [N, 3] farthest from the first, which is 0, from the line through both, from the plane through all."""
    first = int(dots(points, points).argmax())
    across = np.cross(points, points[first])
    second = int(dots(across, across).argmax())
    return first, second, int(np.abs(heights(points, across[second])).argmax())


def _axes(points: FloatArray, chosen: tuple[int, int, int]) -> FloatArray | None:
    """An orthonormal basis [3, 3], one axis a row, of the plane of 0 and two points, and its normal; None without."""
    along, normal = points[chosen[0]], np.cross(points[chosen[0]], points[chosen[1]])
    if not (length(along) > 0 and length(normal) > 0):
        return None
    along, normal = along / length(along), normal / length(normal)
    return np.stack([along, np.cross(normal, along), normal])


def twins(meshes: Sequence[InputMesh], *, of_one_size: bool) -> list[int]:
    """For each mesh the number of the twin that is largest in its own frame, where lengths mean the least; or its own.

    Parameters
    ----------
    meshes : sequence of InputMesh
    of_one_size : bool
        Whether twins of other sizes are none.
    """
    alike: dict[bytes, list[dict[int, float]]] = {}
    for number, mesh in enumerate(meshes):
        groups = alike.setdefault(np.sort(mesh.faces, axis=1).tobytes(), [])
        for group in groups:
            found = Similarity.between(meshes[next(iter(group))], mesh)
            if found is not None and (not of_one_size or math.isclose(found.factor, 1.0, rel_tol=ROUNDING)):
                group[number] = found.ratio
                break
        else:
            groups.append({number: 1.0})
    leaders = list(range(len(meshes)))
    for group in (group for groups in alike.values() for group in groups):
        largest = (1 - ROUNDING) * max(group.values())
        leader = next(number for number, ratio in group.items() if ratio >= largest)
        for number in group:
            leaders[number] = leader
    return leaders
