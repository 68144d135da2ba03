"""Train on features of your own: here, the extents of a component's box, for the values of all 150 planes at once.

python examples/own_encoder.py MESHES RUN        # needs pip install 'rlacd[train]'
"""

import sys
from pathlib import Path

import numpy as np

import rlacd
from rlacd.learn.options import TrainOptions
from rlacd.learn.train import load_policy, train


class Boxes:
    """An encoder: D = `dim` features, `outputs` values (1: of each plane's own features [150, D]), and a name."""

    dim, outputs, digest = 3, 150, "boxes"

    def describe(self, component: rlacd.Component) -> np.ndarray:
        """Features [D]; the same component always has the same."""
        return np.ptp(component.box, axis=0).astype(np.float32)


if __name__ == "__main__":
    meshes, run = map(Path, sys.argv[1:])
    train(meshes, run, TrainOptions.preset("returns", env_steps=5000), encoder=Boxes())
    policy = load_policy(run, Boxes(), shortlist=10, reflex_edges=4)  # the paper's rule
    print(len(rlacd.decompose(next(meshes.rglob("*.ply")), policy=policy, quality="fast")), "hulls")
