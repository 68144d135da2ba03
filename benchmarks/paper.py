"""The paper's tables that need no training: RL-ACD, sections 4.4 and 4.5."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Annotated, TypeAlias

import typer

from benchmarks.charts import Curve, curves_chart, need_charts
from benchmarks.cli import Threshold, check_methods, experiment, words
from benchmarks.compare import about, comparison, mean_of_shared, mesh_by_mesh
from benchmarks.runner import Bench
from benchmarks.store import Row, Task
from benchmarks.tables import Page, Table, failures
from benchmarks.tuning import CLOSE, Point, known_curve, tune
from rlacd.errors import OptionError

app = typer.Typer(add_completion=False, no_args_is_help=True, help=__doc__)

TARGETS = (0.15, 0.10)
"""The paper's two accuracies."""

TABLE_1 = "coacd,fast:policy=navacd:space,fast:policy=navacd,fast:policy=greedy-hull-sum,fast,default,best"

GREEDY = (
    "fast:policy=greedy-hull-sum,fast:policy=greedy-hull-sum+edges,fast:policy=random-10+edges,"
    "fast:policy=random-1+edges,fast:policy=navacd,fast"
)

APART = 0.05
"""A method whose mean D_h stays farther than this from the target, relative to it, is marked."""

PAPER = Table(
    ["the paper, 305 models of ShapeNet", "#P at 0.15", "/ CoACD's", "s", "#P at 0.10", "/ CoACD's", "s"],
    [
        ["CoACD", 10.7, "1.00", 21.9, 44.2, "1.00", 52.3],
        ["NavACD", 6.9, "0.64", 0.3, 30.5, "0.69", 1.3],
        ["greedy over all planes", "–", "–", "–", 28.3, "0.64", 13.2],
        ["RL-ACD", 6.0, "0.56", 1.3, 25.9, "0.59", 3.6],
    ],
    "As published; 16-core CPU and RTX 3090. Other meshes than here: only ratios can be compared.",
)
"""Mean #P and seconds at both targets."""

MeanError: TypeAlias = Annotated[list[float] | None, typer.Option(help="Mean D_h to tune to; may be repeated.")]
Close: TypeAlias = Annotated[float, typer.Option(min=0.001, help="How far from it the mean may be, relative to it.")]
Ranking: TypeAlias = Annotated[str, typer.Option(help="What ranks the axis planes: excess, random or FILE.npz.")]


def _check(methods: str, **_: object) -> None:
    need_charts()
    check_methods(methods)


@experiment(app, "table-1", _check)
def table_1(bench: Bench, methods: str = TABLE_1, at: MeanError = None, close: Close = CLOSE) -> Page:
    """Tune every method to the same mean D_h, then compare (4.4.1; Table 4 with a folder of other meshes)."""
    return _equal_accuracy(bench, "Equal accuracy (Tables 1 and 4)", methods, at, close)


@experiment(app, "greedy", _check)
def greedy(bench: Bench, methods: str = GREEDY, at: MeanError = None, close: Close = CLOSE) -> Page:
    """The same for greedy policies, one step ahead, and random shortlists; add planes:FILE.npz (4.4.3)."""
    return _equal_accuracy(bench, "Greedy against the policy (4.4.3)", methods, at, close)


def _equal_accuracy(bench: Bench, title: str, methods: str, targets: Sequence[float] | None, close: float) -> Page:
    page, everything = Page(title, [about(bench)]), list[Row]()
    for target in targets or TARGETS:
        tuned = {method: tune(bench, method, target, close) for method in words(methods)}
        groups = {_label(method, point, target): point.rows for method, point in tuned.items()}
        page.add(f"## Mean D_h {target:g}", comparison(groups), mesh_by_mesh(groups))
        everything += [row for rows in groups.values() for row in rows]
    page.add("## Parts against D_h")
    page.chart("curves.svg", *_curves(bench, words(methods)))
    page.add("## The paper's numbers", PAPER, "## Failures", failures(everything))
    return page


