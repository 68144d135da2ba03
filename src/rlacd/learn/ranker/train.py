"""Training the plane ranker from scratch: label, fit, deploy, and repeat with the network's own choices.

Every step writes a file and is skipped if the file exists: an interrupted run resumes where it stopped and ends with
the same weights.
"""

from __future__ import annotations

import json
import time
import zlib
from collections.abc import Callable, Iterator, Sequence
from contextlib import ExitStack
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any

import torch

from rlacd.criteria import Concavity
from rlacd.errors import OptionError
from rlacd.learn.files import save_bytes
from rlacd.learn.meshes import SOLID, Solids, is_held_out, shuffled, small_files
from rlacd.learn.parts import count_parts, mean_ratio
from rlacd.learn.ranker.export import export
from rlacd.learn.ranker.fit import fit, load_labels
from rlacd.learn.ranker.label_server import SERVER, TOO_MANY_FACES
from rlacd.learn.ranker.network import Ensemble
from rlacd.policies import Greedy
from rlacd.policies.learned import Learned
from rlacd.pool import InProcessPool, Pool, Request, Shared, WorkerDiedError, answers
from rlacd.solid.component import Component

SCALES = (0.025, 0.1)
"""Thresholds labelled: half and twice the usual one."""


@dataclass(frozen=True)
class TrainOptions:
    """All options of a training run; the fields' help is the command's help."""

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


def train(options: TrainOptions, say: Callable[[str], None] = print, pool: Pool | None = None) -> Path:
    """Train a plane ranker.

    Parameters
    ----------
    options : TrainOptions
    say : callable
        Receives lines of progress.
    pool : Pool, optional
        Where meshes are labelled; in this process by default. It affects only the time taken.

    Returns
    -------
    Path
        The last round's network (ONNX; its weights are beside it as safetensors).

    Raises
    ------
    OptionError
        There are no meshes for training.
    """
    torch.set_num_threads(1)
    torch.use_deterministic_algorithms(True)
    names = small_files(options.meshes, options.max_bytes)
    learning = shuffled([n for n in names if not is_held_out(n)], options.seed)
    judging = shuffled([n for n in names if is_held_out(n)], options.seed)[: options.held_out]
    if not learning:
        raise OptionError(f"There are no meshes of at most {options.max_bytes} bytes in {options.meshes}.")
    network: Path | None = None
    a_round = min(options.meshes_per_round, len(learning))
    with ExitStack() as stack:
        where = pool or stack.enter_context(InProcessPool())
        for number in range(options.rounds):
            first = number * options.meshes_per_round
            turn = [learning[i % len(learning)] for i in range(first, first + a_round)]
            _label_round(options, number, turn, network, where, say)
            network = _fit_round(options, number, say)
            _deploy_round(options, number, network, judging, say)
    assert network is not None
    return network


def _label_round(
    options: TrainOptions,
    number: int,
    names: Sequence[str],
    network: Path | None,
    pool: Pool,
    say: Callable[[str], None],
) -> None:
    folder = options.work / f"round{number}" / "labels"
    waiting = [name for name in names if not (folder / f"{name}.npz").exists()]
    solids = Solids(options.meshes, options.work / "solids")
    shared = {} if network is None else {"network": Shared({"onnx": network.read_bytes()})}

    def requests() -> Iterator[tuple[str, Request]]:
        for name in waiting:
            values = {
                "threshold": options.threshold,
                "budget": options.sweeps_per_mesh,
                "seed": [options.seed, number, zlib.crc32(name.encode())],
            }
            yield name, Request(SERVER, values, solids.files(name), shared)

    labels, start = 0, time.monotonic()
    for i, (name, answer) in enumerate(answers(pool, requests())):
        if isinstance(answer, WorkerDiedError):
            say(f"{name} is left out: {answer}")
            continue
        if SOLID in answer.blobs:
            solids.keep(name, answer.blobs[SOLID])
        save_bytes(folder / f"{name}.npz", answer.blobs["labels"])
        labels += answer.values["labels"]
        if i % 50 == 49 or i + 1 == len(waiting):
            say(f"round {number}: {i + 1}/{len(waiting)} meshes, {labels} labels, {time.monotonic() - start:.0f} s")


def _fit_round(options: TrainOptions, number: int, say: Callable[[str], None]) -> Path:
    folder = options.work / f"round{number}"
    path = folder / "ranker.onnx"
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
    part.with_suffix(".safetensors").replace(path.with_suffix(".safetensors"))
    part.replace(path)
    say(f"round {number}: fitted, {time.monotonic() - start:.0f} s")
    return path


def _deploy_round(
    options: TrainOptions, number: int, network: Path, names: Sequence[str], say: Callable[[str], None]
) -> None:
    folder = options.work / f"round{number}"
    if not names or (folder / "deployed.json").exists():
        return
    cache, criterion = Solids(options.meshes, options.work / "solids"), Concavity(options.threshold)
    found = [s for n in names if (s := cache.manifold(n)) is not None and s.num_tri() <= TOO_MANY_FACES]
    solids = [Component(solid) for solid in found]
    counts = count_parts(Learned(network, options.threshold), solids, criterion)
    row: dict[str, Any] = {"raw": sum(counts.raw), "merged": sum(counts.merged)}
    for score in ("hull-sum", "excess-norm"):
        baseline = count_parts(Greedy(score, concave_edges=0), solids, criterion)
        cut = [(ours, theirs) for ours, theirs in zip(counts.merged, baseline.merged, strict=True) if theirs > 1]
        row[f"ratio to {score}"] = mean_ratio([ours for ours, _ in cut], [theirs for _, theirs in cut])
        row[f"the better of it and {score}"] = mean_ratio([min(pair) for pair in cut], [theirs for _, theirs in cut])
    say(f"round {number}: deployed {row}")
    _write(folder / "deployed.json", [row])


def _write(path: Path, rows: Sequence[dict[str, Any]]) -> None:
    save_bytes(path, "".join(json.dumps(row) + "\n" for row in rows).encode())
