"""Meshes from files: a reader for each format, and maintained parsers behind checks of what a file declares."""

from __future__ import annotations

from importlib import import_module
from typing import Any


def function_of(place: str) -> Any:
    """A function by its place in ``rlacd.io``, ``read.obj:read_obj``: its module is imported when it is needed."""
    module, name = place.split(":")
    return getattr(import_module(f"rlacd.io.{module}"), name)
