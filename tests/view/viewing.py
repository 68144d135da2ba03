"""The viewer as `rlacd view` opens it."""

from __future__ import annotations

from contextlib import AbstractContextManager
from typing import Any

import rlacd
from rlacd.view import viewer
from rlacd.view.server import ViewServer


def open_viewer(mesh: Any, options: dict[str, Any] | None = None, **given: Any) -> AbstractContextManager[ViewServer]:
    """Open it with what decomposes here."""
    return viewer.open_viewer(mesh, rlacd.decompose, options, **given)
