"""The methods compared: every tool behind one interface, with one setting that controls how tight its hulls are.

========================  ============================================  =======================================
name                      tool                                          setting
========================  ============================================  =======================================
``coacd``                 CoACD, default options                        concavity threshold
``vhacdx``                V-HACD 4, up to 1,024 hulls                   volume error, percent
``vhacdx:hulls``          V-HACD 4, default options                     most hulls
``POLICY[:QUALITY]``      rlacd; see `rlacd.policies.make_policy`       concavity threshold
``POLICY:space[:...]``    rlacd with the navigable space criterion      tolerance; the radius is half of it
``planes[:...]``          the paper's deployment; see `deployed`        concavity threshold
========================  ============================================  =======================================

Lengths are in the frame where the longest side is 2.
"""

from __future__ import annotations

import importlib.metadata
from collections.abc import Callable
from dataclasses import dataclass
from typing import TypeAlias

import numpy as np

from benchmarks.deployed import Deployment, decompose_as_deployed
from rlacd.errors import MissingExtraError, OptionError
from rlacd.options import QUALITIES
from rlacd.policies import is_policy
from rlacd.solid.arrays import FloatArray, IntArray

RawHull: TypeAlias = tuple[FloatArray, IntArray]
"""Vertices [V, 3] and faces [F, 3] of a hull as a tool returned it, in the input's frame and unit."""

Run: TypeAlias = Callable[[FloatArray, IntArray, float, int], list[RawHull]]
"""(vertices, faces, setting, threads) -> hulls."""

STEPS = {"balanced": 24, "best": 100}
"""Steps of the search: a time budget, the default of ``best``, would make results depend on the machine."""

MOST_VHACD_HULLS = 1024
"""Hull limit of V-HACD when its setting is the volume error: ten levels of halving."""


@dataclass(frozen=True)
class Method:
    """A tool with all options but its setting fixed.

    Attributes
    ----------
    name : str
    version : str
        Version of its package.
    setting : str
        Meaning of its setting: "threshold", "tolerance", "percent" or "hulls".
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

    @property
    def falls(self) -> bool:
        """Whether a larger setting asks for tighter hulls."""
        return self.setting == "hulls"

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
    base, *tags = name.split(":")
    if name == "coacd":
        return Method(name, _version("coacd"), "threshold", 0.05, _coacd)
    if name == "vhacdx":
        return Method(name, _version("vhacdx"), "percent", 1.0, _vhacd_by_error)
    if name == "vhacdx:hulls":
        return Method(name, _version("vhacdx"), "hulls", 64, _vhacd_by_hulls)
    if base == "planes":
        deployment = Deployment.parse(tags)
        return Method(
            name, _version("rlacd"), "threshold", 0.05, lambda v, f, t, n: decompose_as_deployed(deployment, v, f, t, n)
        )
    qualities = [tag for tag in tags if tag in QUALITIES]
    space = tags.count("space")
    if not is_policy(base) or len(qualities) > 1 or space > 1 or len(qualities) + space != len(tags):
        raise OptionError(
            f"there is no method {name!r}; it has to be coacd, vhacdx, vhacdx:hulls, planes[:...], or a policy of "
            "rlacd, if need be followed by :balanced or :best and by :space."
        )
    return Method(
        name,
        _version("rlacd"),
        "tolerance" if space else "threshold",
        0.1 if space else 0.05,
        _rlacd(base, qualities[0] if qualities else "fast", bool(space)),
    )


def _version(package: str) -> str:
    try:
        return importlib.metadata.version(package)
    except importlib.metadata.PackageNotFoundError as error:
        raise MissingExtraError(
            f"{package} is not installed: run  pip install 'rlacd[bench]'  and try again."
        ) from error


def _coacd(vertices: FloatArray, faces: IntArray, number: float, threads: int) -> list[RawHull]:
    import coacd

    coacd.set_log_level("error")
    found = coacd.run_coacd(coacd.Mesh(vertices, faces), threshold=number)
    return [_as_arrays(v, f) for v, f in found]


def _vhacd_by_error(vertices: FloatArray, faces: IntArray, number: float, threads: int) -> list[RawHull]:
    return _vhacd(vertices, faces, threads, minimumVolumePercentErrorAllowed=number, maxConvexHulls=MOST_VHACD_HULLS)


def _vhacd_by_hulls(vertices: FloatArray, faces: IntArray, number: float, threads: int) -> list[RawHull]:
    return _vhacd(vertices, faces, threads, maxConvexHulls=round(number))


def _vhacd(vertices: FloatArray, faces: IntArray, threads: int, **options: float) -> list[RawHull]:
    import vhacdx

    # vhacdx takes faces in VTK's flat layout: a count of 3 before each triangle.
    counted = np.column_stack([np.full(len(faces), 3), faces]).astype(np.uint32).ravel()
    found = vhacdx.compute_vhacd(np.asarray(vertices, dtype=np.float64), counted, asyncACD=threads > 1, **options)
    return [_as_arrays(v, np.asarray(f).reshape(-1, 3)) for v, f in found]


def _rlacd(policy: str, quality: str, space: bool) -> Run:
    def run(vertices: FloatArray, faces: IntArray, number: float, threads: int) -> list[RawHull]:
        from rlacd.criteria import NavigableSpace
        from rlacd.decompose_mesh import decompose

        if space:
            goal: dict[str, object] = {"criterion": NavigableSpace(number / 4, number / 2)}  # shares of the side
        else:
            goal = {"threshold": number}
        result = decompose(
            (vertices, faces),
            policy=policy,
            quality=quality,  # type: ignore[arg-type]
            search_steps=STEPS.get(quality),
            threads=threads,
            **goal,  # type: ignore[arg-type]
        )
        return [_as_arrays(hull.vertices, hull.faces) for hull in result]

    return run


def _as_arrays(vertices: object, faces: object) -> RawHull:
    return np.array(vertices, dtype=np.float64), np.array(faces, dtype=np.int32)
