"""Uniting parts."""

from rlacd.merge.grow import grow_cover
from rlacd.merge.unite import merge_parts

__all__ = ["grow_cover", "merge_parts"]
