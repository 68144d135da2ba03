"""The options of a robot as a whole, each stated once; `rlacd.rewrite_robot` says what they mean."""

from __future__ import annotations

import math
import os
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Literal

from rlacd.options.fields import check_fields, custom, one_of, option, path_like, stated
from rlacd.options.lengths import LENGTH, read_length

Per = Literal["link", "mesh"]
PairKind = Literal["adjacent", "always", "never"]


def _links(given: Any) -> dict[str, float]:
    if not isinstance(given, Mapping) or not all(isinstance(pattern, str) for pattern in given):
        raise TypeError
    for pattern in given:
        re.compile(pattern)
    return {pattern: LENGTH.read(_number(length)) for pattern, length in given.items()}


def _number(length: Any) -> Any:
    return read_length(length, math.nan) if isinstance(length, str) else length


def _kinds(given: Any) -> tuple[str, ...]:
    words = given.split(",") if isinstance(given, str) else given
    if not isinstance(words, (list, tuple)):
        raise TypeError
    return tuple(one_of(PairKind).read(word.strip()) for word in words)


_KINDS = custom("some of adjacent, always, never", _kinds, "adjacent always never")
_LINKS = custom("positive lengths by regular expressions of link names, such as {'finger.*': '1mm'}", _links)


@stated(panel="Robots", python="rewrite_robot({}=)")
@dataclass(frozen=True)
class RobotOptions:
    """How the links of a robot are decomposed.

    Raises
    ------
    OptionError
        A value is of the wrong type or out of its range.
    """

    per: Per = option(
        "link",
        one_of=Per,
        help="""What becomes hulls as one: all collision meshes of a link that share their contact properties,
        or each mesh.

        Links that fixed joints connect stay apart; so do MJCF geoms with a name, and meshes that belong to no
        body.""",
    )
    links: Mapping[str, float | str] | None = option(
        None,
        kind=_LINKS,
        flags=("--link",),
        metavar="REGEX=LENGTH",
        repeated=True,
        help="""Another distance for the links whose whole name matches a regular expression; the last that
        matches counts.

        On the command line: give 'finger.*=1mm', or a number in the robot's own unit; may be repeated.

        ``{"finger.*": "1mm"}``, or a number in the robot's own unit, as `threshold_abs`.""",
    )
    from_visual: bool = option(
        False,
        help="""Links without collision geometry get it from what they show: hulls of the meshes, and the same
        primitives.

        What is shown stays. Of an MJCF model, these are bodies none of whose geoms collides.""",
    )
    samples: int = option(
        500,
        least=0,
        most=100_000,
        help="""Joint positions, beside that at rest, at which links that do not touch are kept clear of each
        other. Needs the extra rlacd[clear].

        Where hulls of such links would touch, they are cut finer, or a warning names both. USD stages are
        looked at as they stand.""",
    )
    exclude: str | Sequence[PairKind] = option(
        (),
        kind=_KINDS,
        metavar="adjacent,always,…",
        usual="none",
        help="""Pairs of bodies whose contacts need not be found, as excludes in MJCF and filtered pairs in USD:
        adjacent, always or never in contact at these positions.

        Of bodies of a stage, only those that a joint connects are known.""",
    )
    srdf: str | os.PathLike[str] | None = option(
        None,
        kind=path_like(),
        metavar="FILE",
        help="Of a URDF, write the same as MoveIt's file: links that are adjacent, always or never in contact.",
    )

    def __post_init__(self) -> None:
        check_fields(self)
