"""Approximate convex decomposition: any mesh in, few tight convex hulls out."""

from rlacd._version import __version__
from rlacd.criteria import NavigableSpace
from rlacd.decompose import decompose
from rlacd.decomposition import Decomposition
from rlacd.errors import (
    EmptyMeshError,
    MeshDataError,
    MeshError,
    MeshFileError,
    MissingExtraError,
    OptionError,
    OutputError,
    RlacdError,
)
from rlacd.presets import PRESETS, Preset
from rlacd.progress import Progress
from rlacd.robots import Rewritten, rewrite_robot

__all__ = [
    "PRESETS",
    "Decomposition",
    "EmptyMeshError",
    "MeshDataError",
    "MeshError",
    "MeshFileError",
    "MissingExtraError",
    "NavigableSpace",
    "OptionError",
    "OutputError",
    "Preset",
    "Progress",
    "Rewritten",
    "RlacdError",
    "__version__",
    "decompose",
    "rewrite_robot",
]
