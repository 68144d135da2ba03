"""CoACD's interface (coacd 1.0.14), decomposed by rlacd.

``import coacd`` becomes ``from rlacd.compat import coacd``; the rest of a program stays as it is. The command
``coacd -i in.obj -o out.obj`` becomes ``python -m rlacd.compat.coacd -i in.obj -o out.obj``.
"""

from __future__ import annotations

import argparse
import inspect
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
import trimesh

from rlacd.compat import warn_unused
from rlacd.decompose_mesh import decompose
from rlacd.errors import RlacdError
from rlacd.io.read.load import load_mesh
from rlacd.io.write.target import checked_place
from rlacd.options.fields import flag, integer, number, one_of, read
from rlacd.options.ranges import LENGTHS

__all__ = ["Mesh", "run_coacd", "set_log_level"]

UNUSED = {
    "preprocess_mode": "it repairs bodies that are not closed, and no others",
    "preprocess_resolution": "it does not remesh the input",
    "resolution": "it bounds distances instead of sampling them",
    **dict.fromkeys(("mcts_nodes", "mcts_iterations", "mcts_max_depth"), "it searches by other means: quality='best'"),
    "pca": "it tries planes along the principal axes anyway",
}


class Mesh:
    """Vertices ``[V, 3]`` and triangles ``[F, 3]``, as CoACD takes them."""

    def __init__(self, vertices: npt.ArrayLike = (), indices: npt.ArrayLike = ()) -> None:
        self.vertices = np.ascontiguousarray(vertices, dtype=np.double).reshape(-1, 3)
        self.indices = np.ascontiguousarray(indices, dtype=np.int32).reshape(-1, 3)


def run_coacd(
    mesh: Any,
    threshold: float = 0.05,
    max_convex_hull: int = -1,
    preprocess_mode: str = "auto",
    preprocess_resolution: int = 50,
    resolution: int = 2000,
    mcts_nodes: int = 20,
    mcts_iterations: int = 150,
    mcts_max_depth: int = 3,
    pca: bool = False,
    merge: bool = True,
    decimate: bool = False,
    max_ch_vertex: int = 256,
    extrude: bool = False,
    extrude_margin: float = 0.01,
    apx_mode: str = "ch",
    seed: int = 0,
    real_metric: bool = False,
) -> list[list[npt.NDArray[Any]]]:
    """Decompose a mesh as ``coacd.run_coacd`` does: same arguments, same defaults, same kind of result.

    Parameters
    ----------
    mesh : Mesh
        Or any object with ``vertices`` and ``indices``, such as coacd's own, or ``faces``, as trimesh's.
    threshold : float
        Concavity, in CoACD's measure and frame, or in the mesh's unit with `real_metric`.
    max_convex_hull : int
        Maximum number of hulls; -1 for no limit.
    merge : bool
        Merge parts that fit into one hull.
    decimate, max_ch_vertex
        With `decimate`, no hull has more than `max_ch_vertex` vertices.
    apx_mode : {"ch", "box"}
        Convex hulls, or the axis-parallel boxes around them.
    seed : int
        The same seed gives the same bytes.
    extrude, extrude_margin
        With `extrude`, hulls that touch overlap by twice `extrude_margin` (the longest side is 2), as far as the
        threshold allows: CoACD grows both by the margin, here one takes in a layer of the other.
    real_metric : bool
        Whether `threshold` is in the mesh's unit.
    preprocess_mode, preprocess_resolution, resolution, mcts_nodes, mcts_iterations, mcts_max_depth, pca
        Accepted but unused; a warning explains this once.

    Returns
    -------
    list of [vertices, indices]
        float64 ``[V, 3]`` and int32 ``[F, 3]`` of each hull.

    Raises
    ------
    MeshError
        There is nothing to decompose.
    OptionError
        An option is out of range.
    """
    warn_unused(run_coacd, locals(), UNUSED)
    apx_mode = read(one_of(("ch", "box")), "apx_mode", apx_mode)
    threshold = read(number(above=0), "threshold", threshold)
    decimate, real_metric = read(flag(), "decimate", decimate), read(flag(), "real_metric", real_metric)
    extrude, margin = read(flag(), "extrude", extrude), read(number(0.0), "extrude_margin", extrude_margin)
    result = decompose(
        (mesh.vertices, mesh.indices if hasattr(mesh, "indices") else mesh.faces),
        criterion="concavity",
        threshold=None if real_metric else max(threshold, LENGTHS["threshold"][0]),
        threshold_abs=threshold if real_metric else None,
        max_hulls=most_hulls
        if (most_hulls := read(integer(-(2**31)), "max_convex_hull", max_convex_hull)) > 0
        else None,
        max_vertices=read(integer(4), "max_ch_vertex", max_ch_vertex) if decimate else None,
        overlap=min(2 * margin, LENGTHS["overlap"][1]) if extrude else 0.0,
        merge=merge,
        seed=seed,
    )
    hulls = [hull.bounding_box for hull in result] if apx_mode == "box" else list(result)
    return [[np.array(hull.vertices, dtype=np.float64), np.array(hull.faces, dtype=np.int32)] for hull in hulls]


