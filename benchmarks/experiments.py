"""The paper's experiments that need no training; each turns a folder of meshes into a page."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

from benchmarks.compare import Entry, about, curve_chart, mesh_by_mesh, trade_off
from benchmarks.page import Heading, Page, Text
from benchmarks.runner import Bench
from benchmarks.store import BenchTask, Row
from benchmarks.tables import Table, common_meshes, comparison, details, failures
from benchmarks.tuning import CLOSE, Point, tune
from rlacd.errors import OptionError

TARGETS = (0.15, 0.10)
"""The paper's two accuracies."""

TABLE_1_METHODS = (
    "coacd",
    "navacd:space",
    "navacd",
    "greedy-hull-sum",
    "random-10+edges",
    "greedy",
    "greedy:balanced",
    "greedy:best",
)

APART = 0.05
"""A method whose mean D_h stays farther than this from the target, relative to it, is marked."""

PAPER: Mapping[str, tuple[float | None, ...]] = {
    "CoACD": (10.7, 21.9, 44.2, 52.3),
    "NavACD": (6.9, 0.3, 30.5, 1.3),
    "greedy over all planes": (None, None, 28.3, 13.2),
    "RL-ACD": (6.0, 1.3, 25.9, 3.6),
}
"""Mean #P and seconds at the first target, and at the second, as published."""


def paper_table_1() -> Table:
    """Format the paper's numbers like ours: parts, ratio to CoACD's parts, and seconds, at both accuracies."""
    lines = []
    for method, numbers in PAPER.items():
        cells: list[object] = [method]
        for parts, seconds, coacd in zip(numbers[::2], numbers[1::2], PAPER["CoACD"][::2], strict=True):
            cells += ["–"] * 3 if parts is None or coacd is None else [parts, f"{parts / coacd:.2f}", seconds]
        lines.append(cells)
    header = ["the paper, 305 models of ShapeNet", *(f"{name} at {t:.2f}" for t in TARGETS for name in PAPER_COLUMNS)]
    note = "As published; 16-core CPU and RTX 3090. Other meshes than here: only ratios can be compared."
    return Table(header, lines, note)


PAPER_COLUMNS = ("#P", "#P / CoACD's", "s")


def equal_accuracy(
    bench: Bench, methods: Sequence[str], targets: Sequence[float], title: str, close: float = CLOSE
) -> Page:
    """Tune each method to the same mean D_h and compare (4.4, Tables 1 and 4)."""
    page = Page(title, [about(bench)])
    everything: list[Row] = []
    for target in targets:
        tuned = [(method, tune(bench, method, target, close)) for method in methods]
        entries = [Entry(method, point.setting, point.rows) for method, point in tuned]
        everything += [row for entry in entries for row in entry.rows]
        groups = [(_label(method, point, target), point.rows) for method, point in tuned]
        page.add(Heading(f"Mean D_h {target:g}"), comparison(groups), details(groups))
        shared = common_meshes(entry.rows for entry in entries)
        if shared:
            page.add(replace(trade_off(entries, shared), name=f"pareto_{target:g}.svg"))
            page.add(mesh_by_mesh(entries))
    page.add(Heading("Parts against D_h"), *curve_chart(bench, methods))
    page.add(Heading("The paper's numbers"), paper_table_1())
    page.add(Heading("Failures"), Text(failures(everything)))
    return page


def _label(method: str, point: Point, target: float) -> str:
    missed = " (target out of reach)" if not abs(point.hausdorff - target) <= APART * target else ""
    return f"{method} @ {point.setting:g}{missed}"


def vhacd_at_equal_parts(bench: Bench, reference: str, setting: float) -> Page:
    """Compare with V-HACD, limited on each mesh to the reference's number of hulls (4.4.2)."""
    ours = bench.run(reference, setting)
    counts = {row["mesh"]: row["parts"] for row in ours if "error" not in row}
    theirs = bench.run_tasks([BenchTask(mesh, "vhacdx:hulls", float(n)) for mesh, n in counts.items()])
    entries = [Entry(reference, setting, ours), Entry("vhacdx:hulls", setting, theirs)]
    page = Page("V-HACD at equal part count", [about(bench)])
    groups = [(entries[0].label, ours), ("V-HACD 4, at most as many hulls", theirs)]
    page.add(comparison(groups), details(groups))
    lines = []
    for row in theirs:
        own = next(r for r in ours if r["mesh"] == row["mesh"])
        cells = ["failed"] * 3 if "error" in row else [row["parts"], _three(row["hausdorff"]), _two(row["volume"])]
        lines.append([row["mesh"], own["parts"], _three(own["hausdorff"]), _two(own["volume"]), *cells])
    header = ["mesh", f"#P {reference}", "D_h", "Σ hull / solid", "#P V-HACD", "D_h", "Σ hull / solid"]
    page.add(Heading("Mesh by mesh"), Table(header, lines))
    page.add(Heading("Failures"), Text(failures([*ours, *theirs])))
    return page


def _three(x: float) -> str:
    return f"{x:.3f}"


def _two(x: float) -> str:
    return f"{x:.2f}"


TABLE_2_ARMS = {
    "all planes": "planes",
    "without spatial planes": "planes:no-spatial",
    "without PCA planes": "planes:no-principal",
    "without concave edges' planes": "planes:ce=0",
}

RANDOM_ARM = {"random planes, #AP 10, #CE 4": "planes:random"}
"""The control: random planes in place of the ranking's best."""


def kinds_of_planes(bench: Bench, ranking: str, setting: float) -> Page:
    """Leave out one kind of planes at a time (Table 2)."""
    arms = {label: f"{name}:{ranking}" for label, name in TABLE_2_ARMS.items()} | RANDOM_ARM
    return _arms(bench, "Kinds of planes (Table 2)", arms, setting)


def numbers_of_planes(bench: Bench, ranking: str, setting: float, planes: Sequence[int], edges: Sequence[int]) -> Page:
    """Vary the numbers of ranked planes (#AP) and concave edges (#CE), one at a time (Table 3)."""
    if not planes and not edges:
        raise OptionError("there is nothing to vary; give numbers of planes or of edges.")
    arms = {f"#AP {n}, #CE 4": f"planes:ap={n}:{ranking}" for n in planes}
    arms |= {f"#AP 10, #CE {n}": f"planes:ce={n}:{ranking}" for n in edges}
    first = {"#AP 10, #CE 4": f"planes:{ranking}"}
    arms = {**first, **{label: name for label, name in arms.items() if label not in first}, **RANDOM_ARM}
    return _arms(bench, "Numbers of planes (Table 3)", arms, setting)


def _arms(bench: Bench, title: str, arms: dict[str, str], setting: float) -> Page:
    rows = {label: bench.run(name, setting) for label, name in arms.items()}
    page = Page(title, [about(bench)])
    page.add(
        Text(
            "The ranking's best planes along the axes (#AP) and those of concave edges (#CE, three each) are cut for "
            f"real as far as the sum of hull volumes goes, and the least is taken; concavity threshold {setting:g}."
        ),
        comparison(list(rows.items())),
    )
    page.add(Heading("Failures"), Text(failures([row for some in rows.values() for row in some])))
    return page
