"""Decomposing a simpler copy of a dense solid, and carrying the parts back to the solid itself."""

from rlacd.proxy.lift import Lift
from rlacd.proxy.model import Model
from rlacd.proxy.simplify import FEW_TRIANGLES, Proxy, simplify

__all__ = ["FEW_TRIANGLES", "Lift", "Model", "Proxy", "simplify"]
