"""The page of the viewer and of the report as one HTML text, with styles, scripts and data inside.

three.js is a classic script that defines ``THREE``. The page's own scripts are ES modules behind an import map: the
viewer's server delivers them, a report embeds each as a data URL, since a page opened from disk may not import files
beside it. The content security policy lists scripts and styles by hash and forbids every other source, so neither page
can reach a network; the viewer may only contact its own server.
"""

from __future__ import annotations

import base64
import gzip
import hashlib
import html
import re
from importlib import resources
from typing import Any

from rlacd.plain_json import to_json

MODULES = (
    *("arrays", "camera", "controls", "facts", "ground", "hints"),
    *("joints", "keys", "link", "list", "stage", "widgets"),
)
"""Modules of the page other than ``main``, imported as ``"page/list"``."""

POLICY = (
    "default-src 'none'; script-src {modules} {scripts}; style-src {styles}; img-src data: blob:; "
    "connect-src {connect}; base-uri 'none'; form-action 'none'"
)


def live_page(title: str, config: dict[str, Any]) -> tuple[str, str]:
    """Build the viewer's page, which loads scripts and data from its server, and its content security policy.

    Parameters
    ----------
    title : str
    config : dict
        Plain values for the page's controls; see `rlacd.viewer.server`.
    """
    imports = {f"page/{name}": f"./page/{name}.js" for name in MODULES}
    return _page(title, {"live": True, **config}, None, imports, modules="'self'", connect="'self'")


def module(name: str) -> str | None:
    """Return the text of one of the page's scripts; None if there is no such script."""
    return _asset(f"{name}.js") if name in MODULES else None


def still_page(title: str, config: dict[str, Any], scene: dict[str, Any]) -> str:
    """Build a report: the same page without a server, with its data embedded.

    Parameters
    ----------
    title : str
    config : dict
        Plain values for the page.
    scene : dict
        The result of `rlacd.viewer.scene.scene`, with ``heat`` and ``picture`` if available.
    """
    scripts = {name: base64.b64encode(_asset(f"{name}.js").encode()).decode("ascii") for name in MODULES}
    imports = {f"page/{name}": f"data:text/javascript;base64,{script}" for name, script in scripts.items()}
    return _page(title, {"live": False, **config}, scene, imports, modules="data:", connect="'none'")[0]


def _page(
    title: str, config: dict[str, Any], data: dict[str, Any] | None, imports: dict[str, str], **sources: str
) -> tuple[str, str]:
    # No time stamp in the gzip header, so that the same data gives the same bytes.
    packed = b"" if data is None else gzip.compress(to_json(data, indent=None).encode(), mtime=0)
    style, plain = _asset("style.css"), _inert(to_json({"imports": imports}, indent=None))
    scripts = {"three": _asset("vendor/three.min.js"), "imports": plain, "main": _asset("main.js")}
    policy = POLICY.format(styles=_hash(style), scripts=" ".join(map(_hash, scripts.values())), **sources)
    values = {"policy": policy, "title": html.escape(title), "style": style, **scripts}
    values |= {"config": _inert(to_json(config, indent=None)), "data": base64.b64encode(packed).decode("ascii")}
    # All in one pass, so that no inserted value is searched for placeholders.
    return re.sub(r"\{\{(\w+)\}\}", lambda match: values[match[1]], _asset("page.html")), policy


def _hash(text: str) -> str:
    """Hash of a script or style, as a content security policy lists it."""
    return f"'sha256-{base64.b64encode(hashlib.sha256(text.encode()).digest()).decode('ascii')}'"


def _asset(name: str) -> str:
    return (resources.files("rlacd.viewer") / "web" / name).read_text(encoding="utf-8")


def _inert(json_text: str) -> str:
    """Escape JSON so that it cannot close the script element that contains it."""
    return json_text.replace("<", "\\u003c")
