"""After the cuts: merging parts, limits on vertices and faces, slivers."""

from rlacd.finish.limited import limit_part, limited
from rlacd.finish.merge import merge_parts, merge_to_count
from rlacd.finish.slivers import drop_slivers

__all__ = ["drop_slivers", "limit_part", "limited", "merge_parts", "merge_to_count"]
