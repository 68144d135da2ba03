"""The command `rlacd view`: a page in the browser, served on this machine only."""

from __future__ import annotations

import contextlib
import webbrowser
from pathlib import Path
from typing import Annotated

import typer

from rlacd.cli.decompose import ROBOTS
from rlacd.cli.exit_codes import exit_codes, leave
from rlacd.errors import OptionError


def view(
    mesh: Annotated[Path, typer.Argument(metavar="IN", help="The mesh, as for decompose; not a robot.")],
    threshold: Annotated[
        float | None, typer.Option("--threshold", "-t", help="As for decompose; the page changes it.")
    ] = None,
    criterion: Annotated[
        str | None,
        typer.Option(help="concavity, distance, volume or navigable, as for decompose; the page changes it."),
    ] = None,
    quality: Annotated[
        str | None, typer.Option(help="fast, balanced or best, as for decompose; the page changes it.")
    ] = None,
    max_hulls: Annotated[int | None, typer.Option(help="As for decompose; the page changes it.")] = None,
    open_bodies: Annotated[
        str | None, typer.Option("--open", help="auto, solid or thin, as for decompose; the page changes it.")
    ] = None,
    up: Annotated[
        str | None,
        typer.Option(
            metavar="AXIS",
            help="The axis of the mesh that points up. [dim]\\[default: what the file says, else a guess][/dim]",
            show_default=False,
        ),
    ] = None,
    port: Annotated[
        int | None,
        typer.Option(
            help="Where the page is served. [dim]\\[default: 8765, or any free one][/dim]", show_default=False
        ),
    ] = None,
    threads: Annotated[int | None, typer.Option(help="Threads to use, all cores by default.")] = None,
    browser: Annotated[bool, typer.Option("--browser/--no-browser", help="Open the page in the browser.")] = True,
) -> None:
    """Show a mesh and its hulls in the browser, and try thresholds and criteria.

    \b
    [bold]Examples[/bold]
      rlacd view chair.glb
      rlacd view chair.glb --threshold 0.02 --port 9000
      rlacd view chair.glb --no-browser       # tells the address only, e.g. for  ssh -L 8765:localhost:8765

    The page turns, pulls apart and colours the hulls, decomposes anew while you move a slider, and downloads any
    format. Nothing leaves this machine. Ctrl-C ends it.
    """
    with exit_codes():
        if mesh.suffix.lower() in ROBOTS:
            raise OptionError(f"{mesh} is a robot; view shows a single mesh: give one of the meshes that it refers to.")
        from rlacd.viewer.viewer import open_viewer

        chosen = {
            "threshold": threshold,
            "criterion": criterion,
            "quality": quality,
            "max_hulls": max_hulls,
            "open": open_bodies,
        }
        given = {name: value for name, value in chosen.items() if value is not None}
        viewer = open_viewer(mesh, given, up=up, port=port, threads=threads)
        with viewer as server, contextlib.suppress(KeyboardInterrupt):  # which may come before the wait begins
            typer.echo(f"{mesh.name} is shown at {server.address} (Ctrl-C ends)", err=True)
            if browser:
                webbrowser.open(server.address)
            server.wait()
        if server.at_work:
            leave(0)  # Python would wait for every thread, and a running kernel cannot be interrupted
