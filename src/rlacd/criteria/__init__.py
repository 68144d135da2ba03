"""When a component is done."""

from rlacd.criteria.concavity import Concavity
from rlacd.criteria.criterion import Criterion

__all__ = ["Concavity", "Criterion"]