def _label(method: str, point: Point, target: float) -> str:
    missed = " (target out of reach)" if not abs(point.hausdorff - target) <= APART * target else ""
    return f"{method} @ {point.setting:g}{missed}"


def _curves(bench: Bench, methods: Sequence[str]) -> tuple[bytes, str]:
    drawn = []
    for method in methods:
        points = [point for point in known_curve(bench, method) if point.good]
        columns = [mean_of_shared([point.rows for point in points], key) for key in ("hausdorff", "parts")]
        drawn.append(Curve(method, *columns))
    return curves_chart(drawn, "mean D_h", "mean parts", log_y=True), "Parts against accuracy; lower left is better."


@experiment(app, "vhacd", lambda reference, **_: check_methods(f"vhacd,{reference}"))
def vhacd(
    bench: Bench,
    reference: Annotated[str, typer.Option(help="The method whose number of hulls V-HACD is given.")] = "fast",
) -> Page:
    """Give V-HACD as many hulls as rlacd made of each mesh, and compare how tight they are (4.4.2)."""
    ours = bench.run(reference)
    tasks = [Task(row["mesh"], "vhacd", float(row["parts"])) for row in ours if "error" not in row]
    groups = {reference: ours, "V-HACD 4, at most as many hulls": bench.run_tasks(tasks)}
    page = Page("V-HACD at equal part count", [about(bench), comparison(groups), mesh_by_mesh(groups)])
    page.add("## Failures", failures(row for rows in groups.values() for row in rows))
    return page


KINDS = {
    "all planes": "planes",
    "without spatial planes": "planes:no-spatial",
    "without PCA planes": "planes:no-principal",
    "without concave edges' planes": "planes:ce=0",
}

CONTROL = {"random planes, #AP 10, #CE 4": "planes:random"}
"""Random planes in place of the ranking's best."""


@experiment(app, "table-2")
def table_2(bench: Bench, ranking: Ranking = "excess", threshold: Threshold = 0.05) -> Page:
    """Leave out spatial planes, PCA planes, planes of concave edges (Table 2)."""
    arms = {label: f"{name}:{ranking}" for label, name in KINDS.items()} | CONTROL
    return _arms(bench, "Kinds of planes (Table 2)", arms, threshold)


@experiment(app, "table-3", lambda planes, edges, **_: _counts(f"{planes},{edges}"))
def table_3(
    bench: Bench,
    planes: Annotated[str, typer.Option(help="#AP: ranked planes that go on.")] = "1,5,10,20,50,150",
    edges: Annotated[str, typer.Option(help="#CE: concave edges asked.")] = "0,4,16,64",
    ranking: Ranking = "excess",
    threshold: Threshold = 0.05,
) -> Page:
    """Vary the numbers of planes and of concave edges (Table 3)."""
    arms = {"#AP 10, #CE 4": f"planes:{ranking}"}
    arms |= {f"#AP {n}, #CE 4": f"planes:ap={n}:{ranking}" for n in _counts(planes) if n != 10}
    arms |= {f"#AP 10, #CE {n}": f"planes:ce={n}:{ranking}" for n in _counts(edges) if n != 4}
    return _arms(bench, "Numbers of planes (Table 3)", arms | CONTROL, threshold)


def _arms(bench: Bench, title: str, arms: Mapping[str, str], threshold: float) -> Page:
    check_methods(",".join(arms.values()))
    groups = {label: bench.run(name, threshold) for label, name in arms.items()}
    text = (
        "The ranking's best planes along the axes (#AP) and those of concave edges (#CE, three each) are cut for real "
        f"as far as the sum of hull volumes goes, and the least is taken; concavity threshold {threshold:g}."
    )
    page = Page(title, [about(bench), text, comparison(groups)])
    page.add("## Failures", failures(row for rows in groups.values() for row in rows))
    return page


def _counts(text: str) -> list[int]:
    if not all(word.isdecimal() for word in words(text)):
        raise OptionError(f"{text!r} should be whole numbers with commas between.")
    return [int(word) for word in words(text)]
