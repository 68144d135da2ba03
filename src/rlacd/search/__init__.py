"""Search for fewer parts than one pass of cuts finds."""

from rlacd.search.levels import LEVELS, eliminate_parts, level, search

__all__ = ["LEVELS", "eliminate_parts", "level", "search"]
