"""When a component is done."""

from rlacd.criteria.concavity import Concavity
from rlacd.criteria.criterion import Criterion
from rlacd.criteria.navigable import Balls, Conflicts, Navigable, NavigableSpace

__all__ = ["Balls", "Concavity", "Conflicts", "Criterion", "Navigable", "NavigableSpace"]
