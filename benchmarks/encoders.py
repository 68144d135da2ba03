"""How well the saving of each candidate plane can be told from an encoder's features, and what encoding costs.

    python benchmarks/encoders.py MESHES [--encoder-weights I2P_MAE_FILE]

The saving r_1 of all 150 planes is known from the sweep. The Q network's own architecture learns it from the features
of some components, and is asked about components of other meshes.
"""

from __future__ import annotations

import argparse
import time
from pathlib import Path

import numpy as np
import torch

from rlacd.criteria import Concavity
from rlacd.learn.encoders import I2P_MAE, describe, make_encoder
from rlacd.learn.episodes import Episodes
from rlacd.learn.meshes import Solids, list_meshes
from rlacd.learn.qnetwork import QNetwork
from rlacd.planes.sweep import sweep
from rlacd.policies.observe import Observation, observe

Labelled = tuple[list[Observation], np.ndarray]


def components(episodes: Episodes, count: int, rng: np.random.Generator) -> Labelled:
    """Components met when cutting at random, with the saving of all their planes."""
    seen, savings = [], []
    while len(seen) < count:
        _, cutting = episodes.draw(rng)
        for _ in range(6):
            if cutting.over:
                break
            component = cutting.frontier[0]
            candidates = cutting.candidates(component)
            scored = sweep(component, candidates)
            seen.append(observe(component, candidates, 0.04, 2048))
            savings.append(1 - (scored.hull_below + scored.hull_above) / component.hull.volume)
            cutting.cut(0, candidates.plane(int(rng.choice(np.flatnonzero(seen[-1].mask)))))
    return seen, np.array(savings, dtype=np.float32)


def learn(encoder_name: str, weights: str, known: Labelled, unknown: Labelled, epochs: int) -> None:
    encoder = make_encoder(encoder_name, weights)
    started = time.process_time()
    x, y = describe_all(encoder, known[0]), torch.from_numpy(known[1])
    cost = 1000 * (time.process_time() - started) / len(known[0])
    mask = torch.from_numpy(np.stack([o.mask for o in known[0]]))
    torch.manual_seed(0)
    network = QNetwork(x.shape[1])
    optimizer = torch.optim.Adam(network.parameters(), lr=3e-4)
    for _ in range(epochs):
        for rows in torch.randperm(len(x)).split(64):
            error = (network(x[rows]) - y[rows]) * mask[rows]
            optimizer.zero_grad()
            error.square().mean().backward()
            optimizer.step()
    with torch.inference_mode():
        told = network(describe_all(encoder, unknown[0])).numpy()
    valid = np.stack([o.mask for o in unknown[0]])
    chosen = np.where(valid, told, -np.inf).argmax(axis=1)
    best = np.where(valid, unknown[1], -np.inf).max(axis=1)
    got = unknown[1][np.arange(len(chosen)), chosen]
    unexplained = ((told - unknown[1])[valid] ** 2).mean() / unknown[1][valid].var()
    print(f"{encoder_name}: {x.shape[1]} features, {cost:.2f} ms a component; of unknown meshes: ", end="")
    share = got.mean() / best.mean()
    print(f"R2 {1 - unexplained:.3f}, the plane chosen saves {share:.3f} of what the best one does")


def describe_all(encoder: object, seen: list[Observation]) -> torch.Tensor:
    return torch.from_numpy(np.concatenate([describe(encoder, [o], scale_input=False) for o in seen]))  # type: ignore[arg-type]


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("meshes", type=Path)
    parser.add_argument("--known", type=int, default=2000)
    parser.add_argument("--unknown", type=int, default=500)
    parser.add_argument("--epochs", type=int, default=20)
    parser.add_argument("--encoder-weights", help="Weights of i2p-mae; it is left out without.")
    given = parser.parse_args()
    torch.set_num_threads(1)
    listed = list_meshes(given.meshes, max_faces=500, validation=200, seed=0)
    solids, criterion = Solids(given.meshes), Concavity(0.04)
    rng = np.random.default_rng(0)
    known = components(Episodes(solids, listed.training, criterion, True, 64, 64), given.known, rng)
    unknown = components(Episodes(solids, listed.validation, criterion, True, 64, 64), given.unknown, rng)
    mean = known[1].mean(axis=0)
    valid = np.stack([o.mask for o in unknown[0]])
    same = np.where(valid, mean, -np.inf).argmax(axis=1)
    best = np.where(valid, unknown[1], -np.inf).max(axis=1).mean()
    print(f"always the same plane saves {unknown[1][np.arange(len(same)), same].mean() / best:.3f}")
    encoders = {"profile": "", "pointnet": ""} | ({I2P_MAE: given.encoder_weights} if given.encoder_weights else {})
    for name, weights in encoders.items():
        learn(name, weights, known, unknown, given.epochs)


if __name__ == "__main__":
    main()