def set_log_level(level: str) -> None:
    """Accept CoACD's log levels; rlacd logs nothing."""


ENDINGS = (".obj", ".glb", ".ply", ".stl", ".off")

FLAGS: dict[str, str] = {
    **{"-t --threshold": "threshold", "-pm --preprocess-mode": "preprocess_mode", "-r --resolution": "resolution"},
    **{"-nm --no-merge": "merge", "-d --decimate": "decimate", "-dt --max-ch-vertex": "max_ch_vertex"},
    **{"-ex --extrude": "extrude", "-em --extrude-margin": "extrude_margin"},
    **{"-c --max-convex-hull": "max_convex_hull", "-mi --mcts-iteration": "mcts_iterations"},
    **{"-md --mcts-max-depth": "mcts_max_depth", "-mn --mcts-node": "mcts_nodes"},
    **{"-pr --prep-resolution": "preprocess_resolution", "--pca": "pca", "-am --apx-mode": "apx_mode"},
    "--seed": "seed",
}
"""Flags of CoACD's command, and the arguments of `run_coacd` that they are."""


def main(words: list[str] | None = None) -> None:
    """Run CoACD's command line: same flags, same files."""
    parser = argparse.ArgumentParser("python -m rlacd.compat.coacd", description="CoACD's command, done by rlacd.")
    parser.add_argument("-i", "--input", required=True, type=Path, help="any mesh file that rlacd reads")
    parser.add_argument("-o", "--output", required=True, type=Path, help=f"a file that ends in {', '.join(ENDINGS)}")
    parser.add_argument("--quiet", action="store_true", help="print nothing")
    parser.add_argument("--split", action="store_true", help="each hull in a file of its own too, in OUTPUT_parts")
    usual = inspect.signature(run_coacd).parameters
    for flags, name in FLAGS.items():
        default = usual[name].default
        if isinstance(default, bool):
            parser.add_argument(*flags.split(), dest=name, action="store_false" if default else "store_true")
        else:
            parser.add_argument(*flags.split(), dest=name, type=type(default), default=default)
    given = vars(parser.parse_args(words))
    source, output, split, quiet = (given.pop(name) for name in ("input", "output", "split", "quiet"))
    try:
        checked_place(output, "hulls", ENDINGS)
        mesh = load_mesh(source)
        hulls = [trimesh.Trimesh(v, f, process=False) for v, f in run_coacd(mesh, **given)]
    except RlacdError as error:
        parser.error(str(error))
    output.parent.mkdir(parents=True, exist_ok=True)
    trimesh.Scene(hulls).export(output)
    if split:
        folder = output.with_name(f"{output.stem}_parts")
        folder.mkdir(exist_ok=True)
        for number, hull in enumerate(hulls):
            hull.export(folder / f"{output.stem}_{number:03d}{output.suffix}")
    if not quiet:
        print(f"{output}: {len(hulls)} hulls")


if __name__ == "__main__":
    main()
