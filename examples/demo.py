"""Decompose the sample and leave hulls, a picture and a report in ``demo/``: what ``make demo`` runs."""

from __future__ import annotations

from pathlib import Path

from sample import sample

import rlacd
from rlacd.cli.terminal import summary
from rlacd.plain_json import to_json


def main() -> None:
    """Make the sample, decompose it, write the results, and tell where they are."""
    folder = Path(__file__).resolve().parent.parent / "demo"
    folder.mkdir(exist_ok=True)
    mesh, hulls, picture, report = (folder / f"chair{end}" for end in (".glb", "_hulls.glb", ".png", "_report.json"))

    sample().export(mesh)
    result = rlacd.decompose(mesh)
    result.save(hulls)
    report.write_text(to_json(result.report), encoding="utf-8")
    result.picture(picture, up="y")

    print(summary(result, "chair.glb"))
    print(f"\n  input    {mesh}\n  hulls    {hulls}\n  picture  {picture}\n  report   {report}")


if __name__ == "__main__":
    main()
