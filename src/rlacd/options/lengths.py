"""Lengths: shares of the longest side of the mesh, or lengths in its own unit under the option's name and ``_abs``.

The one exception is a bare threshold, which is CoACD's: given in the frame where the longest side is 2.
"""

from __future__ import annotations

from rlacd.errors import OptionError
from rlacd.options.fields import number

LONGEST_SIDE = {"threshold": 2.0, "overlap": 1.0, "gap": 1.0, "radius": 1.0, "tolerance": 1.0}
"""What the longest side measures where each is given as a bare number."""

LENGTH = number(above=0, rule="a positive length in the input's unit")


def relative(name: str, length: float, scale: float, bounds: tuple[float, float]) -> float:
    """Get what a length in the input's unit is as a bare number; `scale` is units of the frame per unit of the input.

    Raises
    ------
    OptionError
        That is out of bounds: the length is too small or too large for the object.
    """
    side = LONGEST_SIDE[name]
    number, (least, most) = length * scale * side / 2, bounds
    if not least <= number <= most:
        unit = scale * side / 2
        raise OptionError(
            f"{name}_abs is {length!r}; for this object it has to be between {least / unit:.4g} and {most / unit:.4g} "
            f"({100 * least / side:g} % and {100 * most / side:g} % of its longest side)."
        )
    return number
