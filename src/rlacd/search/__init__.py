"""Search for fewer parts than one pass of cuts finds."""

from rlacd.search.context import SearchContext
from rlacd.search.search import SearchSummary, eliminate_parts, search

__all__ = ["SearchContext", "SearchSummary", "eliminate_parts", "search"]
