"""The commands `python -m benchmarks ...`: comparison with other tools, and the paper's experiments."""

from __future__ import annotations

import inspect
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, get_type_hints

import typer

from rlacd.cli.exit_codes import exit_codes
from rlacd.cli.parameters import REQUIRED, Parameters, command
from rlacd.errors import MeshFileError, OptionError, OutputError

if TYPE_CHECKING:
    from benchmarks import Bench
    from benchmarks.page import Page

HELP = """Compare rlacd with other tools: number of hulls, how tight they are, and time.

Every mesh and method runs in a process of its own, with limits; results are kept in a folder and never computed twice,
so a run can be stopped and started again. Pages are written as Markdown and HTML, all numbers as CSV.

\b
[bold]Methods[/bold]
  coacd                          CoACD (its number: concavity threshold)
  vhacdx, vhacdx:hulls           V-HACD 4 (volume error in percent; most hulls)
  greedy, navacd, FILE.onnx, ...  policies of rlacd (concavity threshold); :balanced or :best searches,
                                 :space asks for navigable space (tolerance)
  planes[:ap=N][:ce=N][:no-spatial][:no-principal][:excess|:random|:FILE.onnx]
                                 the paper's deployment, its kinds and numbers of planes left free
"""

app = typer.Typer(help=HELP, no_args_is_help=True, rich_markup_mode="rich")

Meshes = Annotated[Path, typer.Argument(help="A folder of meshes, of any depth.", show_default=False)]
Out = Annotated[Path, typer.Option("--out", "-o", help="A folder for results, pages and pictures.")]
Methods = Annotated[str | None, typer.Option(help="Separated by commas.", show_default=False)]
Threshold = Annotated[float, typer.Option("--threshold", "-t", help="Concavity threshold.")]
Ranking = Annotated[str, typer.Option(help="What ranks the planes along the axes: excess, random or FILE.onnx.")]
MeanError = Annotated[list[float] | None, typer.Option(help="Mean D_h to tune to; may be repeated.")]
Close = Annotated[float, typer.Option(min=0.001, help="How far from it the mean may be, relative to it.")]

Runs: Parameters = {
    "listed": (
        None,
        Annotated[
            Path | None,
            typer.Option("--list", help="A file with one mesh a line, relative to the folder; default: all."),
        ],
    ),
    "first": (
        None,
        Annotated[
            int | None, typer.Option(min=1, help="Only the first meshes, up to this number.", show_default=False)
        ],
    ),
    "limit": (
        600.0,
        Annotated[float, typer.Option("--limit", min=0.1, help="Seconds a method may take for one mesh.")],
    ),
    "memory": (12.0, Annotated[float, typer.Option(min=0.0, help="GB a process may use (Linux); 0: no limit.")]),
    "threads": (1, Annotated[int, typer.Option(min=1, help="Threads per process.")]),
    "jobs": (1, Annotated[int, typer.Option(min=1, help="Processes at a time.")]),
}
"""Options of every command that runs methods on meshes: name to default and annotation."""


def _require_simulator() -> None:
    from benchmarks.simulate import get_mujoco

    get_mujoco()


def experiment(
    name: str, first: Callable[[], None] = lambda: None
) -> Callable[[Callable[..., Page]], Callable[..., Page]]:
    """Make a command of a function that takes a `Bench` and its own options, and returns a page.

    What may be missing is asked for `first`, before a file is read or written.
    """

    def register(make_page: Callable[..., Page]) -> Callable[..., Page]:
        hints = get_type_hints(make_page, {**globals(), "Bench": Any, "Page": Any}, include_extras=True)
        own = {key: (p.default, hints[key]) for key, p in list(inspect.signature(make_page).parameters.items())[1:]}
        parameters: Parameters = {"meshes": (REQUIRED, Meshes), "out": (REQUIRED, Out), **own, **Runs}

        def run(**given: Any) -> None:
            chosen = {key: given.pop(key) for key in own}
            with exit_codes():
                first()
                with _open(**given) as opened:
                    _save(opened, make_page(opened, **chosen), name)

        app.command(name)(command(run, inspect.getdoc(make_page) or "", parameters))
        return make_page

    return register


