"""The page of the viewer and of the report as one HTML text: styles, scripts and data inside, nothing to fetch.

three.js is a classic script that defines ``THREE``. The page's own scripts are ES modules; an import map gives each a
data address, since a page opened from a disk may not import its neighbours. The content policy forbids every other
source, so neither page can reach a network; the viewer may ask its own server.
"""

from __future__ import annotations

import base64
import gzip
import html
import re
from importlib import resources
from typing import Any

from rlacd.plain_json import to_json

MODULES = ("arrays", "camera", "controls", "facts", "keys", "link", "list", "stage", "widgets")
"""Modules of the page beside ``main``; ``import ... from "page/list"``."""

POLICY = (
    "default-src 'none'; script-src 'unsafe-inline' data:; style-src 'unsafe-inline'; img-src data: blob:; "
    "connect-src {connect}; base-uri 'none'; form-action 'none'"
)


def live_page(title: str, config: dict[str, Any]) -> str:
    """Build the viewer's page, which asks its server for everything it shows.

    Parameters
    ----------
    title : str
    config : dict
        Plain values for the page's controls; see `rlacd.show.server`.
    """
    return _page(title, {"live": True, **config}, data=None, connect="'self'")


def still_page(title: str, config: dict[str, Any], scene: dict[str, Any]) -> str:
    """Build a report: the same page with its data inside and no server.

    Parameters
    ----------
    title : str
    config : dict
        Plain values for the page.
    scene : dict
        What `rlacd.show.scene.scene` gives, with ``heat`` and ``picture`` where there are any.
    """
    return _page(title, {"live": False, **config}, data=scene, connect="'none'")


def _page(title: str, config: dict[str, Any], data: dict[str, Any] | None, connect: str) -> str:
    imports = {f"page/{name}": _data_address(_asset(f"{name}.js")) for name in MODULES}
    # The same data always gives the same bytes: gzip would store the time otherwise.
    packed = b"" if data is None else gzip.compress(to_json(data, indent=None).encode(), mtime=0)
    values = {
        "policy": POLICY.format(connect=connect),
        "title": html.escape(title),
        "style": _asset("style.css"),
        "three": _asset("vendor/three.min.js"),
        "imports": _inert(to_json({"imports": imports}, indent=None)),
        "config": _inert(to_json(config, indent=None)),
        "data": base64.b64encode(packed).decode("ascii"),
        "main": _asset("main.js"),
    }
    # In one sweep, so that no value is searched for the names of others.
    return re.sub(r"\{\{(\w+)\}\}", lambda match: values[match[1]], _asset("page.html"))


def _asset(name: str) -> str:
    return (resources.files("rlacd.show") / "web" / name).read_text(encoding="utf-8")


def _data_address(script: str) -> str:
    return "data:text/javascript;base64," + base64.b64encode(script.encode()).decode("ascii")


def _inert(json_text: str) -> str:
    """JSON that cannot end the script element it stands in."""
    return json_text.replace("<", "\\u003c")
