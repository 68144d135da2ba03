"""The command `rlacd view`: a page in the browser, served on this machine only."""

from __future__ import annotations

import webbrowser
from contextlib import suppress
from pathlib import Path
from typing import Any

from rlacd.cli.commands import Argument, Command, Option, chosen, options_of
from rlacd.cli.exit_codes import leave, say
from rlacd.cli.lean import ctrl_c_at_once
from rlacd.cli.pipes import refuse_stdin
from rlacd.options import Options
from rlacd.options.output import OutputOptions

CONTROLS = ("threshold", "criterion", "quality", "max_hulls", "openings")
"""Options of `rlacd decompose` that the page can change."""


def _view(mesh: Path, browser: bool, **given: Any) -> None:
    """Show a mesh and its hulls in the browser.

    \b
    Examples:
      rlacd view chair.glb
      rlacd view chair.glb --threshold 0.02 --port 9000
      rlacd view chair.glb --no-browser       # prints the address only, for ssh -L 8765:localhost:8765
      rlacd view robot.urdf                   # its links, with a slider for each joint

    On the page, rotate the hulls, pull them apart, colour them by error, change thresholds and criteria, and download
    any format. Nothing leaves this machine. Ctrl-C ends it.
    """
    refuse_stdin(mesh)
    packages = given.pop("package_dirs") or ()
    with ctrl_c_at_once():
        from rlacd.view_file import view

    asked = chosen({name: given.pop(name) for name in CONTROLS})
    with view(mesh, package_dirs=packages, **given, **asked) as server, suppress(KeyboardInterrupt):
        say(f"{mesh.name} is shown at {server.address} (Ctrl-C ends)")
        if browser:
            webbrowser.open(server.address)
        server.wait()
    if server.at_work:
        leave(0)  # Python would wait for every thread, and a running kernel cannot be interrupted


COMMAND = Command(
    "view",
    _view,
    [
        Argument("mesh", "IN", "The mesh or robot, as for decompose."),
        *options_of(Options, only=(*CONTROLS, "threads")),
        *options_of(OutputOptions, only=("up", "package_dirs")),
        Option("--port", type=int, help="Where the page is served.  [default: 8765, or any free one]"),
        Option("--browser/--no-browser", default=True, help="Open the page in the browser."),
    ],
)
