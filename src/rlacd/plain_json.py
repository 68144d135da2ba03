"""JSON that every parser reads."""

from __future__ import annotations

import json
import math
from typing import Any


def to_json(value: Any, indent: int | None = 2) -> str:
    """JSON text with a line's end; numbers that JSON does not know (NaN, infinity) become null."""
    return printable(json.dumps(_plain(value), indent=indent, ensure_ascii=False, allow_nan=False)) + "\n"


def printable(text: str) -> str:
    """Replace what UTF-8 cannot hold: Python keeps the odd bytes of a file name as surrogates."""
    return text.encode(errors="replace").decode()


def _plain(value: Any) -> Any:
    if isinstance(value, dict):
        return {str(key): _plain(item) for key, item in value.items()}
    if isinstance(value, (list, tuple)):
        return [_plain(item) for item in value]
    if isinstance(value, float) and not math.isfinite(value):
        return None
    return value
