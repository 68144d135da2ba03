"""Conversion of command-line options to the keyword arguments of `rlacd.decompose`."""

from __future__ import annotations

import json
import re
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from rlacd._version import __version__
from rlacd.cli.commands import Option, chosen, options_of
from rlacd.errors import OptionError
from rlacd.options import OPTION_NAMES, Options
from rlacd.options.criterion import with_criterion
from rlacd.options.fields import check_fields, number, option, shown, stated
from rlacd.options.lengths import read_lengths
from rlacd.options.navigable import NavigableSpace
from rlacd.options.ranges import LENGTHS, RUN

if TYPE_CHECKING:
    from rlacd.pool import Pool, ProcessLimits

LIKE = "The options and the seed of an earlier run, from the file that --report wrote; other options override them."


@stated(panel="Processes")
@dataclass(frozen=True)
class PoolOptions:
    """Where `rlacd batch` and `rlacd train` work, and what each process may take."""

    jobs: int | None = option(None, least=0, usual="all cores", help="Processes at a time.")
    ray: str | None = option(None, metavar="ADDRESS", help="Use a Ray cluster: its address, auto, or local.")
    limit: float = option(
        600.0,
        kind=number(0.1),
        metavar="SECONDS",
        usual="600",
        help="The longest that one mesh may take; after it the process is killed.",
    )
    memory: float = option(
        4.0, kind=number(0.0), metavar="GB", usual="4", help="Memory limit of a process; 0 means no limit."
    )

    def __post_init__(self) -> None:
        check_fields(self)

    def limits(self) -> ProcessLimits:
        """Limits of each request."""
        from rlacd.pool import ProcessLimits

        return ProcessLimits(self.limit, int(self.memory * 2**30))

    def open(self, jobs: int) -> Pool:
        """Open the pool; on this machine with this many processes unless told otherwise."""
        from rlacd.pool import open_pool

        return open_pool(jobs if self.jobs is None and self.ray is None else self.jobs, self.ray)


def how() -> list[Option]:
    """Make the options that control the decomposition."""
    own = [name for name in OPTION_NAMES if name != "volume_tolerance"]  # --tolerance of navigable space stands for it
    like = Option("like", "--like", type=click.Path(path_type=Path), metavar="REPORT.json", panel=RUN, help=LIKE)
    return [like, *options_of(Options, only=own), *options_of(NavigableSpace)]


def decompose_options(given: dict[str, Any]) -> dict[str, Any]:
    """Keep the options that were given, and build the criterion from its own options.

    Parameters
    ----------
    given : dict
        Options that control the decomposition, by name; None if not given.

    Returns
    -------
    dict
        Keyword arguments of `rlacd.decompose`: defaults are stated once, by its options.

    Raises
    ------
    OptionError
        Options contradict each other or are malformed.
    """
    given = chosen(given)
    read_lengths(given)  # refuses what is none before any work; each mesh may have another unit
    before = _of_report(given.pop("like")) if "like" in given else {}
    if "seeds" in given:
        given["seeds"] = [_numbers("--seed-point", words, 3) for words in given["seeds"]]
    if "closed_planes" in given:
        planes = [_numbers("--closed-plane", words, 4) for words in given["closed_planes"]]
        given["closed_planes"] = [(plane[:3], plane[3]) for plane in planes]
    given = with_criterion(given)
    for name in LENGTHS:
        if name in given or f"{name}_abs" in given:
            before = {key: value for key, value in before.items() if key not in (name, f"{name}_abs")}
    return before | given


def _of_report(path: Path) -> dict[str, Any]:
    """Read the options that a report lists."""
    try:
        report = json.loads(path.read_text(encoding="utf-8"))
        version, options = str(report.get("version", __version__)), dict(report["options"])
    except (OSError, ValueError, KeyError, TypeError, AttributeError, RecursionError) as error:
        raise OptionError(f"--like {path} is not a JSON report of a decomposition ({type(error).__name__}).") from error
    if not re.fullmatch(r"\d{1,9}(\.\d{1,9}){2}", version) or _numbered(version) > _numbered(__version__):
        raise OptionError(
            f"--like {path} was written by rlacd {shown(version)}, but this is {__version__}: install that version."
        )
    if unknown := [name for name in options if name not in OPTION_NAMES]:
        raise OptionError(f"--like {path} has an option that rlacd {__version__} does not know: {shown(unknown[0])}.")
    return {name: value for name, value in options.items() if value is not None}


def _numbered(version: str) -> list[int]:
    return [int(number) for number in version.split(".")]


def link_lengths(given: dict[str, Any]) -> dict[str, Any]:
    """Parse ``--link REGEX=LENGTH``."""
    taken: dict[str, str] = {}
    for word in given.get("links") or ():
        pattern, _, text = word.rpartition("=")
        if not pattern:
            raise OptionError(f"--link is {word!r}; it has to be REGEX=LENGTH, such as 'finger.*=1mm'.")
        taken[pattern] = text
    return {**given, "links": taken} if taken else given


def _number(word: str) -> float | None:
    try:
        return float(word)
    except ValueError:
        return None


def _numbers(option: str, text: str, count: int) -> tuple[float, ...]:
    values = [value for word in text.split(",") if (value := _number(word)) is not None]
    if not len(values) == len(text.split(",")) == count:
        raise OptionError(
            f"{option} is {text!r}; it takes {count} numbers separated by commas: {'0,0,1,0'[: 2 * count - 1]}."
        )
    return tuple(values)
