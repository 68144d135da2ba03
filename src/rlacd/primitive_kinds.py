"""The names of the primitives that a part may become, and how they are given."""

from __future__ import annotations

from typing import Any, Literal, get_args

from rlacd.fields import one_of

PrimitiveKind = Literal["sphere", "capsule", "box", "cylinder"]

PRIMITIVE_KINDS: tuple[PrimitiveKind, ...] = get_args(PrimitiveKind)
"""Simplest first: in this order engines collide them fastest."""


def read_primitives(given: Any) -> tuple[PrimitiveKind, ...]:
    """Read True or ``"all"``, a list of names, or a string of names with commas between them.

    Raises
    ------
    TypeError, ValueError
        It is none of these.
    """
    if isinstance(given, str):
        given = given == "all" or [word.strip() for word in given.split(",")]
    if isinstance(given, bool):
        return PRIMITIVE_KINDS if given else ()
    if not isinstance(given, (list, tuple)):
        raise TypeError
    names = {one_of(PRIMITIVE_KINDS).read(word) for word in given}
    return tuple(kind for kind in PRIMITIVE_KINDS if kind in names)
