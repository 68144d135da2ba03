"""The options of a robot as a whole, each stated once; `rlacd.rewrite_robot` says what they mean."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Literal

from rlacd.options.fields import check_fields, custom, number, option, stated

Per = Literal["link", "mesh"]

_length = number(above=0).read


def _links(given: Any) -> dict[str, float]:
    if not isinstance(given, Mapping) or not all(isinstance(pattern, str) for pattern in given):
        raise TypeError
    for pattern in given:
        re.compile(pattern)
    return {pattern: _length(length) for pattern, length in given.items()}


_LINKS = custom("positive lengths by regular expressions of link names, such as {'finger.*': 0.001}", _links)


@stated(panel="Robots", python="rewrite_robot({}=)")
@dataclass(frozen=True)
class RobotOptions:
    """How the links of a robot are decomposed.

    Attributes
    ----------
    per
        What becomes hulls as one: all collision meshes of a link that share their contact properties, or each mesh.
    links
        Another distance for the links whose whole name matches a regular expression, such as 'finger.*=1mm', or in the
        robot's own unit. May be repeated; the last that matches counts.
    samples
        Joint positions, beside that at rest, at which links that do not touch are kept clear of each other. Needs the
        extra rlacd[clear].

    Raises
    ------
    OptionError
        A value is of the wrong type or out of its range.
    """

    per: Per = option("link", one_of=Per)
    links: Mapping[str, float] | None = option(
        None, kind=_LINKS, flags=("--link",), metavar="REGEX=LENGTH", repeated=True
    )
    samples: int = option(500, least=0, most=100_000)

    def __post_init__(self) -> None:
        check_fields(self)