@experiment("compare")
def compare(
    bench: Bench,
    methods: Methods = None,
    threshold: Threshold = 0.05,
    pictures: Annotated[int, typer.Option(min=0, help="Number of meshes to draw with every method.")] = 8,
    up: Annotated[str, typer.Option(help="The axis that points up in the pictures: x, y or z.")] = "z",
) -> Page:
    """Compare methods at their own numbers; those with a concavity threshold all at the same.

    \b
    [bold]Example[/bold]
      python -m benchmarks compare meshes/ --out run/ --jobs 2
    """
    from benchmarks.compare import DEFAULT_METHODS, at_settings, compare_page

    if up not in ("x", "y", "z"):
        raise OptionError(f"--up is {up!r}; it has to be x, y or z.")
    entries = at_settings(bench, _names(methods, DEFAULT_METHODS), threshold)
    return compare_page(bench, "Side by side", entries, pictures, up)


@experiment("physics", _require_simulator)
def physics(
    bench: Bench,
    ways: Annotated[
        str | None,
        typer.Option(
            help="Separated by commas: coacd, vhacdx:hulls, one-hull, balanced, fast, fast:full (exact hulls), "
            "fast:64, fast:32, fast:16 (most vertices), fast:primitives, fast:overlap (by 1 %); default: all.",
            show_default=False,
        ),
    ] = None,
    bullet: Annotated[bool, typer.Option("--bullet/--no-bullet", help="Also simulate in PyBullet.")] = True,
) -> Page:
    """Simulate the hulls: a pile, balls dropped into every hole, grasps and pegs; needs rlacd\\[sim].

    \b
    [bold]Example[/bold]
      python -m benchmarks physics meshes/ --out run/
    """
    from benchmarks.physics import WAYS, physics_page

    chosen = WAYS if ways is None else [word.strip() for word in ways.split(",") if word.strip()]
    return physics_page(bench, chosen, bullet, typer.echo)


@experiment("primitives", _require_simulator)
def primitives(
    bench: Bench,
    threshold: Threshold = 0.05,
    piles: Annotated[int, typer.Option(min=1, help="Piles of each object, turned differently.")] = 1,
) -> Page:
    """Hulls beside primitives: parts, bytes, distances, and steps a second in a pile; needs rlacd\\[sim].

    \b
    [bold]Example[/bold]
      python -m benchmarks primitives meshes/ --list meshes/quick.txt --out run/
    """
    from benchmarks.primitives import primitives_page

    return primitives_page(bench, piles, threshold, typer.echo)


@experiment("paper-table-1")
def table_1(bench: Bench, methods: Methods = None, at: MeanError = None, close: Close = 0.02) -> Page:
    """Tune every method to the same mean D_h, then compare (4.4.1)."""
    return _equal_accuracy(bench, "Equal accuracy (Table 1)", methods, at, close)


GREEDY_METHODS = "greedy-hull-sum,greedy-hull-sum+edges,random-10+edges,random-1+edges,navacd,greedy"


@experiment("paper-greedy")
def greedy(bench: Bench, methods: Methods = GREEDY_METHODS, at: MeanError = None, close: Close = 0.02) -> Page:
    """The same for greedy policies, one step ahead, and random shortlists; add the path of a network (4.4.3)."""
    return _equal_accuracy(bench, "Greedy against the policy (4.4.3)", methods, at, close)


@experiment("paper-table-4")
def table_4(bench: Bench, methods: Methods = None, at: MeanError = None, close: Close = 0.02) -> Page:
    """Table 1 on a folder of meshes the policy has seen nothing like: ShapeNetCore, HumanBody, COSEG, or any other."""
    return _equal_accuracy(bench, "Other meshes (Table 4)", methods, at, close)


def _equal_accuracy(bench: Bench, title: str, methods: str | None, at: list[float] | None, close: float) -> Page:
    from benchmarks.experiments import TABLE_1_METHODS, TARGETS, equal_accuracy

    return equal_accuracy(bench, _names(methods, TABLE_1_METHODS), at or TARGETS, title, close)


@experiment("paper-vhacd")
def vhacd(
    bench: Bench,
    reference: Annotated[str, typer.Option(help="The method whose number of hulls V-HACD is given.")] = "greedy",
    threshold: Threshold = 0.05,
) -> Page:
    """Give V-HACD as many hulls as rlacd made of each mesh, and compare how tight they are (4.4.2)."""
    from benchmarks.experiments import vhacd_at_equal_parts

    return vhacd_at_equal_parts(bench, reference, threshold)


@experiment("paper-table-2")
def table_2(bench: Bench, ranking: Ranking = "excess", threshold: Threshold = 0.05) -> Page:
    """Leave out spatial planes, PCA planes, planes of concave edges (Table 2)."""
    from benchmarks.experiments import kinds_of_planes

    return kinds_of_planes(bench, ranking, threshold)


