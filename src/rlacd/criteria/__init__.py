"""Criteria: when a component is done."""

from rlacd.criteria.concavity import Concavity, Distance
from rlacd.criteria.criterion import Criterion
from rlacd.criteria.limited import LimitedCriterion
from rlacd.criteria.navigable import Navigable
from rlacd.criteria.volume import AddedVolume

__all__ = ["AddedVolume", "Concavity", "Criterion", "Distance", "LimitedCriterion", "Navigable"]
