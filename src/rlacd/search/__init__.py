"""Search for fewer parts than one pass of cuts finds."""

from rlacd.search.levels import LEVELS, do_without, level, search

__all__ = ["LEVELS", "do_without", "level", "search"]
