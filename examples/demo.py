"""Decompose the sample and leave hulls, a picture and a report in ``demo/``: what ``make demo`` runs."""

from __future__ import annotations

import time
import warnings
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from sample import sample

import rlacd
from rlacd.cli.terminal import summary
from rlacd.plain_json import to_json


def main() -> None:
    """Make the sample, decompose it, write the results, and tell where they are."""
    warnings.simplefilter("ignore", rlacd.DecompositionWarning)  # the summary says them
    folder = Path(__file__).resolve().parent.parent / "demo"
    folder.mkdir(exist_ok=True)
    mesh, hulls, picture, report = (folder / f"chair{end}" for end in (".glb", "_hulls.glb", ".png", "_report.json"))

    with step("making a chair"):
        sample().export(mesh)
    with step("decomposing it into convex hulls"):
        result = rlacd.decompose(mesh)
        result.save(hulls)
        report.write_text(to_json(result.report), encoding="utf-8")
    with step("drawing it"):
        result.save_picture(picture, up="y")

    print(f"\n{summary(result, hulls.name)}")
    print(f"\n  input    {mesh}\n  hulls    {hulls}\n  picture  {picture}\n  report   {report}")
    print(f"\nnext: .venv/bin/rlacd view {mesh}")


@contextmanager
def step(what: str) -> Iterator[None]:
    """Print a line for what is done, and how long it took."""
    print(f"{what} ...", end="", flush=True)
    begun = time.monotonic()
    yield
    print(f" {time.monotonic() - begun:.1f} s", flush=True)


if __name__ == "__main__":
    main()
