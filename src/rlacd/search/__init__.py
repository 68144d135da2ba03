"""Search for fewer parts than one pass of cuts finds."""

from rlacd.search.at_least import at_least
from rlacd.search.levels import eliminate_parts, search
from rlacd.search.neighbourhood import SearchContext, cost

__all__ = ["SearchContext", "at_least", "cost", "eliminate_parts", "search"]
