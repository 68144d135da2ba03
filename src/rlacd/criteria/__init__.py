"""Criteria: when a component is done."""

from rlacd.criteria.concavity import Concavity, Distance
from rlacd.criteria.criterion import Criterion
from rlacd.criteria.limited import LimitedCriterion

__all__ = ["Concavity", "Criterion", "Distance", "LimitedCriterion"]
