"""Fit the networks of `policy="learned"` to labels: `python benchmarks/learned/fit.py LABELS [--out FOLDER]`.

LABELS is the folder that `labels.py` writes. The target is log(parts) less its mean over the component's labelled
planes; the loss is a Huber loss within components, so that only the order of planes matters. Prints the mean change of
log(parts) against greedy's plane, five-fold cross-validated by mesh, before it fits to everything, if there is a folder
to write to.
"""

from __future__ import annotations

import argparse
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray
from torch import nn

from rlacd.planes.candidates import Candidates
from rlacd.planes.sweep import Sweep
from rlacd.policies.learned import KIND, LEAST_GAIN, NAMES
from rlacd.policies.network import Network
from rlacd.policies.plane_features import plane_features
from rlacd.solid.arrays import FloatArray

HIDDEN, EPOCHS, RATE, DECAY, DROPOUT, AT_ONCE = (64, 32), 15, 2e-3, 0.1, 0.2, 64
FOLDS = 5


@dataclass(frozen=True, eq=False)
class Labels:
    """Labelled planes: features [L, F], log(parts) [L]; where each component begins [C + 1]; the mesh of each [C]."""

    features: NDArray[np.float64]
    parts: NDArray[np.float64]
    begin: NDArray[np.intp]
    mesh: NDArray[np.intp]


def features_of(shard: dict[str, Any], here: slice, info: FloatArray, length: float | None) -> FloatArray:
    """What a network sees of the planes of a component of a shard."""
    candidates = Candidates(shard["D"][here], shard["O"][here][:, None])
    scored = Sweep(candidates, *shard["F"][here].T.astype(np.float64))
    return plane_features(scored, shard["valid"][here], info[0], info[1], info[2:5], length)


def read(folder: Path) -> Labels:
    """Read the shards of a folder."""
    features, parts, sizes, meshes = [], [], [], []
    number: dict[str, int] = {}
    for path in sorted(folder.glob("*[0-9].npz")):
        with np.load(path, allow_pickle=False) as file:
            shard = dict(file)
        ends = np.cumsum(shard.get("planes", []))
        for i, end in enumerate(ends):
            rows, info = shard["rows"][shard["rows"][:, 0] == i], shard["info"][i]
            if len(rows) < 2:
                continue
            here = slice(end - shard["planes"][i], end)
            features.append(features_of(shard, here, info, None if info[9] else float(info[8]))[rows[:, 1]])
            parts.append(np.log(rows[:, 2]))
            sizes.append(len(rows))
            meshes.append(number.setdefault(str(shard["files"][i]), len(number)))
    return Labels(
        np.concatenate(features), np.concatenate(parts), np.concatenate([[0], np.cumsum(sizes)]), np.array(meshes)
    )


def fit(labels: Labels, chosen: NDArray[np.intp], seed: int) -> Network:
    """Fit a network to the chosen components."""
    torch.manual_seed(seed)
    rng, x = np.random.default_rng(seed), labels.features
    mean, deviation = x.mean(axis=0), x.std(axis=0) + 1e-6
    inputs = torch.tensor((x - mean) / deviation, dtype=torch.float32)
    targets = torch.tensor(labels.parts, dtype=torch.float32)
    first, second = HIDDEN
    hidden = (nn.Linear(x.shape[1], first), nn.Linear(first, second), nn.Linear(second, 1))
    net = nn.Sequential(hidden[0], nn.ReLU(), nn.Dropout(DROPOUT), hidden[1], nn.ReLU(), hidden[2])
    optimizer = torch.optim.AdamW(net.parameters(), lr=RATE, weight_decay=DECAY)
    batches = len(chosen) // AT_ONCE + 1
    schedule = torch.optim.lr_scheduler.CosineAnnealingLR(optimizer, EPOCHS * batches)
    for _ in range(EPOCHS):
        for batch in np.array_split(rng.permutation(chosen), batches):
            rows = np.concatenate([np.arange(labels.begin[c], labels.begin[c + 1]) for c in batch])
            owner = torch.tensor(np.repeat(np.arange(len(batch)), np.diff(labels.begin)[batch]))
            count = torch.bincount(owner)
            error = net(inputs[rows])[:, 0] - targets[rows]
            error = error - (torch.zeros(len(batch)).index_add(0, owner, error) / count)[owner]
            loss = nn.functional.huber_loss(error, torch.zeros_like(error), delta=0.5)
            optimizer.zero_grad()
            loss.backward()
            optimizer.step()
            schedule.step()
    layers = [(h.weight.detach().numpy(), h.bias.detach().numpy()) for h in hidden]
    weight, bias = layers[0]
    layers[0] = weight / deviation, bias - weight @ (mean / deviation)  # the file's network takes features as they are
    return Network(layers, {"kind": KIND, "threshold": 1.0})


def gain(labels: Labels, predicted: NDArray[np.float64], components: NDArray[np.intp]) -> NDArray[np.float64]:
    """Change of log(parts) against greedy's plane, the first of each component, if the prediction chooses."""
    found = []
    for c in components:
        here = slice(labels.begin[c], labels.begin[c + 1])
        best = int(predicted[here].argmin())
        better = predicted[here][best] < predicted[here][0] - LEAST_GAIN
        found.append(labels.parts[here][best] - labels.parts[here][0] if better else 0.0)
    return np.array(found)


def cross_validated(labels: Labels) -> NDArray[np.float64]:
    """`gain` of each component by networks that have not seen its mesh."""
    fold = np.random.default_rng(0).permutation(labels.mesh.max() + 1)[labels.mesh] % FOLDS
    gains = []
    for k in range(FOLDS):
        networks = [fit(labels, np.flatnonzero(fold != k), seed) for seed in range(len(NAMES))]
        predicted = np.mean([n(labels.features.astype(np.float32))[:, 0] for n in networks], axis=0)
        gains.append(gain(labels, predicted, np.flatnonzero(fold == k)))
    return np.concatenate(gains)


def main() -> None:
    """Cross-validate, fit and write the networks."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("labels", type=Path)
    parser.add_argument("--out", type=Path)
    args = parser.parse_args()
    torch.set_num_threads(1)
    labels = read(args.labels)
    print(f"{len(labels.parts)} planes of {len(labels.mesh)} components of {labels.mesh.max() + 1} meshes")
    every = cross_validated(labels)
    print(f"held out: log(parts) {every.mean():+.4f} +- {every.std() / len(every) ** 0.5:.4f} against greedy's plane")
    for seed, name in enumerate(NAMES if args.out else ()):
        (args.out / name).write_bytes(fit(labels, np.arange(len(labels.mesh)), seed).to_bytes())


if __name__ == "__main__":
    main()
