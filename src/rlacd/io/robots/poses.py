"""Rigid transforms ``[4, 4]``, and how URDF and MJCF write them."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from trimesh.transformations import euler_matrix, quaternion_matrix, rotation_matrix

from rlacd.errors import MeshFileError
from rlacd.solid.arrays import FloatArray
from rlacd.solid.poses import product, rounded

AXES = {"x": (1.0, 0.0, 0.0), "y": (0.0, 1.0, 0.0), "z": (0.0, 0.0, 1.0)}


def at(position: Sequence[float], rotation: FloatArray) -> FloatArray:
    """The pose of a position ``[3]`` and a rotation ``[4, 4]``."""
    pose = rounded(rotation)
    pose[:3, 3] = position
    return pose


def numbers(attributes: Mapping[str, str], name: str, count: int, where: str) -> list[float] | None:
    """Read an attribute of `count` numbers; None if it is not there.

    Raises
    ------
    MeshFileError
        It is not that.
    """
    if (text := attributes.get(name)) is None:
        return None
    try:
        values = [float(word) for word in text.split()]
    except ValueError:
        values = []
    if len(values) != count or not all(map(math.isfinite, values)):
        raise MeshFileError(f"the {name} {text!r} in {where} is not {count} finite numbers: correct it.")
    return values


def read_scale(text: str | None, where: str) -> FloatArray:
    """Read three factors, or one for all axes.

    Raises
    ------
    MeshFileError
        They are not numbers, or one of them is zero.
    """
    try:
        values = [float(word) for word in (text or "1 1 1").split()]
    except ValueError:
        values = []
    values = values * 3 if len(values) == 1 else values
    if len(values) != 3 or not all(0 < abs(value) < float("inf") for value in values):
        raise MeshFileError(f"the scale {text!r} in {where} is not three numbers other than zero.")
    return np.array(values)


def urdf_origin(attributes: Mapping[str, str], where: str) -> FloatArray:
    """The pose that an ``<origin>`` of a URDF states: roll, pitch and yaw about fixed axes."""
    angles = numbers(attributes, "rpy", 3, where) or [0.0] * 3
    return at(numbers(attributes, "xyz", 3, where) or [0.0] * 3, euler_matrix(*angles, "sxyz"))


@dataclass(frozen=True)
class Angles:
    """How an MJCF model gives angles: in degrees or radians; and the axes of ``euler``, capital if fixed."""

    in_degrees: bool = True
    sequence: str = "xyz"

    def pose(self, attributes: Mapping[str, str], where: str) -> FloatArray:
        """The pose that an element states by ``pos`` and one of five ways to say how it is turned."""
        return at(numbers(attributes, "pos", 3, where) or [0.0] * 3, self._rotation(attributes, where))

    def _rotation(self, attributes: Mapping[str, str], where: str) -> FloatArray:
        unit = math.pi / 180 if self.in_degrees else 1.0
        if (axis := numbers(attributes, "axisangle", 4, where)) is not None:
            return np.asarray(rotation_matrix(axis[3] * unit, axis[:3]))
        if (both := numbers(attributes, "xyaxes", 6, where)) is not None:
            x, y = np.array(both[:3]), np.array(both[3:])
            return _of_axes(x, y - x * (x * y).sum() / (x * x).sum())
        if (direction := numbers(attributes, "zaxis", 3, where)) is not None:
            z = np.array(direction) / np.linalg.norm(direction)
            across = np.cross((0.0, 0.0, 1.0), z)
            angle = math.atan2(float(np.linalg.norm(across)), float(z[2]))
            return np.asarray(rotation_matrix(angle, across if across.any() else (1.0, 0.0, 0.0)))
        if (turns := numbers(attributes, "euler", 3, where)) is not None:
            whole = np.eye(4)
            for letter, turn in zip(self.sequence, turns, strict=False):
                one = np.asarray(rotation_matrix(turn * unit, AXES[letter.lower()]))
                whole = product(whole, one) if letter.islower() else product(one, whole)
            return whole
        quaternion = numbers(attributes, "quat", 4, where)
        return np.eye(4) if quaternion is None else np.asarray(quaternion_matrix(quaternion))


def _of_axes(x: FloatArray, y: FloatArray) -> FloatArray:
    rotation = np.eye(4)
    x, y = x / np.linalg.norm(x), y / np.linalg.norm(y)
    rotation[:3, :3] = np.stack([x, y, np.cross(x, y)], axis=1)
    return rotation
