"""Search for fewer parts than one pass of cuts finds."""

from rlacd.search.context import SearchContext
from rlacd.search.levels import LEVELS, eliminate_parts, level, search

__all__ = ["LEVELS", "SearchContext", "eliminate_parts", "level", "search"]
