"""The contents of a comparison: each method at its own setting, at equal accuracy, and over a sweep of settings."""

from __future__ import annotations

import platform
import statistics
from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path

from benchmarks.charts import Curve, curves_chart, pareto_chart
from benchmarks.methods import make_method
from benchmarks.page import Figure, Heading, Page, Text
from benchmarks.runner import Bench
from benchmarks.sheets import draw_sheet
from benchmarks.store import BenchTask, Row, load_hulls
from benchmarks.tables import Table, as_csv, common_meshes, comparison, details, failures, short_names
from benchmarks.tuning import Point, known_curve
from rlacd.errors import MissingExtraError
from rlacd.io.write import write_file

DEFAULT_METHODS = (
    "coacd",
    "vhacdx:hulls",
    "navacd",
    "greedy",
    "greedy:balanced",
    "greedy:best",
)
"""The methods that `python -m benchmarks compare` runs by default."""


@dataclass(frozen=True)
class Entry:
    """A method at one setting, on every mesh."""

    method: str
    setting: float
    rows: list[Row]

    @property
    def label(self) -> str:
        """The method and its setting."""
        return f"{self.method} @ {self.setting:g}"


def at_settings(bench: Bench, methods: Sequence[str], threshold: float | None = None) -> list[Entry]:
    """Run methods, each at its tool's default setting, or at `threshold` if it has a concavity threshold."""
    entries = []
    for name in methods:
        method = make_method(name)
        setting = threshold if threshold is not None and method.setting == "threshold" else method.default
        entries.append(Entry(name, setting, bench.run(name, setting)))
    return entries


def compare_page(bench: Bench, title: str, entries: Sequence[Entry], pictures: int = 0, up: str = "z") -> Page:
    """Build a page on the meshes that all entries solved: table, trade-off, details per mesh, failures, pictures."""
    page = Page(title, [about(bench)])
    groups = [(entry.label, entry.rows) for entry in entries]
    page.add(comparison(groups), details(groups))
    shared = common_meshes(rows for _, rows in groups)
    if shared:
        page.add(trade_off(entries, shared), Heading("Mesh by mesh"), mesh_by_mesh(entries))
    page.add(Heading("Failures"), Text(failures(row for entry in entries for row in entry.rows)))
    if pictures:
        page.add(Heading("Pictures"), *sheets(bench, entries, bench.names[:pictures], up))
    return page


def about(bench: Bench) -> Text:
    """Describe the data and the measurements."""
    versions = sorted({f"{_package(r['method'])} {r['version']}" for r in bench.store.rows() if "version" in r})
    limits = bench.limits
    return Text(
        f"{len(bench.names)} meshes; {', '.join(versions)}; {limits.threads} thread{'s' * (limits.threads != 1)} each, "
        f"{limits.jobs} at a time, at most {limits.seconds:g} s each; {machine()}, Python {platform.python_version()}. "
        "Lengths where the longest side of the input is 2. D_h is the two-sided Hausdorff distance between the input's "
        "surface and the surface of the union of the hulls; over and under are its two directions. Concavity is "
        "decided by bounds on the repaired input inside each hull. CPU seconds are those of all threads, from arrays "
        "in memory to hulls in memory."
    )


@lru_cache(maxsize=1)
def machine() -> str:
    """Name of the processor."""
    try:
        for line in Path("/proc/cpuinfo").read_text(encoding="utf-8").splitlines():
            if line.startswith("model name"):
                return line.partition(":")[2].strip()
    except OSError:
        pass
    return platform.processor() or platform.machine()


def trade_off(entries: Sequence[Entry], shared: set[str]) -> Figure:
    """Plot mean parts against mean CPU seconds."""
    points = [(entry.label, _mean(entry.rows, shared, "cpu"), _mean(entry.rows, shared, "parts")) for entry in entries]
    drawn = pareto_chart(points, "mean CPU seconds", "mean parts")
    return Figure("pareto.svg", drawn, "Fewer parts and less time are better; the line joins what nothing beats.")


def mesh_by_mesh(entries: Sequence[Entry]) -> Table:
    """Parts and D_h of each method on each mesh."""
    by_mesh = {entry.label: {row["mesh"]: row for row in entry.rows} for entry in entries}
    lines = [
        [name, *(_cell(by_mesh[entry.label].get(mesh)) for entry in entries)]
        for mesh, name in short_names([row["mesh"] for row in entries[0].rows]).items()
    ]
    return Table(["mesh", *(entry.label for entry in entries)], lines, "#P / D_h / CPU seconds.")


def _cell(row: Row | None) -> str:
    if row is None or "error" in row:
        return "failed"
    return f"{row['parts']} / {row['hausdorff']:.3f} / {row['cpu']:.2f}"


def _mean(rows: Sequence[Row], shared: set[str], key: str) -> float:
    return statistics.fmean(row[key] for row in rows if row["mesh"] in shared)


def _package(method: str) -> str:
    base = method.partition(":")[0]
    return base if base in ("coacd", "vhacdx") else "rlacd"


def curve_chart(bench: Bench, methods: Sequence[str]) -> tuple[Figure, Table]:
    """Plot mean parts against mean D_h over all settings at which a method has finished every mesh."""
    lines: list[list[object]] = []
    drawn = []
    for method in methods:
        points = [point for point in known_curve(bench, method) if point.good]
        shared = common_meshes(point.rows for point in points)
        values = [(p.setting, *_means(p, shared)) for p in points if shared]
        if values:
            drawn.append(Curve(method, [v[1] for v in values], [v[2] for v in values]))
        lines += [
            [method, f"{setting:g}", f"{hausdorff:.3f}", f"{parts:.1f}", f"{cpu:.2f}"]
            for setting, hausdorff, parts, cpu in values
        ]
    chart = curves_chart(drawn, "mean D_h", "mean parts", log_y=True)
    table = Table(["method", "number", "mean D_h", "mean #P", "mean CPU s"], lines)
    return Figure("curves.svg", chart, "Parts against accuracy; lower left is better."), table


def _means(point: Point, shared: set[str]) -> tuple[float, float, float]:
    return tuple(_mean(point.rows, shared, key) for key in ("hausdorff", "parts", "cpu"))  # type: ignore[return-value]


def sheets(bench: Bench, entries: Sequence[Entry], meshes: Sequence[str], up: str = "z") -> list[Figure | Text]:
    """Draw each mesh with the hulls of every method that solved it."""
    drawn: list[Figure | Text] = []
    names = short_names(bench.names)
    for mesh in meshes:
        managed = []
        for entry in entries:
            row = next((row for row in entry.rows if row["mesh"] == mesh and "error" not in row), None)
            path = bench.store.hulls_of(BenchTask(mesh, entry.method, entry.setting))
            if row is not None and path.exists():
                managed.append((entry.label, load_hulls(path)[0], row))
        axis = "y" if Path(mesh).suffix.lower() in (".glb", ".gltf") else up
        try:
            content = draw_sheet(bench.meshes / mesh, managed, axis)
        except MissingExtraError as error:
            return [Text(f"No pictures: {error}")]
        drawn.append(Figure(f"{names[mesh].replace('/', '-')}.png", content, mesh))
    return drawn


def save_csv(bench: Bench, folder: Path) -> None:
    """Write every row of the store to ``results.csv``.

    Raises
    ------
    OutputError
        The folder cannot be written to.
    """
    write_file(folder / "results.csv", as_csv(bench.store.rows()).encode())
