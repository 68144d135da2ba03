"""Output of the command line during and after the work, and graceful stopping by Ctrl-C and SIGTERM."""

from __future__ import annotations

import sys
import threading
from collections import Counter
from collections.abc import Iterator
from contextlib import contextmanager
from types import FrameType
from typing import TYPE_CHECKING, Any

from rlacd._native import count_interrupts, forget_interrupts
from rlacd.cli.exit_codes import ExitCode, say
from rlacd.cli.lean import handling
from rlacd.run import Progress, ProgressCallback

if TYPE_CHECKING:
    from rich.progress import Progress as Bars

    from rlacd.decomposition import Decomposition
    from rlacd.fit import Unit
    from rlacd.io.robots import RewrittenRobot


@contextmanager
def watching(*, quiet: bool) -> Iterator[ProgressCallback]:
    """Show progress on a terminal and turn Ctrl-C and SIGTERM into a graceful stop.

    The first one makes the decomposition stop at its next step and keep its result so far; the second interrupts at
    once. The bar is drawn only if stderr is a terminal.
    """
    bar = None if quiet else open_bar("{task.description:<12}", None, "{task.fields[parts]} parts", parts=0)

    def shown(progress: Progress) -> bool:
        if bar is not None:
            known: dict[str, Any] = {"description": progress.stage, "completed": progress.done, "total": progress.total}
            bar.update(bar.task_ids[0], **known, parts=progress.parts)
        return not wanted.is_set()

    try:
        with graceful_stop("the result so far will be written", in_kernels=True) as wanted:
            yield shown
    finally:
        if bar is not None:
            bar.stop()


@contextmanager
def graceful_stop(said: str, *, in_kernels: bool = False) -> Iterator[threading.Event]:
    """Set an event at the first Ctrl-C or SIGTERM, and say so; the second interrupts at once, also kernels."""
    wanted = threading.Event()

    def on_interrupt(number: int, frame: FrameType | None) -> None:
        if wanted.is_set():
            raise KeyboardInterrupt
        wanted.set()
        say(f"stopping; {said} (Ctrl-C again to quit at once)")

    with handling(on_interrupt):
        counts = in_kernels and threading.current_thread() is threading.main_thread()
        if counts:
            count_interrupts(ExitCode.INTERRUPTED, 1.0)  # the second one leaves a second to end in good order
        try:
            yield wanted
        finally:
            if counts:
                forget_interrupts()


def open_bar(*columns: str | None, **fields: Any) -> Bars | None:
    """Draw a bar of one task on the terminal, with a text before or after it for each column; None without a terminal.

    The library is imported only here, which takes a tenth of a small mesh's time.
    """
    if sys.stderr is None or not sys.stderr.isatty():
        return None
    from rich.console import Console
    from rich.progress import BarColumn, Progress, TextColumn, TimeElapsedColumn

    drawn = [BarColumn() if text is None else TextColumn(text, markup=False) for text in columns]
    bar = Progress(*drawn, TimeElapsedColumn(), console=Console(stderr=True), transient=True)
    bar.add_task("starting", total=None, **fields)
    bar.start()
    return bar


@contextmanager
def writing(what: str, path: str, *, quiet: bool) -> Iterator[None]:
    """Show on a terminal that another file is being made, then print where it is."""
    bar = None if quiet else open_bar(f"{what} ...", None)
    try:
        yield
    finally:
        if bar is not None:
            bar.stop()
    if not quiet:
        say(f"  {what}: {path}")


def summary(result: Decomposition, written: str) -> str:
    """Summarise the result in a few lines: its size, its quality, and any warnings."""
    report = result.report
    triangles = sum(len(hull.faces) for hull in result)
    total = report.seconds.get("total")
    time = ("" if total is None else f", {total:.2f} s") + STOPPED[report.stopped_by]
    lines = [f"{written}: {counted(len(result), 'hull', 'hulls')}, {triangles} triangles{time}"]
    lines += [f"  {fit}" for fit in [report.fit_words()] if fit]
    lines += [f"  {moved}" for moved in [report.repair_words()] if moved]
    if (unit := report.options.get("unit")) not in (None, "m"):
        lines.append(f"  converted to metres (--unit {unit}): hulls, and places in warnings")
    if report.deviation_abs is not None:
        moved = report.unit.words(report.deviation_abs)
        lines.append(f"  measured to triangles, up to {moved} from the surface in the file")
    least, parts = report.lower_bound or 1, report.hulls
    if 1 < least <= parts:
        fewer = "fewer hulls" if least == parts else f"fewer than {least} hulls"
        lines.append(f"  no decomposition to this tolerance has {fewer}")
    if report.search is not None and report.search.level == "best" and least < parts:
        searched, idle = report.search.seconds, report.search.seconds - report.search.last_gain
        lines.append(f"  the search saved no hull in the last {idle:.1f} of {searched:.1f} s")
    kinds = Counter(shape.kind for shape in result.primitives if shape is not None)
    words = [counted(kinds[kind], kind, "boxes" if kind == "box" else f"{kind}s") for kind in sorted(kinds)]
    lines += [f"  of them {', '.join(words)}"] if words else []
    lines += [f"  warning: {warning}" for warning in report.warnings]
    return "\n".join(lines)


def rewrite_summary(done: RewrittenRobot) -> str:
    """Summarise the result for a robot: a line for each link that collides, and totals."""
    if not done.replaced:
        return "\n".join([f"{done.path}: written", *(f"  warning: {warning}" for warning in done.warnings)])
    meshes = sum(len(link.meshes) for link in done.links)
    hulls = sum(len(link.files) for link in done.links)
    made = f"{counted(len(done.replaced), 'link', 'links')}, {counted(hulls, 'hull', 'hulls')} in {done.folder}"
    lines = [f"{done.path}: {made}, {done.seconds:.2f} s"]
    width = max(len(link.name) for link in done.links)
    for link in done.links:
        sizes = f"{counted(len(link.meshes), 'mesh', 'meshes'):>9}  {counted(len(link.files), 'hull', 'hulls'):>8}"
        told = [_farthest(link.added, done.unit)] * bool(link.meshes)
        told += [counted(link.primitives, "primitive", "primitives")] * bool(link.primitives)
        lines.append(f"  {link.name:{width}} {sizes if link.meshes else 19 * ' '}  {', '.join(told)}")
    each = f"{hulls / len(done.replaced):.1f} hulls a link for {counted(meshes, 'mesh', 'meshes')}"
    lines.append(f"  {each}; {_farthest(done.added, done.unit)}")
    if done.samples:
        kept = sum(pair.kept_clear for pair in done.pairs)
        looked = (
            f"{counted(len(done.pairs), 'pair', 'pairs')} of links at {counted(done.samples, 'position', 'positions')}"
        )
        lines.append(f"  {looked}: {kept} kept clear by finer hulls")
        if (within := done.touch_within) is not None:
            lines.append(f"  at others, hulls may touch where links are within {done.unit.words(within)}")
    lines += [f"  warning: {warning}" for warning in done.warnings]
    return "\n".join(lines)


def _farthest(length: float | None, unit: Unit) -> str:
    """How far hulls reach beyond the meshes."""
    return "not measured" if length is None else f"farthest {unit.words(length)}"


def counted(count: int, one: str, many: str) -> str:
    """Format a count with the singular or plural noun."""
    return f"{count} {one if count == 1 else many}"


STOPPED = {None: "", "timeout": ", stopped by the timeout", "cancel": ", stopped by Ctrl-C or SIGTERM"}
