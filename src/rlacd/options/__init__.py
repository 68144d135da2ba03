"""All options, each stated once: its type, range, default, help and place on the command line.

Checking what was given, the commands, their help and the documentation's table are made from them. Nothing here imports
a library, so that ``--help`` does not wait for one.
"""

from rlacd.options.decompose import (
    CONCAVITY,
    CRITERIA,
    DEFAULT_RESOLUTION,
    DEFAULT_THRESHOLD,
    FAST,
    MAX_OVERLAP,
    MAX_THRESHOLD,
    MIN_THRESHOLD,
    OPTION_NAMES,
    SIMPLE,
    VOLUME,
    DetailName,
    OpenName,
    Options,
    QualityName,
    RelativeTo,
    UnitName,
    VolumeOf,
    criterion_named,
)
from rlacd.options.navigable import NAVIGABLE, SpaceOptions
from rlacd.options.output import OutputOptions

__all__ = [
    "CONCAVITY",
    "CRITERIA",
    "DEFAULT_RESOLUTION",
    "DEFAULT_THRESHOLD",
    "FAST",
    "MAX_OVERLAP",
    "MAX_THRESHOLD",
    "MIN_THRESHOLD",
    "NAVIGABLE",
    "OPTION_NAMES",
    "SIMPLE",
    "VOLUME",
    "DetailName",
    "OpenName",
    "Options",
    "OutputOptions",
    "QualityName",
    "RelativeTo",
    "SpaceOptions",
    "UnitName",
    "VolumeOf",
    "criterion_named",
]
