"""The criteria by name, and the options that belong to each."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping
from typing import Any

from rlacd.errors import OptionError
from rlacd.options.fields import about, custom, one_of, read
from rlacd.options.navigable import NavigableSpace

CRITERIA = {
    "concavity": ("threshold",),
    "distance": ("threshold",),
    "volume": ("volume_tolerance",),
    "navigable": ("radius", "tolerance"),
}
"""Each criterion by its name, with the numbers that say how tight it is."""

OWN = {"threshold": ("threshold", "threshold_abs"), "volume_tolerance": ("volume_tolerance", "volume_of")}
"""Options that only criteria with the number of that name take."""

NAMED = tuple(name for name in CRITERIA if name != "navigable")
"""Criteria whose numbers are options of a decomposition themselves."""


def _criterion(given: Any) -> Any:
    if isinstance(given, Mapping):
        return NavigableSpace(**given)
    return given if isinstance(given, NavigableSpace) else one_of(NAMED).read(given)


CRITERION = custom(f"{', '.join(NAMED)} or an `rlacd.NavigableSpace`", _criterion, " ".join(CRITERIA))


def _instead(word: str, value: Any) -> str:
    """What to give in place of a tolerance where the criterion has a threshold."""
    length = value if isinstance(value, str) else "10mm"
    return f"; how far hulls may be from the mesh is --threshold {length}" if word == "tolerance" else ""


def with_criterion(given: Mapping[str, Any]) -> dict[str, Any]:
    """Get arguments of `rlacd.decompose` from flat ones: the criterion by its name, the options of a space beside it.

    Raises
    ------
    OptionError
        There is no criterion of this name, or an option belongs to another.
    """
    own = {field.name for field in dataclasses.fields(NavigableSpace)}
    space = {name: value for name, value in given.items() if name in own}
    given = {name: value for name, value in given.items() if name not in own}
    name = given.get("criterion")
    if name is not None:
        read(one_of(CRITERIA, rule="concavity, distance, volume or navigable"), "criterion", name)
    if name == "navigable":
        return given | {"criterion": NavigableSpace(**space)}
    if name == "volume" and "tolerance" in space:
        given["volume_tolerance"] = space.pop("tolerance")
    for word, value in space.items():
        yes, _, no = about(NavigableSpace, word).flags[0].partition("/")
        needed = "volume or navigable" if word == "tolerance" else "navigable"
        raise OptionError(f"{no if value is False else yes} needs --criterion {needed}{_instead(word, value)}.")
    return given