@experiment("paper-table-3")
def table_3(
    bench: Bench,
    planes: Annotated[str, typer.Option(help="#AP: ranked planes that go on.")] = "1,5,10,20,50,150",
    edges: Annotated[str, typer.Option(help="#CE: concave edges asked.")] = "0,4,16,64",
    ranking: Ranking = "excess",
    threshold: Threshold = 0.05,
) -> Page:
    """Vary the numbers of planes and of concave edges (Table 3)."""
    from benchmarks.experiments import numbers_of_planes

    return numbers_of_planes(bench, ranking, threshold, _counts(planes), _counts(edges))


def _trained(name: str, about: str) -> None:
    @app.command(name, help=about)
    def run(
        meshes: Meshes,
        out: Out,
        preset: Annotated[str, typer.Option(help="Of `rlacd train`.")] = "quick",
        iterations: Annotated[int | None, typer.Option(help="Cuts an arm.", show_default=False)] = None,
        seeds: Annotated[int, typer.Option(min=1, help="Training runs of each arm.")] = 1,
    ) -> None:
        with exit_codes():
            from benchmarks.arms import train_arms

            _need_folder(meshes)
            _make_folder(out)
            _write(train_arms(name, meshes, out, preset, iterations, seeds, typer.echo), out, name)


_trained("paper-rewards", "Train with other weights of the two rewards, and without each (4.5.3).")
_trained("paper-encoding", "Train with a network that does not see the hull (4.5.2).")
_trained("paper-curves", "Train with other discounts, and draw the curves (Fig. 7).")


@app.command("paper-discounts")
def discounts(
    meshes: Meshes,
    out: Out,
    count: Annotated[int, typer.Option(min=1, help="Small meshes whose cut trees are grown.")] = 12,
    depth: Annotated[int, typer.Option(min=1, help="Cuts deep.")] = 4,
    steps: Annotated[int, typer.Option(min=1, help="Steps of Q-learning.")] = 300_000,
) -> None:
    """Find by tabular Q-learning on real cut trees which discounts converge (appendix A)."""
    with exit_codes():
        from benchmarks import find_meshes
        from benchmarks.discounts import discounts_page

        _need_folder(meshes)
        _make_folder(out)
        _write(discounts_page(meshes, find_meshes(meshes), count, depth, steps), out, "paper-discounts")


@contextmanager
def _open(
    meshes: Path,
    out: Path,
    listed: Path | None,
    first: int | None,
    limit: float,
    memory: float,
    threads: int,
    jobs: int,
) -> Iterator[Bench]:
    from benchmarks import Bench, BenchLimits, BenchStore, find_meshes

    _need_folder(meshes)
    if listed is not None and not listed.is_file():
        raise MeshFileError(f"the list {listed} does not exist; give a file with one mesh a line.")
    names = find_meshes(meshes, listed)[:first]
    missing = [name for name in names if not (meshes / name).is_file()]
    if missing:
        raise MeshFileError(f"{len(missing)} of the meshes listed, such as {missing[0]}, are not in {meshes}.")
    if not names:
        raise MeshFileError(f"there are no meshes in {meshes}.")
    store = BenchStore(out)
    try:
        yield Bench(meshes, names, store, BenchLimits(limit, int(memory * 2**30), threads, jobs), typer.echo)
    finally:
        store.close()


def _need_folder(meshes: Path) -> None:
    if not meshes.is_dir():
        raise MeshFileError(f"{meshes} is not a folder; give the folder that holds the meshes.")


def _make_folder(folder: Path) -> None:
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise OutputError(f"cannot make the folder {folder} ({error.strerror}); choose another one.") from error


def _save(bench: Bench, page: Page, name: str) -> None:
    from benchmarks.compare import save_csv

    _write(page, bench.store.folder, name)
    save_csv(bench, bench.store.folder)


def _write(page: Page, folder: Path, name: str) -> None:
    for path in page.save(folder, name):
        if path.suffix in (".md", ".html"):
            typer.echo(f"wrote {path}")


def _names(given: str | None, usual: tuple[str, ...]) -> list[str]:
    from benchmarks import make_method

    names = list(usual) if given is None else [word.strip() for word in given.split(",") if word.strip()]
    if not names:
        raise OptionError("--methods is empty; name at least one.")
    for name in names:
        make_method(name)  # unknown or missing methods are reported before any work
    return list(dict.fromkeys(names))


def _counts(text: str) -> list[int]:
    words = [word.strip() for word in text.split(",") if word.strip()]
    if not all(word.isdecimal() for word in words):
        raise OptionError(f"{text!r} should be whole numbers with commas between.")
    return [int(word) for word in words]


if __name__ == "__main__":
    app(prog_name="python -m benchmarks")
