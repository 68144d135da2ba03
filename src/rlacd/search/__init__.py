"""Search for fewer parts than one pass of cuts finds."""

from rlacd.search.at_least import at_least
from rlacd.search.neighbourhood import SearchContext, cost
from rlacd.search.search import SearchSummary, eliminate_parts, search

__all__ = ["SearchContext", "SearchSummary", "at_least", "cost", "eliminate_parts", "search"]
