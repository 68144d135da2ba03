"""How well an encoder's features tell kinds of objects apart: a linear probe, pretrained weights against random ones.

    rlacd pretrain MESHES/train --out WEIGHTS --validation 600 ...
    python benchmarks/encoder_probe.py MESHES/train WEIGHTS

The kind of an object is a word in its file's name. The probe learns on meshes that the pretraining learned on, and is
asked about those it held out, which neither has seen; both as clouds of the surface in the unit ball.
"""

from __future__ import annotations

import argparse
import json
import re
from collections import Counter
from collections.abc import Callable
from pathlib import Path

import numpy as np
import torch

from rlacd.learn.encoders import I2PMAEEncoder
from rlacd.learn.pretrain.clouds import Clouds

WORDS = """
    barrel bed bench book bridge cabinet chair chest coin column couch crate door fence floor grass grenade gravestone
    house key kitchen lamp pipe pistol plate potion rock roof shelf shield sign skull sniper spikes stairs sword
    table tower tree wall window
"""
KINDS = frozenset(WORDS.split())
ALSO = {"pillar": "column", "sofa": "couch", "houses": "house", "rocks": "rock", "pipes": "pipe", "light": "lamp"}

LEAST = 8
"""Meshes of a kind to learn on, and a quarter of that to ask about: kinds with fewer are left out."""

PENALTIES = (1e-4, 1e-3, 1e-2, 1e-1)

DRAWS = 2
"""Clouds drawn of a mesh to learn on."""


def kind_of(name: str) -> str | None:
    """The one word of `KINDS` in a file's name; None without any, or with several."""
    stem = Path(name).stem.split("__")[-1]
    words = {word.lower() for word in re.findall(r"[A-Z]?[a-z]+", stem)}
    found = {ALSO.get(word, word) for word in words} & KINDS
    return found.pop() if len(found) == 1 else None


def labelled(clouds: Clouds, kinds: list[str]) -> tuple[list[int], np.ndarray]:
    rows = [i for i, name in enumerate(clouds.names) if kind_of(name) in kinds]
    return rows, np.array([kinds.index(kind_of(clouds.names[i]) or "") for i in rows])


def fit(x: torch.Tensor, y: torch.Tensor, kinds: int, penalty: float) -> Callable[[torch.Tensor], torch.Tensor]:
    """Multinomial logistic regression on standardised features."""
    mean, deviation = x.mean(dim=0), x.std(dim=0).clamp_min(1e-6)
    weights = torch.zeros(x.shape[1] + 1, kinds, requires_grad=True)
    optimizer = torch.optim.LBFGS([weights], max_iter=200, line_search_fn="strong_wolfe")

    def scores(of: torch.Tensor) -> torch.Tensor:
        return ((of - mean) / deviation) @ weights[:-1] + weights[-1]

    def loss() -> torch.Tensor:
        optimizer.zero_grad()
        value = torch.nn.functional.cross_entropy(scores(x), y) + penalty * weights[:-1].square().sum()
        value.backward()
        return value

    optimizer.step(loss)
    return lambda of: scores(of).argmax(dim=1)


def accuracy(x: torch.Tensor, y: torch.Tensor, groups: np.ndarray, asked: torch.Tensor, true: torch.Tensor) -> float:
    """On what is asked; the penalty is chosen by a fifth of the meshes known."""
    kinds = int(y.max()) + 1
    kept_out = torch.from_numpy(groups % 5 == 0)
    tried = [
        float((fit(x[~kept_out], y[~kept_out], kinds, p)(x[kept_out]) == y[kept_out]).float().mean()) for p in PENALTIES
    ]
    best = PENALTIES[int(np.argmax(tried))]
    return float((fit(x, y, kinds, best)(asked) == true).float().mean())


def described(encoder: I2PMAEEncoder, points: np.ndarray) -> torch.Tensor:
    with torch.inference_mode():
        found = torch.cat([encoder.features(chunk) for chunk in torch.from_numpy(points).split(16)])
    return found.clone()


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("meshes", type=Path)
    parser.add_argument("weights", type=Path)
    parser.add_argument("--points", type=int, default=1024)
    parser.add_argument("--random", type=int, default=3, help="Encoders with random weights to compare with.")
    given = parser.parse_args()
    torch.set_num_threads(1)
    run = given.weights.with_suffix(".run")
    listed = json.loads((run / "meshes.json").read_text())
    known = Clouds(given.meshes, listed["training"], run / "training.npy")
    asked = Clouds(given.meshes, listed["validation"], run / "validation.npy")
    counts = [Counter(kind_of(name) for name in clouds.names) for clouds in (known, asked)]
    kinds = [k for k in sorted(KINDS) if counts[0][k] >= LEAST and counts[1][k] >= LEAST // 4]
    known_rows, y = labelled(known, kinds)
    asked_rows, true = labelled(asked, kinds)
    rng = np.random.default_rng(0)
    learned_on = np.concatenate([known.draw(known_rows, given.points, rng) for _ in range(DRAWS)])
    asked_about = asked.draw(asked_rows, given.points, rng)
    groups, y = np.tile(np.arange(len(y)), DRAWS), np.tile(y, DRAWS)
    most = np.bincount(true).max() / len(true)
    print(
        f"{len(kinds)} kinds, {len(known_rows)} meshes known, {len(true)} asked about; always the commonest: {most:.3f}"
    )

    def tell(name: str, features: Callable[[np.ndarray], torch.Tensor]) -> float:
        x, q = features(learned_on), features(asked_about)
        share = accuracy(x, torch.from_numpy(y), groups, q, torch.from_numpy(true))
        print(f"{name}: {x.shape[1]} features, {share:.3f} right", flush=True)
        return share

    trained = I2PMAEEncoder.from_checkpoint(given.weights)
    tell("pretrained", lambda points: described(trained, points))
    shares = []
    for seed in range(given.random):
        torch.manual_seed(seed)
        encoder = I2PMAEEncoder(trained.sizes)
        shares.append(tell(f"random weights, seed {seed}", lambda points, e=encoder: described(e, points)))  # type: ignore[misc]
    print(f"random weights: {np.mean(shares):.3f} ± {np.std(shares):.3f}")
    tell("half sides of the box alone", lambda points: torch.from_numpy(np.abs(points).max(axis=1)))


if __name__ == "__main__":
    main()
