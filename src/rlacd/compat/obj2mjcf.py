"""The command of obj2mjcf 0.0.25, done by rlacd: ``obj2mjcf ...`` becomes ``python -m rlacd.compat.obj2mjcf ...``."""

from __future__ import annotations

import argparse
import inspect
import re
import sys
import warnings
from pathlib import Path
from typing import Any

from rlacd.compat import UnusedOptionWarning, warn_unused
from rlacd.compat.coacd import UNUSED, run_coacd
from rlacd.decompose_mesh import decompose
from rlacd.decomposition import Decomposition
from rlacd.errors import OptionError, OutputError, RlacdError
from rlacd.options import LENGTHS

_SWITCHES = ("save_mjcf", "compile_model", "verbose", "decompose", "overwrite", "add_free_joint")
_OBEYED = ("threshold", "max_convex_hull", "seed")
_IGNORED = ("preprocess_resolution", "mcts_iterations", "mcts_max_depth", "mcts_nodes", "resolution", "pca")
_USUAL = {name: parameter.default for name, parameter in inspect.signature(run_coacd).parameters.items()}


def main(words: list[str] | None = None) -> None:
    """Run obj2mjcf's command line: same flags; the hulls or model of ``NAME.obj`` in ``NAME/`` beside it."""
    usage = "%(prog)s --obj-dir FOLDER [--decompose] [--save-mjcf] [options]"
    parser = argparse.ArgumentParser("python -m rlacd.compat.obj2mjcf", usage, allow_abbrev=False)
    parser.add_argument("--obj-dir", required=True, type=Path)
    parser.add_argument("--obj-filter", default="", help="a regular expression for names of files")
    parser.add_argument("--texture-resize-percent", type=float, default=1.0)
    switches = [("--", name, False) for name in _SWITCHES]
    for start, name, default in switches + [("--coacd-args.", name, _USUAL[name]) for name in _OBEYED + _IGNORED]:
        flag = name.replace("_", "-")
        if default is False:
            parser.add_argument(start + flag, dest=name, action="store_true")
            parser.add_argument(f"{start}no-{flag}", dest=name, action="store_false")
        else:
            parser.add_argument(start + flag, dest=name, type=type(default), default=default)
    words = sys.argv[1:] if words is None else words  # --save_mjcf is a flag of obj2mjcf too
    words = [word.replace("_", "-") if re.fullmatch(r"--[\w.-]+", word) else word for word in words]
    try:
        _convert(parser.parse_args(words))
    except RlacdError as error:
        parser.error(str(error))


def _convert(given: Any) -> None:
    warn_unused(run_coacd, _USUAL | vars(given), UNUSED)
    if given.texture_resize_percent != 1.0:
        said = "obj2mjcf: rlacd ignores texture_resize_percent: it copies textures as they are."
        warnings.warn(said, UnusedOptionWarning, stacklevel=3)
    if not given.decompose and any(getattr(given, name) != _USUAL[name] for name in _OBEYED):
        warnings.warn("obj2mjcf: without decompose, coacd_args have no effect.", UnusedOptionWarning, stacklevel=3)
    files = _files(given.obj_dir, given.obj_filter)
    if not given.overwrite and (taken := [file.stem for file in files if file.with_suffix("").exists()]):
        raise OutputError(f"{taken[0]} in {given.obj_dir} exists, maybe from an earlier run; --overwrite replaces it.")
    threshold = max(given.threshold, LENGTHS["threshold"][0])
    most = None if given.max_convex_hull < 1 else given.max_convex_hull
    options = {"threshold": threshold, "max_hulls": most if given.decompose else 1, "seed": given.seed}
    for file in files:
        result = decompose(file, criterion="concavity", **options)
        folder = file.with_suffix("")
        if given.save_mjcf or given.compile_model:
            _save_model(result, folder / f"{file.stem}.xml", moves=given.add_free_joint, tried=given.compile_model)
        else:
            result.save(f"{folder}/")
        print(f"{file}: {', '.join(result.facts()[: None if given.verbose else 1])}")


def _files(folder: Path, pattern: str) -> list[Path]:
    try:
        files = [file for file in sorted(folder.glob("*.obj")) if re.search(pattern, file.name)]
    except re.error as error:
        raise OptionError(f"--obj-filter {pattern} is not a regular expression: {error}.") from error
    if not files:
        raise OptionError(f"no file *.obj in {folder}" + (f" matches {pattern}." if pattern else "."))
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


if __name__ == "__main__":
    main()
