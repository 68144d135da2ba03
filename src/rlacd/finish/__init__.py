"""After the cuts: merging parts, limits on vertices and faces, slivers."""

from rlacd.finish.in_input import in_input
from rlacd.finish.limited import limit_part, limit_roughly, with_limits
from rlacd.finish.merge import merge_parts, merge_to_count
from rlacd.finish.slivers import drop_slivers

__all__ = ["drop_slivers", "in_input", "limit_part", "limit_roughly", "merge_parts", "merge_to_count", "with_limits"]
