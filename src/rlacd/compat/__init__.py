"""Drop-in replacements for other tools' functions: CoACD (and its command), V-HACD, trimesh and PyBullet.

Each module is named after the one it replaces, and imports nothing of it; ``rlacd.compat.vhacd`` is the package vhacdx.
"""

from __future__ import annotations

import inspect
import warnings
from collections.abc import Callable, Mapping
from typing import Any

_WARNED: set[tuple[str, str]] = set()


class UnusedOptionWarning(UserWarning):
    """An option of the other tool that has no meaning in rlacd."""


def warn_unused(function: Callable[..., Any], given: Mapping[str, Any], reasons: Mapping[str, str]) -> None:
    """Warn about the options in `reasons` that differ from their default, each once per process."""
    for name, reason in reasons.items():
        default, known = inspect.signature(function).parameters[name].default, (function.__name__, name)
        same = isinstance(given[name], (str, bool, int, float)) and given[name] == default  # an array never is
        if not same and known not in _WARNED:
            _WARNED.add(known)
            warnings.warn(f"{function.__name__}: rlacd ignores {name}: {reason}.", UnusedOptionWarning, stacklevel=3)
