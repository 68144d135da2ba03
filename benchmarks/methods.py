"""The methods compared: every tool behind one interface, with one setting that controls how tight its hulls are.

==============================  ============================================  =====================================
name                            tool                                          setting (default)
==============================  ============================================  =====================================
``default``                     ``rlacd.decompose(mesh)``                     concavity threshold (its own)
``fast``, ``best``              the same with that ``quality``                concavity threshold (its own)
``...:OPTION=VALUE``            the same with that option, any number         concavity threshold (its own)
``...:space[=RADIUS]``          the same with navigable space                 tolerance (0.1)
``coacd``                       CoACD                                         concavity threshold (its own)
``coacd-hulls``                 CoACD at its own threshold                    most hulls (64)
``vhacd``                       V-HACD 4                                      most hulls (its own)
==============================  ============================================  =====================================

Lengths are in the frame where the longest side is 2. The default radius is half the tolerance.
"""

from __future__ import annotations

import importlib.metadata
import inspect
import json
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from typing import Any, TypeAlias

import numpy as np

from rlacd.errors import MissingExtraError, OptionError
from rlacd.options import Options
from rlacd.solid.arrays import FloatArray, IntArray

RawHull: TypeAlias = tuple[FloatArray, IntArray]
"""Vertices [V, 3] and faces [F, 3] of a hull as a tool returned it, in the input's frame and unit."""

Run: TypeAlias = Callable[[FloatArray, IntArray, float, int], list[RawHull]]
"""(vertices, faces, setting, threads) -> hulls."""

QUALITIES: dict[str, dict[str, Any]] = {"default": {}, "fast": {"quality": "fast"}, "best": {"quality": "best"}}


@dataclass(frozen=True)
class Method:
    """A tool with all options but its setting fixed.

    Attributes
    ----------
    name : str
    version : str
        Version of its package.
    setting : str
        Meaning of its setting: "threshold", "tolerance" or "hulls".
    default : float
        The default of the tool's authors.
    run : callable
        (vertices [V, 3], faces [F, 3], setting, threads) -> hulls.
    """

    name: str
    version: str
    setting: str
    default: float
    run: Run

    def concavity(self, number: float) -> float | None:
        """The concavity that the method claims to keep; None if it claims none."""
        return number if self.setting == "threshold" else None


def make_method(name: str) -> Method:
    """Find the method called `name`.

    Raises
    ------
    OptionError
        There is none.
    MissingExtraError
        The method's tool is not installed.
    """
    if name == "coacd":
        return Method(name, version_of("coacd"), "threshold", 0.05, _coacd)
    if name == "coacd-hulls":
        return Method(name, version_of("coacd"), "hulls", 64, partial(_coacd, most=True))
    if name == "vhacd":
        return Method(name, version_of("vhacdx"), "hulls", 64, _vhacd)
    setting, default = ("tolerance", 0.1) if _space(name) else ("threshold", Options.threshold)
    return Method(name, version_of("rlacd"), setting, default, _rlacd(name))


def rlacd_options(name: str) -> dict[str, Any]:
    """The options of ``rlacd.decompose`` that a name such as ``fast:max_vertices=32`` stands for.

    Raises
    ------
    OptionError
        The name stands for none.
    """
    from rlacd.decompose_mesh import decompose

    base, *words = name.split(":")
    if base not in QUALITIES:
        raise OptionError(
            f"there is no method {name!r}; it has to be default, fast or best, if need be followed by :OPTION=VALUE or "
            "by :space[=RADIUS]; or coacd, coacd-hulls, vhacd."
        )
    options = dict(QUALITIES[base])
    for word in words:
        option, is_given, value = word.partition("=")
        if option == "space":
            continue
        if not is_given or option not in inspect.signature(decompose).parameters:
            raise OptionError(
                f"{word!r} in {name!r} has to be an option of rlacd.decompose and its value, as policy=navacd."
            )
        try:
            options[option] = json.loads(value)
        except ValueError:
            options[option] = value
    return options


def _space(name: str) -> list[str]:
    """The word that asks for navigable space, if there is one."""
    return [word for word in name.split(":") if word.partition("=")[0] == "space"]


def version_of(package: str) -> str:
    """The version of an installed package."""
    try:
        return importlib.metadata.version(package)
    except importlib.metadata.PackageNotFoundError as error:
        raise MissingExtraError(f"{package} is not installed: run  pip install {package}  and try again.") from error


def _rlacd(name: str) -> Run:
    options, space = rlacd_options(name), _space(name)

    def run(vertices: FloatArray, faces: IntArray, number: float, threads: int) -> list[RawHull]:
        import rlacd

        goal: dict[str, Any] = {} if number == Options.threshold else {"threshold": number}
        if space:
            radius = float(space[0].partition("=")[2] or number / 2)
            goal = {"criterion": rlacd.NavigableSpace(radius, number)}
        result = rlacd.decompose((vertices, faces), threads=threads, **goal, **options)
        return [_as_arrays(hull.vertices, hull.faces) for hull in result]

    return run


def _coacd(vertices: FloatArray, faces: IntArray, number: float, threads: int, most: bool = False) -> list[RawHull]:
    import coacd

    coacd.set_log_level("error")
    setting = {"max_convex_hull": round(number)} if most else {"threshold": number}
    found = coacd.run_coacd(coacd.Mesh(vertices, faces), **setting)
    return [_as_arrays(v, f) for v, f in found]


def _vhacd(vertices: FloatArray, faces: IntArray, number: float, threads: int) -> list[RawHull]:
    import vhacdx

    # vhacdx takes faces in VTK's flat layout: a count of 3 before each triangle.
    counted = np.column_stack([np.full(len(faces), 3), faces]).astype(np.uint32).ravel()
    given = np.asarray(vertices, dtype=np.float64)
    found = vhacdx.compute_vhacd(given, counted, maxConvexHulls=round(number), asyncACD=threads > 1)
    return [_as_arrays(v, np.asarray(f).reshape(-1, 3)) for v, f in found]


def _as_arrays(vertices: object, faces: object) -> RawHull:
    return np.array(vertices, dtype=np.float64), np.array(faces, dtype=np.int32)
