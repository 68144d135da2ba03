"""Former names of options, taken for one version more: ``threshold_m`` was read as metres, and is ``threshold_abs``."""

from __future__ import annotations

import dataclasses
import warnings
from collections.abc import Mapping
from typing import Any

from rlacd.errors import OptionError


def former_names(options: Any) -> dict[str, str]:
    """Get the former name of each option of a dataclass that has one, to its name."""
    known = {field.name: field.metadata.get("option") for field in dataclasses.fields(options)}
    return {about.former: name for name, about in known.items() if about is not None and about.former is not None}


def with_former(options: Any, given: Mapping[str, Any], former: Mapping[str, Any], level: int = 2) -> dict[str, Any]:
    """Give what came under former names its name in `given`, with a DeprecationWarning.

    Raises
    ------
    OptionError
        Both names were given.
    """
    taken = dict(given)
    for old, new in former_names(options).items():
        value = former.get(old)
        if value is None:
            continue
        if taken.get(new) is not None:
            raise OptionError(f"{old} is the former name of {new}; give one of the two.")
        warnings.warn(
            f"{old} is now called {new}; the old name will be removed.", DeprecationWarning, stacklevel=level + 1
        )
        taken[new] = value
    return taken


def take_former(options: Any, former: Mapping[str, Any]) -> None:
    """Do the same in the dataclass itself, while it is being made."""
    names = former_names(options)
    now = {name: getattr(options, name) for name in names.values()}
    for name, value in with_former(options, now, former, level=4).items():
        object.__setattr__(options, name, value)
