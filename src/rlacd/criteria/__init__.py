"""Criteria: when a component is done."""

from rlacd.criteria.concavity import Concavity, Distance, Filled
from rlacd.criteria.criterion import Criterion
from rlacd.criteria.limited import LimitedCriterion

__all__ = ["Concavity", "Criterion", "Distance", "Filled", "LimitedCriterion"]
