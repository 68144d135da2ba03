"""A headless Chromium for the tests of the pages, where there is one."""

from __future__ import annotations

import os
import shutil
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import pytest

NAMES = ("chromium", "chromium-browser", "google-chrome", "google-chrome-stable", "chrome")
WITHOUT_GPU = ["--use-gl=angle", "--use-angle=swiftshader", "--enable-unsafe-swiftshader"]
PATIENCE = 60_000  # milliseconds


def chromium() -> str:
    """Path of Chromium: $RLACD_CHROMIUM, or one on the path; skips where there is none."""
    found = os.environ.get("RLACD_CHROMIUM") or next(filter(None, map(shutil.which, NAMES)), None)
    if found is None:
        pytest.skip("no Chromium is installed (set RLACD_CHROMIUM to its path)")
    return found


class Watched:
    """A page with everything it complained of and asked for."""

    def __init__(self, context: Any) -> None:
        self.page = context.new_page()
        self.page.set_default_timeout(PATIENCE)
        self.complaints: list[str] = []
        self.requests: list[str] = []
        self.page.on("pageerror", lambda error: self.complaints.append(str(error)))
        self.page.on("console", self._on_console)
        self.page.on("request", lambda request: self.requests.append(request.url))

    def _on_console(self, message: Any) -> None:
        # Chromium itself warns of slow pixel reads, which only a test makes.
        if message.type in ("error", "warning") and "GPU stall" not in message.text:
            self.complaints.append(message.text)

    def outside(self, *own: str) -> list[str]:
        """What was asked of anyone but `own` addresses."""
        return [url for url in self.requests if not url.startswith((*own, "data:", "blob:"))]


@contextmanager
def open_driver() -> Iterator[Any]:
    """Start playwright, of which a process can have one at a time; skips where it is not installed."""
    playwright = pytest.importorskip("playwright.sync_api", reason="playwright is not installed")
    with playwright.sync_playwright() as driver:
        yield driver


@contextmanager
def open_browser(driver: Any, *arguments: str) -> Iterator[Any]:
    """Start Chromium, drawing in software unless told otherwise; skips where there is none."""
    path = chromium()
    # Containers run as root, where Chromium's sandbox does not start.
    alone = ["--no-sandbox"] if hasattr(os, "geteuid") and os.geteuid() == 0 else []
    browser = driver.chromium.launch(executable_path=path, args=[*(arguments or WITHOUT_GPU), *alone])
    try:
        yield browser
    finally:
        browser.close()


@contextmanager
def open_page(browser: Any, **options: Any) -> Iterator[Watched]:
    """Open an empty page that shares nothing with others; `options` are those of a browser context."""
    context = browser.new_context(viewport={"width": 1366, "height": 768}, **options)
    try:
        yield Watched(context)
    finally:
        context.close()


def pixels(page: Any) -> Any:
    """What the 3-D view shows, uint8 [H, W, 4]."""
    import io

    import numpy as np
    from PIL import Image

    return np.asarray(Image.open(io.BytesIO(page.locator("#canvas").screenshot())).convert("RGBA"), dtype=np.int16)


def change(before: Any, after: Any) -> float:
    """Share of the pixels that look different."""
    return float((abs(before - after).max(axis=2) > 12).mean())
