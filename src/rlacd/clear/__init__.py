"""Bodies that move against each other: which of their hulls touch where the bodies themselves do not."""

from rlacd.clear.bodies import PRIMITIVES, Body, CrowdedError, Primitive, Surface, may_touch
from rlacd.clear.mend import Cleared, kept_clear
from rlacd.clear.motion import Joint, Motion, Solids, at_rest, mjcf_motion, urdf_motion
from rlacd.clear.pairs import LinkPair, link_pairs, warnings_of
from rlacd.clear.touching import Offence, Touching, check

__all__ = [
    "PRIMITIVES",
    "Body",
    "Cleared",
    "CrowdedError",
    "Joint",
    "LinkPair",
    "Motion",
    "Offence",
    "Primitive",
    "Solids",
    "Surface",
    "Touching",
    "at_rest",
    "check",
    "kept_clear",
    "link_pairs",
    "may_touch",
    "mjcf_motion",
    "urdf_motion",
    "warnings_of",
]
