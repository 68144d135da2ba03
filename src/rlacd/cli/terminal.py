"""Output of the command line during and after the work, and graceful stopping by Ctrl-C."""

from __future__ import annotations

import signal
import threading
from collections import Counter
from collections.abc import Iterator
from contextlib import contextmanager, nullcontext
from types import FrameType, TracebackType
from typing import TYPE_CHECKING, Any

from rich.console import Console
from rich.progress import BarColumn, TextColumn, TimeElapsedColumn
from rich.progress import Progress as Bars

from rlacd.cli.exit_codes import say
from rlacd.decomposition import Decomposition
from rlacd.progress import Progress

if TYPE_CHECKING:
    from rlacd.io.robots import Rewritten


class Watch:
    """Shows progress on a terminal and turns Ctrl-C into a graceful stop.

    The first Ctrl-C makes the decomposition stop at its next step and keep its result so far; the second interrupts at
    once. The bar is drawn only if stderr is a terminal.
    """

    def __init__(self, *, quiet: bool) -> None:
        self.interrupted = False
        console = Console(stderr=True)
        self._bars = Bars(
            TextColumn("{task.description:<12}"),
            BarColumn(),
            TextColumn("{task.fields[parts]} parts"),
            TimeElapsedColumn(),
            console=console,
            transient=True,
            disable=quiet or not console.is_terminal,
        )
        self._task = self._bars.add_task("starting", total=None, parts=0)
        self._previous: Any = None

    def __enter__(self) -> Watch:
        # Python runs signal handlers only in the main thread, and refuses to set them from any other.
        if threading.current_thread() is threading.main_thread():
            self._previous = signal.signal(signal.SIGINT, self._on_interrupt)
        self._bars.start()
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, at: TracebackType | None) -> None:
        self._bars.stop()
        if self._previous is not None:
            signal.signal(signal.SIGINT, self._previous)

    def __call__(self, progress: Progress) -> bool:
        """Show `progress`; returns False if the user wants to stop."""
        self._bars.update(
            self._task,
            description=progress.stage,
            completed=progress.done,
            total=progress.total,
            parts=progress.parts,
        )
        return not self.interrupted

    def _on_interrupt(self, number: int, frame: FrameType | None) -> None:
        self.interrupted = True
        signal.signal(signal.SIGINT, signal.default_int_handler)
        say("stopping; the result so far will be written (Ctrl-C again to quit at once)")


@contextmanager
def writing(what: str, path: str, *, quiet: bool) -> Iterator[None]:
    """Show on a terminal that another file is being made, then print where it is."""
    console = Console(stderr=True)
    with console.status(f"{what} ...") if console.is_terminal and not quiet else nullcontext():
        yield
    if not quiet:
        say(f"  {what}: {path}")


def summary(result: Decomposition, written: str) -> str:
    """Summarise the result in a few lines: its size, its quality, and any warnings."""
    report = result.report
    triangles = sum(len(hull.faces) for hull in result)
    lines = [f"{written}: {_count(len(result))}, {triangles} triangles{_time(report)}"]
    lines += [f"  {fit}" for fit in [_fit(report)] if fit]
    lines += [f"  of them {kinds}" for kinds in [_primitives(result)] if kinds]
    lines += [f"  warning: {warning}" for warning in report.get("warnings", [])]
    return "\n".join(lines)


def rewrite_summary(done: Rewritten) -> str:
    """Summarise the result for a robot: its meshes, each with its number of hulls."""
    total = sum(len(mesh.files) for mesh in done.meshes)
    lines = [f"{done.path}: {counted(len(done.meshes), 'mesh', 'meshes')}, {_count(total)} in {done.folder}"]
    lines += [f"  {mesh.path.name}: {_count(len(mesh.files))}; {_fit(mesh.result.report)}" for mesh in done.meshes]
    lines += [f"  warning: {warning}" for warning in done.warnings]
    return "\n".join(lines)


def counted(count: int, one: str, many: str) -> str:
    """Format a count with the singular or plural noun."""
    return f"{count} {one if count == 1 else many}"


def _primitives(result: Decomposition) -> str:
    """How many parts are primitives, by kind."""
    kinds = Counter(shape.kind for shape in result.primitives if shape is not None)
    words = [counted(kinds[kind], kind, PLURALS.get(kind, f"{kind}s")) for kind in sorted(kinds)]
    return ", ".join(words)


PLURALS = {"box": "boxes"}


def _count(hulls: int) -> str:
    return counted(hulls, "hull", "hulls")


def _time(report: dict[str, Any]) -> str:
    total = report.get("seconds", {}).get("total")
    reason = {None: "", "timeout": ", stopped by the timeout", "cancel": ", stopped by Ctrl-C"}[
        report.get("stopped_by")
    ]
    return ("" if total is None else f", {total:.2f} s") + reason


def _fit(report: dict[str, Any]) -> str:
    words = []
    worst = report.get("concavity", {}).get("max")
    if worst is not None:
        threshold = report.get("options", {}).get("threshold")
        verdict = "" if threshold is None else f" (threshold {threshold:.4g}{', exceeded' * (worst > threshold)})"
        words.append(f"max concavity {worst:.4f}{verdict}")
    added = report.get("volume")
    if added is not None and added["max"] is not None:
        words.append(f"hulls add up to {100 * added['max']:.2f} % of volume (tolerance {100 * added['tolerance']:g} %)")
    space = report.get("navigable")
    if space is not None:
        intruding = space["intrusion"]["max"]
        words.append(
            f"there are {space['balls']} balls"
            if intruding is None
            else f"no hull touches any of the {space['balls']} balls"
            if intruding <= 0
            else f"hulls reach {intruding:.4f} into the {space['balls']} balls"
        )
    reach = report.get("hausdorff", {})
    if reach.get("over") is not None:
        missed = f"{reach['under']:.4f}"
        covered = "and cover it" if missed == "0.0000" else f"and miss it by up to {missed}"
        words.append(f"hulls extend up to {reach['over']:.4f} beyond the input {covered}")
    return "; ".join(words) + (" (longest side = 2)" if words else "")
