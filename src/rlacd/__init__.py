"""Approximate convex decomposition: any mesh in, few tight convex hulls out."""

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

__version__ = "0.1.0"

__all__ = [
    "EmptyMeshError",
    "MeshDataError",
    "MeshError",
    "MeshFileError",
    "MissingExtraError",
    "OptionError",
    "OutputError",
    "RlacdError",
    "__version__",
]
