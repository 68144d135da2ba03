"""Bodies that move against each other: which of their hulls touch where the bodies themselves do not."""

from rlacd.clear.bodies import Body
from rlacd.clear.mend import Cleared, kept_clear
from rlacd.clear.motion import Motion, at_rest, mjcf_motion, urdf_motion
from rlacd.clear.touching import Offence, Touching, check

__all__ = [
    "Body",
    "Cleared",
    "Motion",
    "Offence",
    "Touching",
    "at_rest",
    "check",
    "kept_clear",
    "mjcf_motion",
    "urdf_motion",
]
