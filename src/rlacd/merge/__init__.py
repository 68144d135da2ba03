"""Uniting parts, and dropping slivers."""

from rlacd.merge.grow import grow_cover
from rlacd.merge.merge import merge_lifted, merge_parts
from rlacd.merge.slivers import drop_slivers
from rlacd.merge.to_count import COARSER, best_within

__all__ = ["COARSER", "best_within", "drop_slivers", "grow_cover", "merge_lifted", "merge_parts"]
