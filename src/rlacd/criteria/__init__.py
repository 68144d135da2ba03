"""Criteria: when a component is done."""

from rlacd.criteria.concavity import Concavity
from rlacd.criteria.criterion import Criterion
from rlacd.criteria.limited import LimitedCriterion, with_limits
from rlacd.criteria.navigable import Navigable, NavigableSpace
from rlacd.criteria.volume import AddedVolume

__all__ = ["AddedVolume", "Concavity", "Criterion", "LimitedCriterion", "Navigable", "NavigableSpace", "with_limits"]
