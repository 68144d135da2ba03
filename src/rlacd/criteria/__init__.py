"""Criteria: when a component is done."""

from rlacd.criteria.concavity import Concavity
from rlacd.criteria.criterion import Criterion
from rlacd.criteria.navigable import Navigable, NavigableSpace

__all__ = ["Concavity", "Criterion", "Navigable", "NavigableSpace"]
