"""Uniting parts, and dropping slivers."""

from rlacd.merge.grow import grow_cover
from rlacd.merge.merge import merge_parts, merge_transferred
from rlacd.merge.slivers import drop_slivers

__all__ = ["drop_slivers", "grow_cover", "merge_parts", "merge_transferred"]
