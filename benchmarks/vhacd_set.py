"""The meshes of V-HACD's own set, on which VisACD (Eurographics 2026) and CoACD (SIGGRAPH 2022) are compared."""

from __future__ import annotations

import statistics

import click

from benchmarks.cli import check_methods, experiment, words
from benchmarks.compare import about, comparison, mesh_by_mesh
from benchmarks.methods import make_method
from benchmarks.runner import Bench
from benchmarks.tables import Page, Table, failures, managed, mean

PUBLISHED = {"VisACD": (28.4, 0.043), "CoACD": (31.6, 0.048), "Thul": (34.4, 0.069), "V-HACD": (57.6, 0.118)}
"""Mean parts and mean concavity over 61 meshes, at CoACD's threshold 0.05, as VisACD's paper gives them."""

METHODS = "fast,default,fast@0.043,default@0.043,coacd,vhacd"
"""0.043 is VisACD's mean concavity; as a threshold it bounds every part of every mesh."""


def _split(word: str) -> tuple[str, float]:
    name, _, setting = word.partition("@")
    return name, float(setting) if setting else make_method(name).default


@experiment(lambda methods: check_methods(",".join(word.partition("@")[0] for word in words(methods))), fresh=False)
@click.option("--methods", default=METHODS, help="As for compare; NAME@SETTING sets another threshold.")
def app(bench: Bench, methods: str) -> Page:
    """Parts and concavity on V-HACD's set, beside published figures.

    The concavity of a mesh is that of its worst part (CoACD's measure; longest side 2), here decided by bounds and not
    by samples; the table has its mean over the meshes. Published figures are over 61 meshes, four of which are too
    large to be here. CoACD takes more than an hour.

    \b
    python -m benchmarks vhacd-set ../shared/meshes/vhacd_set --out RUN
    """
    pairs = [_split(word) for word in words(methods)]
    groups = bench.run_together({f"{name} @ {setting:g}": (name, setting) for name, setting in pairs})
    good = {label: rows for label, rows in managed(groups).items() if rows}
    lines: list[list[object]] = []
    for label, rows in good.items():
        overlap = [row["overlap"] for row in rows]
        lines.append(
            [
                label,
                f"{mean(rows, 'parts'):.1f}",
                f"{mean(rows, 'concavity'):.3f}",
                f"{max(row['concavity'] for row in rows):.3f}",
                f"{statistics.median(overlap):.1%}, {sum(share <= 1e-6 for share in overlap)}",
                f"{mean(rows, 'cpu'):.2f}",
            ]
        )
    lines += [[f"{tool}, published (61 meshes)", *numbers, "", "", ""] for tool, numbers in PUBLISHED.items()]
    count = len(next(iter(good.values()), []))
    header = [f"{count} meshes", "parts", "concavity", "worst", "overlap: median, meshes without", "CPU s"]
    page = Page("V-HACD's set", [about(bench, groups), Table(header, lines), comparison(groups), mesh_by_mesh(groups)])
    page.blocks.append(failures(row for rows in groups.values() for row in rows))
    return page
