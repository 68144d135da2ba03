"""Merging parts, overlapping hulls, fitting primitives, limiting vertices and faces of hulls, and dropping slivers."""

from rlacd.merge.in_input import as_carried, in_input
from rlacd.merge.limited import LimitedCriterion, limit_part, limit_roughly, with_limits
from rlacd.merge.merge import merge_lifted, merge_parts
from rlacd.merge.overlap import overlap_parts
from rlacd.merge.primitives import primitive_part
from rlacd.merge.simple import simple_part
from rlacd.merge.slivers import drop_slivers
from rlacd.merge.take_in import take_in
from rlacd.merge.to_count import best_within

__all__ = [
    "LimitedCriterion",
    "as_carried",
    "best_within",
    "drop_slivers",
    "in_input",
    "limit_part",
    "limit_roughly",
    "merge_lifted",
    "merge_parts",
    "overlap_parts",
    "primitive_part",
    "simple_part",
    "take_in",
    "with_limits",
]
