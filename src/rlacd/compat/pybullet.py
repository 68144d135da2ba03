"""PyBullet's `vhacd` (pybullet 3.2.7, with V-HACD 2.2), done by rlacd.

``pybullet.vhacd(...)`` becomes ``vhacd(...)`` after ``from rlacd.compat.pybullet import vhacd``.
"""

from __future__ import annotations

import warnings
from pathlib import Path

import numpy as np
import trimesh

from rlacd.compat import warn_unused
from rlacd.decompose_mesh import decompose
from rlacd.io.write.atomic import write_file
from rlacd.options.fields import integer, number, read

__all__ = ["vhacd"]

_UNUSED = {
    **dict.fromkeys(("alpha", "beta", "planeDownsampling", "convexhullDownsampling"), "it searches for the best plane"),
    "gamma": "it unites parts within the same concavity",
    **dict.fromkeys(("minVolumePerCH", "convexhullApproximation"), "its hulls are exact"),
    **dict.fromkeys(("resolution", "mode"), "it uses neither voxels nor tetrahedra"),
    "depth": "it cuts until every part is tight",
    "pca": "it tries planes along the principal axes anyway",
    "physicsClientId": "it needs no physics server",
}


def vhacd(
    fileNameIn: str,
    fileNameOut: str,
    fileNameLogging: str,
    concavity: float = 0.001,
    alpha: float = 0.05,
    beta: float = 0.05,
    gamma: float = 0.0005,
    minVolumePerCH: float = 0.0001,
    resolution: int = 1000000,
    maxNumVerticesPerCH: int = 64,
    depth: int = 20,
    planeDownsampling: int = 4,
    convexhullDownsampling: int = 4,
    pca: int = 0,
    mode: int = 0,
    convexhullApproximation: int = 1,
    physicsClientId: int = 0,
) -> None:
    """Decompose a file as ``pybullet.vhacd`` does: same arguments, same defaults, an OBJ with an object per hull.

    Parameters
    ----------
    fileNameIn : str
        Any mesh file that rlacd reads.
    fileNameOut : str
        The OBJ file; or any other file of hulls that rlacd writes.
    fileNameLogging : str
        A text file: what was made.
    concavity : float
        The volume that a hull may add, as a share of that of the whole mesh's convex hull.
    maxNumVerticesPerCH : int
        Maximum number of vertices per hull.
    alpha, beta, gamma, minVolumePerCH, resolution, depth, planeDownsampling, convexhullDownsampling, pca, mode, \
convexhullApproximation, physicsClientId
        Accepted but unused; a warning explains this once.
    """
    warn_unused(vhacd, locals(), _UNUSED)
    result = decompose(
        fileNameIn,
        criterion="volume",
        volume_tolerance=min(max(read(number(0), "concavity", concavity) * _hull_share(fileNameIn), 1e-4), 10.0),
        volume_of="whole",
        max_vertices=read(integer(4), "maxNumVerticesPerCH", maxNumVerticesPerCH),
    )
    result.save(fileNameOut)
    lines = [f"{fileNameIn} -> {fileNameOut}", *result.facts(), *result.report.warnings]
    write_file(Path(fileNameLogging), "".join(f"{line}\n" for line in lines).encode())


def _hull_share(path: str) -> float:
    """The volume of the convex hull by that of the repaired solid, rounded to what all processors agree on."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # the decomposition proper says them
        rough = decompose(path, criterion="volume", volume_tolerance=10.0, volume_of="whole", quality="fast")
    whole = trimesh.convex.convex_hull(np.concatenate([hull.vertices for hull in rough]))
    return round(float(whole.volume / rough.report.mass.volume_abs), 6)
