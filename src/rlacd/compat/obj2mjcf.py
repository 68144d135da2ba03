"""The command of obj2mjcf 0.0.25, done by rlacd.

``obj2mjcf --obj-dir meshes --decompose --save-mjcf`` becomes ``python -m rlacd.compat.obj2mjcf --obj-dir meshes
--decompose --save-mjcf``.
"""

from __future__ import annotations

import argparse
import inspect
import re
import sys
from collections.abc import Iterator
from pathlib import Path

from rlacd.compat import warn_unused
from rlacd.compat.coacd import UNUSED, run_coacd
from rlacd.decompose_mesh import decompose as decompose_mesh
from rlacd.decomposition import Decomposition
from rlacd.errors import OptionError, OutputError, RlacdError
from rlacd.options import LENGTHS
from rlacd.options.keywords import suggesting

__all__ = ["obj2mjcf"]

_UNUSED = {
    **{name: reason for name, reason in UNUSED.items() if name != "preprocess_mode"},
    "texture_resize_percent": "it copies textures as they are",
}
_OF_DECOMPOSE = dict.fromkeys(("threshold", "max_convex_hull", "seed"), "without decompose, there is one hull")


@suggesting()
def obj2mjcf(
    obj_dir: str,
    obj_filter: str | None = None,
    save_mjcf: bool = False,
    compile_model: bool = False,
    verbose: bool = False,
    decompose: bool = False,
    texture_resize_percent: float = 1.0,
    overwrite: bool = False,
    add_free_joint: bool = False,
    preprocess_resolution: int = 50,
    threshold: float = 0.05,
    max_convex_hull: int = -1,
    mcts_iterations: int = 100,
    mcts_max_depth: int = 3,
    mcts_nodes: int = 20,
    resolution: int = 2000,
    pca: bool = False,
    seed: int = 0,
) -> None:
    """Write the hulls of each ``NAME.obj`` in a folder into ``NAME/`` beside it, as the command obj2mjcf does.

    Parameters
    ----------
    obj_dir : str
        The folder.
    obj_filter : str, optional
        A regular expression that file names have to contain.
    save_mjcf : bool
        Write the model ``NAME/NAME.xml`` and its meshes, instead of hulls only.
    compile_model : bool
        Load the model into MuJoCo and make a step; this writes it too.
    verbose : bool
        Print how well hulls fit, not only how many there are.
    decompose : bool
        Decompose; otherwise, there is one hull.
    overwrite : bool
        Replace what an earlier run has written; other files stay.
    add_free_joint : bool
        Let the body move.
    threshold, max_convex_hull, seed
        As for `rlacd.compat.coacd.run_coacd`.
    texture_resize_percent, preprocess_resolution, mcts_iterations, mcts_max_depth, mcts_nodes, resolution, pca
        Accepted but unused; a warning explains this once.

    Raises
    ------
    MeshError
        A file has nothing to decompose.
    OptionError
        No file matches, or an option is out of range.
    OutputError
        A folder ``NAME`` exists and `overwrite` is not given, or MuJoCo refuses the model.
    """
    warn_unused(obj2mjcf, locals(), _UNUSED if decompose else _UNUSED | _OF_DECOMPOSE)
    most = max_convex_hull if decompose else 1
    files = _files(Path(obj_dir), obj_filter)
    if not overwrite and (taken := [file.stem for file in files if file.with_suffix("").exists()]):
        raise OutputError(f"{taken[0]} in {obj_dir} exists, maybe from an earlier run; --overwrite replaces it.")
    for file in files:
        result = decompose_mesh(
            file,
            criterion="concavity",
            threshold=max(threshold, LENGTHS["threshold"][0]),
            max_hulls=None if most < 1 else most,
            seed=seed,
        )
        folder = file.with_suffix("")
        if save_mjcf or compile_model:
            _save_model(result, folder / f"{file.stem}.xml", moves=add_free_joint, tried=compile_model)
        else:
            result.save(f"{folder}/")
        print(f"{file}: {', '.join(result.facts()[: None if verbose else 1])}")


def _files(folder: Path, pattern: str | None) -> list[Path]:
    try:
        files = [file for file in sorted(folder.glob("*.obj")) if re.search(pattern or "", file.name)]
    except re.error as error:
        raise OptionError(f"--obj-filter {pattern} is not a regular expression: {error}.") from error
    if not files:
        raise OptionError(f"no file *.obj in {folder} matches {pattern}." if pattern else f"no file *.obj in {folder}.")
    return files


def _save_model(result: Decomposition, path: Path, *, moves: bool, tried: bool) -> None:
    result.save(path)
    if not moves:
        path.write_bytes(re.sub(rb"\s*<freejoint[^>]*>", b"", path.read_bytes()))
    if tried:
        try:
            import mujoco

            model = mujoco.MjModel.from_xml_path(str(path))
            mujoco.mj_step(model, mujoco.MjData(model))
        except (ImportError, ValueError) as error:
            raise OutputError(f"{path} is written, but MuJoCo does not compile it: {error}.") from error


def _flags() -> Iterator[tuple[str, str, inspect.Parameter]]:
    """The flags of obj2mjcf's command: how each begins, its name, and the argument of `obj2mjcf` that it is."""
    of_coacd = inspect.signature(run_coacd).parameters
    for name, parameter in inspect.signature(obj2mjcf).parameters.items():
        yield "--coacd-args." if name in of_coacd else "--", name.replace("_", "-"), parameter


def main(words: list[str] | None = None) -> None:
    """Run obj2mjcf's command line."""
    about = "obj2mjcf's command, done by rlacd."
    usage = "%(prog)s --obj-dir FOLDER [--decompose] [--save-mjcf] [options]"
    parser = argparse.ArgumentParser("python -m rlacd.compat.obj2mjcf", usage, about, allow_abbrev=False)
    for start, name, parameter in _flags():
        default, dest = parameter.default, parameter.name
        if isinstance(default, bool):
            parser.add_argument(start + name, dest=dest, action="store_true")
            parser.add_argument(f"{start}no-{name}", dest=dest, action="store_false")
        elif default is parameter.empty:
            parser.add_argument(start + name, dest=dest, required=True)
        else:
            parser.add_argument(
                start + name, dest=dest, type=str if default is None else type(default), default=default
            )
    words = [  # obj2mjcf takes --save_mjcf too
        word.replace("_", "-") if re.fullmatch(r"--[\w.-]+", word) else word
        for word in (sys.argv[1:] if words is None else words)
    ]
    try:
        obj2mjcf(**vars(parser.parse_args(words)))
    except RlacdError as error:
        parser.error(str(error))


if __name__ == "__main__":
    main()
