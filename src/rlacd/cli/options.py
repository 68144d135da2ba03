"""Conversion of command-line options to the keyword arguments of `rlacd.decompose`."""

from __future__ import annotations

import dataclasses
import json
import re
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from rlacd._version import __version__
from rlacd.cli.commands import Option, chosen, options_of
from rlacd.errors import OptionError
from rlacd.options import LENGTHS, OPTION_NAMES, RUN, Options, with_criterion
from rlacd.options.fields import LONGEST_SIDE, check_fields, number, option, shown, stated
from rlacd.options.names import UNITS
from rlacd.options.navigable import NavigableSpace

if TYPE_CHECKING:
    from rlacd.pool import Pool, ProcessLimits

_ABSOLUTE = {*OPTION_NAMES, *(field.name for field in dataclasses.fields(NavigableSpace))}

LIKE = "The options and the seed of an earlier run, from the file that --report wrote; other options override them."

_LENGTH = re.compile(rf"([-+.\deE]+)\s*(%|{'|'.join(UNITS)})")


@stated(panel="Processes")
@dataclass(frozen=True)
class PoolOptions:
    """Where `rlacd batch` and `rlacd train` work, and what each process may take."""

    jobs: int | None = option(None, least=0, usual="all cores")
    """Processes at a time."""
    ray: str | None = option(None, metavar="ADDRESS")
    """Use a Ray cluster: its address, auto, or local."""
    limit: float = option(600.0, kind=number(0.1), metavar="SECONDS", usual="600")
    """The longest that one mesh may take; after it the process is killed."""
    memory: float = option(4.0, kind=number(0.0), metavar="GB", usual="4")
    """Memory limit of a process; 0 means no limit."""

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


def decompose_options(given: dict[str, Any], *, metres: bool = False) -> dict[str, Any]:
    """Keep the options that were given, and build the criterion from its own options.

    Parameters
    ----------
    given : dict
        Options that control the decomposition, by name; None if not given.
    metres : bool
        Whether the mesh is in metres, so that lengths with a unit can be taken.

    Returns
    -------
    dict
        Keyword arguments of `rlacd.decompose`: defaults are stated once, by its options.

    Raises
    ------
    OptionError
        Options contradict each other or are malformed.
    """
    given = lengths(chosen(given), metres)
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
        raise OptionError(f"--like {path} is no report of a decomposition as JSON ({type(error).__name__}).") from error
    if not re.fullmatch(r"\d{1,9}(\.\d{1,9}){2}", version) or _numbered(version) > _numbered(__version__):
        raise OptionError(
            f"--like {path} says it is of rlacd {shown(version)}; this is {__version__}, so install that."
        )
    if unknown := [name for name in options if name not in OPTION_NAMES]:
        raise OptionError(f"--like {path} has an option that rlacd {__version__} does not know: {shown(unknown[0])}.")
    return {name: value for name, value in options.items() if value is not None}


def _numbered(version: str) -> list[int]:
    return [int(number) for number in version.split(".")]


def lengths(given: dict[str, Any], metres: bool | None) -> dict[str, Any]:
    """Parse lengths: a number, a share of the longest side (5%), or metres (0.05m), which None refuses."""
    taken = dict(given)
    for name, longest in LONGEST_SIDE.items():
        word = taken.get(name)
        if not isinstance(word, str):
            continue
        flag, found = name.replace("_", "-"), _LENGTH.fullmatch(word.strip())
        value, unit = (_number(found[1]), found[2]) if found else (_number(word), None)
        if value is None:
            raise OptionError(
                f"--{flag} is {word!r}; it has to be a number, a share such as 5%, or a length such as 5mm."
            )
        if unit not in UNITS:
            taken[name] = value / 100 * longest if unit == "%" else value
            continue
        if metres is None or f"{name}_abs" not in _ABSOLUTE:
            raise OptionError(f"--{flag} is {word}; it has to be a number or a share such as 2%.")
        if not metres:
            raise OptionError(
                f"--{flag} is {word}, so the file's unit has to be known: give --unit file if the file states it (dae, "
                f"fbx, 3mf, usd), --unit with its unit otherwise, or --{flag}-abs in the file's own."
            )
        if f"{name}_abs" in taken:
            raise OptionError(f"--{flag} and --{flag}-abs are both lengths; give one of the two.")
        del taken[name]
        taken[f"{name}_abs"] = value * UNITS[unit]
    return taken


def link_lengths(given: dict[str, Any], metres: bool) -> dict[str, Any]:
    """Parse ``--link REGEX=LENGTH``: in the robot's own unit, or with one where that is the metre."""
    taken: dict[str, float] = {}
    for word in given.get("links") or ():
        pattern, _, text = word.rpartition("=")
        found = _LENGTH.fullmatch(text.strip())
        value, unit = (_number(found[1]), found[2]) if found else (_number(text), None)
        if not pattern or value is None or unit == "%":
            raise OptionError(f"--link is {word!r}; it has to be REGEX=LENGTH, such as 'finger.*=1mm'.")
        if unit is not None and not metres:
            raise OptionError(f"--link is {word!r}; of a USD stage, lengths are in its own unit: leave out {unit}.")
        taken[pattern] = value * (UNITS[unit] if unit else 1.0)
    return {**given, "links": taken} if taken else given


def unit_given(how: dict[str, Any]) -> str | None:
    """The unit in which a length was given, first of all the threshold; None if all are shares or bare numbers."""
    found = (_LENGTH.fullmatch(str(how.get(name) or "").strip()) for name in LONGEST_SIDE)
    return next((one[2] for one in found if one and one[2] in UNITS), None)


def _number(word: str) -> float | None:
    try:
        return float(word)
    except ValueError:
        return None


def _numbers(option: str, text: str, count: int) -> tuple[float, ...]:
    values = [value for word in text.split(",") if (value := _number(word)) is not None]
    if not len(values) == len(text.split(",")) == count:
        raise OptionError(f"{option} is {text!r}; it takes {count} numbers with commas: {'0,0,1,0'[: 2 * count - 1]}.")
    return tuple(values)
