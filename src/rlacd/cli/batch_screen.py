"""The output of `rlacd batch`: a bar with rate and time left, a line for each mesh that failed, a summary."""

from __future__ import annotations

import time
from collections import Counter
from collections.abc import Container
from pathlib import PurePosixPath
from typing import TYPE_CHECKING, Any

from rlacd.cli.exit_codes import say
from rlacd.cli.terminal import counted, open_bar
from rlacd.plain_json import printable

if TYPE_CHECKING:
    from rlacd.batch import Asset, Summary
    from rlacd.batch.manifest import Row

LISTED = 10
"""Most meshes that a message lists by name."""


class Screen:
    """Shows the progress of a batch; if quiet, only its failures.

    Parameters
    ----------
    quiet : bool
    """

    def __init__(self, *, quiet: bool) -> None:
        self._quiet = quiet
        columns = (None, "{task.completed:.0f}/{task.total}", "{task.fields[state]}", "{task.fields[running]}")
        self._bar = None if quiet else open_bar(*columns, state="", running="")
        self._start = self._reported = time.monotonic()
        self._total = self._passed_over = self._made = 0
        self._status: Counter[str] = Counter()
        self._running: dict[str, None] = {}  # in the order of their turns
        self.told: set[str] = set()
        """Meshes of which it has been said what is wrong."""

    def close(self) -> None:
        """Remove the bar."""
        if self._bar is not None:
            self._bar.stop()

    def begin(self, meshes: int) -> None:
        """See `rlacd.batch.Watcher`."""
        self._total = meshes
        self._update(total=meshes)

    def passed_over(self, asset: Asset) -> None:
        """See `rlacd.batch.Watcher`."""
        self._passed_over += 1
        self._update(advance=1)

    def started(self, asset: Asset) -> None:
        """See `rlacd.batch.Watcher`."""
        self._running[asset.name] = None
        self._update(running=self._names())

    def finished(self, row: Row, timing: Row) -> None:
        """See `rlacd.batch.Watcher`."""
        self._made += 1
        self._status[row["status"]] += 1
        self._running.pop(row["mesh"], None)
        self._update(advance=1, state=self._state(), running=self._names())
        if row["status"] not in ("done", "warned"):
            line = failure_line(row)
            self.told.add(row["mesh"])
            say(line) if self._bar is None else self._bar.console.print(line, markup=False, highlight=False)
        elif self._bar is None and not self._quiet and time.monotonic() - self._reported > 30:
            self._reported = time.monotonic()
            say(f"{self._made + self._passed_over}/{self._total}  {self._state()}")

    def _update(self, **news: Any) -> None:
        if self._bar is not None:
            self._bar.update(self._bar.task_ids[0], **news)

    def _names(self) -> str:
        """Two of the meshes at work, the latest first; the front of a long name is cut off."""
        names = [printable(name) for name in reversed(self._running)]
        short = [name if len(name) <= 24 else f"…{name[-23:]}" for name in names[:2]]
        more = [f"{len(names) - 2} more"] if len(names) > 2 else []
        return ", ".join(short + more)

    def _state(self) -> str:
        rate = self._made / max(time.monotonic() - self._start, 1e-9)
        left = (self._total - self._made - self._passed_over) / rate
        words = [f"{60 * rate:.0f}/min", f"{duration(left)} left"]
        words += [
            f"{self._status[status]} {status}" for status in ("uncovered", "failed", "fallback") if self._status[status]
        ]
        return ", ".join(words)


def failure_line(row: Row) -> str:
    """Describe what is wrong with a mesh in one line."""
    if row["status"] == "uncovered":
        return printable(f"  {row['mesh']}: hulls miss its surface by up to {row['missed']}")
    instead = " (given its convex hull)" if row["status"] == "fallback" else ""
    error = row["error"].removeprefix(f"{PurePosixPath(row['mesh']).name} ")
    return printable(f"  {row['mesh']}: {error}{instead}")


def summary_lines(summary: Summary, out: str, told: Container[str] = ()) -> list[str]:
    """Summarise a run: what was done, what failed, and what took longest; meshes already `told` are only counted."""
    made = sum(summary.status.values()) - summary.passed_over
    meshes = counted(summary.meshes, "mesh", "meshes")
    warned = summary.status["warned"]
    words = [f"{summary.status['done'] + warned} of {meshes} {'is' if summary.meshes == 1 else 'are'} done"]
    words += [f"{warned} of them with warnings"] if warned else []
    words += [
        f"{summary.status[status]} {status}" for status in ("uncovered", "fallback", "failed") if summary.status[status]
    ]
    rate = f", {60 * made / summary.seconds:.0f} a minute" if made and summary.seconds > 0 else ""
    wrong = [row for row in (*summary.uncovered, *summary.failures) if row["mesh"] not in told]
    now = f"  {made} now in {duration(summary.seconds)}{rate}; {summary.passed_over} were done before"
    lines = [f"{out}: {', '.join(words)}", now, *map(failure_line, wrong[:LISTED])]
    if len(wrong) > LISTED:
        lines.append(f"  ... and {len(wrong) - LISTED} more: see manifest.jsonl")
    lines += [printable(f"  {count} x warning: {kind}") for kind, count in summary.warnings.most_common(LISTED)]
    if summary.others:
        kinds = ", ".join(f"{count} {ending}" for ending, count in summary.others.most_common())
        files = counted(summary.others.total(), "file", "files")
        lines.append(printable(f"  passed over, since not meshes: {files} ({kinds})"))
    if summary.slowest:
        lines.append(printable("  slowest: " + ", ".join(f"{name} {spent:.1f} s" for name, spent in summary.slowest)))
    if summary.stopped:
        lines.append("  stopped early; run the same command again to go on")
    return lines


def duration(seconds: float) -> str:
    """Format a time in a suitable unit."""
    if seconds < 60:
        return f"{seconds:.0f} s" if seconds >= 10 else f"{seconds:.1f} s"
    minutes, hours = seconds / 60, seconds / 3600
    return f"{minutes:.0f} min" if hours < 2 else f"{hours:.1f} h"
