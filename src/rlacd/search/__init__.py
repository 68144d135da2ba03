"""Search for fewer parts than one pass of cuts finds."""

from rlacd.search.at_least import at_least
from rlacd.search.neighbourhood import SearchContext, cost
from rlacd.search.search import eliminate_parts, search

__all__ = ["SearchContext", "at_least", "cost", "eliminate_parts", "search"]
