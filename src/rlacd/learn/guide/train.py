"""Training the guide from scratch: label, fit, deploy, and again with the network's own choices.

Every step leaves a file, and no step that has one is repeated: a run that was stopped goes on where it stopped and
ends with the same weights.
"""

from __future__ import annotations

import json
import os
import time
import zlib
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
import torch

from rlacd.errors import OptionError
from rlacd.learn.guide.deploy import deploy, ratio
from rlacd.learn.guide.export import export
from rlacd.learn.guide.files import save_arrays
from rlacd.learn.guide.fit import fit, load_labels
from rlacd.learn.guide.label import label
from rlacd.learn.guide.meshes import is_held_out, load_solid, mesh_names, shuffled
from rlacd.learn.guide.network import Ensemble
from rlacd.learn.guide.rollout import Cost
from rlacd.policies import Greedy
from rlacd.policies.greedy import excess_norm
from rlacd.policies.learned import Guide, Learned, guided_cost

SCALES = (0.025, 0.1)
"""Thresholds labelled: half and twice the usual one."""


@dataclass(frozen=True)
class TrainOptions:
    """What a training run depends on; the field's help is the command's."""

    meshes: Path = field(metadata={"help": "folder of meshes to learn from"})
    work: Path = field(metadata={"help": "folder for labels, networks and curves; a run goes on from what is there"})
    seed: int = field(default=0, metadata={"help": "for everything that is drawn"})
    rounds: int = field(default=3, metadata={"help": "times that meshes are labelled and a network is fitted"})
    meshes_per_round: int = field(default=700, metadata={"help": "meshes labelled in a round, taken in turn"})
    sweeps_per_mesh: int = field(default=300, metadata={"help": "sweeps after which no state of a mesh is begun"})
    max_bytes: int = field(default=16_000, metadata={"help": "larger files are left out"})
    held_out: int = field(default=60, metadata={"help": "meshes to deploy on and never to learn from"})
    epochs: int = field(default=12, metadata={"help": "passes over the labels"})
    members: int = field(default=2, metadata={"help": "networks whose mean is taken"})
    width: int = field(default=24, metadata={"help": "channels of a network"})
    listwise: float = field(default=0.3, metadata={"help": "weight of the listwise loss"})
    blend: float = field(default=1.0, metadata={"help": "weight of the greedy score beside the network"})
    edge_bonus: float = field(default=0.1, metadata={"help": "taken off log(cost) of concave edges' planes"})
    threshold: float = field(default=0.05, metadata={"help": "concavity that networks are deployed at"})


def train(options: TrainOptions, say: Callable[[str], None] = print) -> Path:
    """Train a guide.

    Returns
    -------
    Path
        The last round's network (ONNX; its weights lie beside it as safetensors).

    Raises
    ------
    OptionError
        There are no meshes to learn from.
    """
    torch.set_num_threads(1)
    torch.use_deterministic_algorithms(True)
    names = mesh_names(options.meshes, options.max_bytes)
    learning = shuffled([n for n in names if not is_held_out(n)], options.seed)
    judging = shuffled([n for n in names if is_held_out(n)], options.seed)[: options.held_out]
    if not learning:
        raise OptionError(f"There are no meshes of at most {options.max_bytes} bytes in {options.meshes}.")
    network: Path | None = None
    for number in range(options.rounds):
        first = number * options.meshes_per_round
        turn = [learning[i % len(learning)] for i in range(first, first + min(options.meshes_per_round, len(learning)))]
        _label_round(options, number, turn, network, say)
        network = _fit_round(options, number, say)
        _deploy_round(options, number, network, judging, say)
    assert network is not None
    return network


def _label_round(
    options: TrainOptions, number: int, names: Sequence[str], network: Path | None, say: Callable[[str], None]
) -> None:
    folder = options.work / f"round{number}" / "labels"
    waiting = [name for name in names if not (folder / f"{name}.npz").exists()]
    guide = None if network is None else Guide(network)
    labels, start = 0, time.monotonic()
    for i, name in enumerate(waiting):
        rng = np.random.default_rng([options.seed, number, zlib.crc32(name.encode())])
        threshold = options.threshold * float(2 ** rng.uniform(-1, 1) if rng.random() < 0.4 else 1)
        solid = load_solid(options.meshes, name, options.work / "solids")
        found = (
            {}
            if solid is None
            else label(solid, threshold, _cost(guide, threshold), options.sweeps_per_mesh, rng).arrays()
        )
        save_arrays(folder / f"{name}.npz", found)
        labels += len(found.get("parts", ()))
        if i % 50 == 49 or i + 1 == len(waiting):
            say(f"round {number}: {i + 1}/{len(waiting)} meshes, {labels} labels, {time.monotonic() - start:.0f} s")


def _cost(guide: Guide | None, threshold: float) -> Cost:
    """The policy whose choices are labelled: greedy at first, then the last network's."""
    if guide is None:
        return lambda component, swept: excess_norm(swept)
    return lambda component, swept: guided_cost(guide, component, swept, threshold)


def _fit_round(options: TrainOptions, number: int, say: Callable[[str], None]) -> Path:
    folder = options.work / f"round{number}"
    path = folder / "guide.onnx"
    if path.exists():
        return path
    shards = sorted(p for n in range(number + 1) for p in (options.work / f"round{n}" / "labels").rglob("*.npz"))
    data = load_labels(shards)
    say(f"round {number}: fitting {len(data)} states, {int(data.known.sum())} labels")
    start = time.monotonic()
    curves: list[dict[str, float]] = []
    members = [
        fit(
            data,
            seed=options.seed + 1000 * number + member,
            epochs=options.epochs,
            width=options.width,
            listwise=options.listwise,
            log=lambda row, member=member: curves.append({"member": member, **row}),  # type: ignore[misc]
        )
        for member in range(options.members)
    ]
    _write(folder / "curves.jsonl", curves)
    about = {
        "scales": SCALES,
        "blend": options.blend,
        "edge_bonus": options.edge_bonus,
        "criterion": "concavity",
        "labels": int(data.known.sum()),
        "round": number,
        "options": {k: v for k, v in asdict(options).items() if k not in ("meshes", "work")},
    }
    part = folder / "part.onnx"
    export(Ensemble(members), part, about)
    os.replace(part.with_suffix(".safetensors"), path.with_suffix(".safetensors"))
    os.replace(part, path)
    say(f"round {number}: fitted, {time.monotonic() - start:.0f} s")
    return path


def _deploy_round(
    options: TrainOptions, number: int, network: Path, names: Sequence[str], say: Callable[[str], None]
) -> None:
    folder = options.work / f"round{number}"
    if not names or (folder / "deployed.json").exists():
        return
    solids = [s for n in names if (s := load_solid(options.meshes, n, options.work / "solids")) is not None]
    counts = deploy(Learned(network, options.threshold), solids, options.threshold)
    row: dict[str, Any] = {"raw": sum(c.raw for c in counts), "merged": sum(c.merged for c in counts)}
    for score in ("hull-sum", "excess-norm"):
        baseline = deploy(Greedy(score, concave_edges=0), solids, options.threshold)
        both = [min(pair, key=lambda c: c.merged) for pair in zip(counts, baseline, strict=True)]
        row |= {f"ratio to {score}": ratio(counts, baseline), f"the better of it and {score}": ratio(both, baseline)}
    say(f"round {number}: deployed {row}")
    _write(folder / "deployed.json", [row])


def _write(path: Path, rows: Sequence[dict[str, Any]]) -> None:
    part = path.with_name(path.name + ".part")
    part.write_text("".join(json.dumps(row) + "\n" for row in rows))
    os.replace(part, path)
