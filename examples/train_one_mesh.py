"""Train a policy on one mesh: parts fall from those of random planes to greedy's, in a minute on two cores.

    python examples/train_one_mesh.py [MESH] [RUN]        # needs pip install 'rlacd[train]'

The page *Train a policy in ten minutes* explains what is printed; change the options below and run it again. `# %%`
begins a cell in editors that know them.
"""

# %% A folder with one mesh. By default, a chair.
from __future__ import annotations

import json
import shutil
import sys
from pathlib import Path

import trimesh
from manifold3d import Manifold

import rlacd
from rlacd.learn.options import TrainOptions
from rlacd.learn.train import train


def chair() -> trimesh.Trimesh:
    """Return a chair of boxes: four legs, a seat, a back that leans, and one arm rest."""
    legs = [Manifold.cube((0.1, 0.1, 0.9)).translate((x, y, 0)) for x in (0.0, 0.9) for y in (0.0, 0.8)]
    seat = Manifold.cube((1.0, 0.9, 0.12)).translate((0, 0, 0.8))
    back = Manifold.cube((1.0, 0.1, 0.9)).rotate((-12, 0, 0)).translate((0, 0.8, 0.85))
    rest = Manifold.cube((0.1, 0.8, 0.1)).translate((0, 0.1, 1.2)) + Manifold.cube((0.1, 0.1, 0.45)).translate(
        (0, 0.1, 0.8)
    )
    mesh = sum(legs, start=seat + back + rest).to_mesh64()
    return trimesh.Trimesh(mesh.vert_properties[:, :3], mesh.tri_verts, process=False)


def main(mesh: Path | None, run: Path, **changes: object) -> list[dict[str, float]]:
    """Train, print the curve, and decompose with the network; return the points of the curve."""
    folder = run / "meshes"
    folder.mkdir(parents=True, exist_ok=True)
    if mesh is None:
        chair().export(folder / "chair.ply")
    else:
        shutil.copy(mesh, folder)

    # %% The run. All options: rlacd train --help
    options = TrainOptions.preset("one-mesh", **{"seed": 0, **changes})
    policy = train(folder, run, options, say=lambda line: print(line) if "validation" not in line else None)

    # %% The curve: parts by the network's own planes, over greedy's. The bar of random planes is the longest at first.
    lines = [json.loads(line) for line in (run / "curves.jsonl").read_text(encoding="utf-8").splitlines()]
    points = [point for point in lines if "validation_own_plane" in point]
    print(f"\n   cuts  parts/greedy  (random: {points[0]['validation_random']:.2f})")
    for point in points:
        own = point["validation_own_plane"]
        print(f"{point['env_steps']:7d}  {own:12.2f}  {'#' * min(round(20 * own), 100)}")

    # %% The network as a policy. `own` is what it learned; decompose adds planes of reflex edges, and merges.
    [file] = folder.iterdir()
    found = rlacd.decompose(file, policy=str(policy), threshold=options.threshold, quality="fast")
    print(f"\n{len(found)} hulls by the network's ten best planes and merging; the policy is {policy}")
    return points


if __name__ == "__main__":
    given = [Path(word) for word in sys.argv[1:]]
    main(given[0] if given else None, given[1] if len(given) > 1 else Path("one_mesh_run"))
