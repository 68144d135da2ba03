"""Bodies that move against each other: which of their hulls touch where the bodies themselves do not."""

from rlacd.clear.bodies import Body
from rlacd.clear.motion import Motion, at_rest
from rlacd.clear.touching import Offence, Touching, check

__all__ = ["Body", "Motion", "Offence", "Touching", "at_rest", "check"]
