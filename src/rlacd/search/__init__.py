"""Search for fewer parts than one pass of cuts finds."""

from rlacd.search.levels import LEVELS, level, search

__all__ = ["LEVELS", "level", "search"]
