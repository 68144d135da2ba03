"""Uniting parts."""

from rlacd.merge.grow import grow_cover, grown_parts
from rlacd.merge.unite import merge_parts

__all__ = ["grow_cover", "grown_parts", "merge_parts"]
