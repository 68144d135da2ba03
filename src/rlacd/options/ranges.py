"""What values options of a decomposition may have: names, and bounds of numbers."""

from __future__ import annotations

from typing import Any, Literal, TypeAlias

from rlacd.options.fields import custom, integer, number
from rlacd.options.names import POLICIES, PRIMITIVE_KINDS, read_meshes, read_policy, read_primitives

VolumeOf = Literal["part", "whole"]
OpeningsName = Literal["auto", "small", "solid", "thin"]
DetailName = Literal["simple", "full"]
QualityName = Literal["fast", "balanced", "best"]
RelativeTo = Literal["scene", "node", "mesh"]
UnitName = Literal["mm", "cm", "m", "in", "file"]

MeshLike: TypeAlias = Any
"""Stands for what `rlacd.decompose` takes as a mesh."""

Policy: TypeAlias = Any
"""Stands for `rlacd.Policy`, an object with a method `choose`: policies are built on top of options."""

SIMPLE: Literal["simple"] = "simple"
FAST: Literal["fast"] = "fast"

RESOLUTIONS = (20, 400)
"""Fewest and most cells along a side of the grid on which repair looks for voids: with fewer, a wrap drawn onto the
surface folds over itself; more would take over 4 GB."""

GAPS = (0.01, 0.3)
"""Where the longest side is 2: smaller balls would need more than `RESOLUTIONS` cells, larger ones close what a body is
made of."""

LENGTHS = {"threshold": (0.001, 2.0), "overlap": (0.0, 0.5)}
"""Bounds, where the longest side is 2, of options that may also be given in the input's unit, under their name and
``_abs``. A hull farther from its
part than the largest threshold does not fit into the frame; hulls that overlap by more are hardly parts."""

RADII = (0.004, 2.0)
"""Bounds of the radius of a ball that has to pass, where the longest side is 2: narrower passages are not found."""

TIGHT, LIMITS, METHOD, RUN = "How tight", "Limits", "Method", "Running"
"""Headings of the command's help."""

PRIMITIVES = custom(
    f"all (True), or some of {', '.join(PRIMITIVE_KINDS)}", read_primitives, f"all {' '.join(PRIMITIVE_KINDS)}"
)
POLICY = custom(
    f"one of {', '.join(POLICIES)}, an .npz file, or (in Python) an object with a method `choose`",
    read_policy,
    "greedy navacd learned rl-acd FILE.npz …",
)
AVOIDED = custom("a list of meshes or of paths of meshes", read_meshes)
CORNERS = integer(4, rule="an integer, at least 4 (a tetrahedron)")
OPENNESS = number(
    *(0.1, 0.99),
    rule="a number between 0.1 and 0.99, a share of each passage's radius; a radius is keep_open_abs "
    "(--keep-open 2mm or --keep-open-abs)",
    typed=str,
)
SECONDS = number(above=0, rule="a positive number of seconds")
FACTOR = number(above=0, rule="a positive factor")
