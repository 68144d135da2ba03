"""Search for fewer parts than one pass of cuts finds."""

from rlacd.search.context import SearchContext
from rlacd.search.neighbourhood import cost
from rlacd.search.search import SearchSummary, eliminate_parts, search

__all__ = ["SearchContext", "SearchSummary", "cost", "eliminate_parts", "search"]
