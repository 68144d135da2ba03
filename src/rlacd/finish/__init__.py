"""From parts to hulls in the input's unit: overlaps, primitives, simple hulls, limits; then the report."""

from rlacd.finish.finish import Finished, finish, misses_some

__all__ = ["Finished", "finish", "misses_some"]
