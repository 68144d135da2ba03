"""The trials of a soak: each is a function of a seed and its number alone, tests one thing, and reports the outcome.

A trial is a damaged file, a random shape, a real mesh, a command under a fault, or a batch under a fault.
"""

from __future__ import annotations

import csv
import os
import time
from collections import Counter
from dataclasses import dataclass, field, replace
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np
import trimesh

from fuzz import faults
from fuzz.choices import draw_options
from fuzz.faults import draw_fault
from fuzz.files import read_hulls, write_mesh
from fuzz.geometry import why_not_convex
from fuzz.judges import Case, finite_faces, judge
from fuzz.mutations import Seed, damaged
from fuzz.recipes import FAULTS, Shape, make_shape, pick, placed
from fuzz.seeds import seeds_from
from fuzz.watched import Watched, end_of
from rlacd import NavigableSpace
from rlacd.batch import JobSpec
from rlacd.pool import ProcessLimits, WorkerDiedError

KINDS = {"file": 0.93, "shape": 0.06, "mesh": 0.004, "fault": 0.005, "batch": 0.001}
"""Relative frequency of each kind of trial."""

WELL = ("done", "loaded", "refused")
"""Acceptable outcomes of a trial."""

LARGEST_MESH = 20_000
"""Maximum number of triangles of a real mesh."""

FILE_LIMITS = ProcessLimits(1800.0, 2 * 2**30), 60.0
"""Limits of a damaged file, and its CPU seconds; it gets a timeout of one second."""

SHAPE_LIMITS = ProcessLimits(7200.0, 3 * 2**30), 300.0

BUDGET = {"threshold": 0.2, "max_hulls": 3, "quality": "fast", "timeout": 1.0, "threads": 1, "resolution": 30}
"""Options of a damaged file."""

FORMATS = ("obj", "obj", "obj", "ply", "ply", "glb", "stl", "urdf")
"""Of the hulls of a shape."""

AGAIN = 4
"""One in this many shapes is decomposed twice."""

LATE = 1.0, 1.1
"""How far a timeout may be exceeded: seconds, and a factor."""


@dataclass
class Trial:
    """A trial and its outcome.

    Attributes
    ----------
    seed, number
        Determine the trial.
    kind
        See `KINDS`.
    end
        See `WELL`; else ``crash``, ``hang``, ``memory``, ``untyped``, ``invalid``, ``bug`` or ``wrong``.
    said
        Complaints.
    story
        A description of the input.
    options
        Options of the decomposition.
    counts
        Numbers of decompositions, hulls and other things.
    cpu
        CPU seconds.
    """

    seed: int
    number: int
    kind: str
    end: str = "done"
    said: list[str] = field(default_factory=list)
    story: list[str] = field(default_factory=list)
    options: dict[str, Any] = field(default_factory=dict)
    counts: Counter[str] = field(default_factory=Counter)
    cpu: float = 0.0

    @property
    def is_well(self) -> bool:
        return self.end in WELL


class Laboratory:
    """Runs trials.

    Parameters
    ----------
    seed : int
    meshes : Path, optional
        The folder of real meshes; without it, files of a few simple shapes are damaged instead.
    """

    def __init__(self, seed: int, meshes: Path | None) -> None:
        self.seed = seed
        self._scratch = TemporaryDirectory(prefix="rlacd-soak-")
        self.folder = Path(self._scratch.name)
        self._meshes = meshes
        self._small = [] if meshes is None else _small_meshes(meshes)
        self._seeds = seeds_from(meshes)
        self._files, self._shapes = Watched(*FILE_LIMITS), Watched(*SHAPE_LIMITS)

    def close(self) -> None:
        """End all processes."""
        self._files.close()
        self._shapes.close()
        self._scratch.cleanup()

    def kind(self, number: int) -> str:
        """The kind of trial of a number."""
        kind = str(np.random.default_rng([self.seed, number, 10]).choice(list(KINDS), p=list(KINDS.values())))
        return "shape" if kind == "mesh" and not self._small else kind

    def trial(self, number: int) -> Trial:
        """Run a trial."""
        trial = Trial(self.seed, number, self.kind(number))
        start = time.thread_time()
        done: Trial = getattr(self, f"_{trial.kind}")(trial, np.random.default_rng([self.seed, number, 11]))
        done.cpu = round(done.cpu + time.thread_time() - start, 4)
        return done

    def shape(self, number: int) -> tuple[Shape, dict[str, Any]]:
        """Shape and options of a trial of the kinds ``shape``, ``mesh`` and ``fault``."""
        if self.kind(number) != "mesh":
            return make_shape(self._shape_seed(number)), draw_options(self._shape_seed(number))
        random = np.random.default_rng([self.seed, number, 12])
        path = self._small[int(random.integers(len(self._small)))]
        mesh = trimesh.load_mesh(path, process=False)
        shape = Shape(np.array(mesh.vertices, float), np.array(mesh.faces, np.int64), (path.name,))
        for _ in range(int(random.choice(3, p=[0.4, 0.4, 0.2]))):
            shape = pick(random, FAULTS)(shape, random)
        return placed(shape, random), draw_options(self._shape_seed(number))

    def damaged(self, number: int) -> tuple[str, Seed]:
        """The format and content of a trial of the kind ``file``."""
        random = np.random.default_rng([self.seed, number])
        kind = list(self._seeds)[number % len(self._seeds)]
        seeds = self._seeds[kind]
        return kind, damaged(kind, seeds[random.integers(len(seeds))], seeds, random)

    def reread(self, trial: Trial, kind: str, file: Seed) -> Trial:
        """Read a file and decompose it: to hulls that are convex, or to one typed error."""
        with TemporaryDirectory(dir=self.folder) as place:
            path = Path(place) / f"mesh.{kind}"
            for name, content in {**file.beside, path.name: file.content}.items():
                (Path(place) / name).write_bytes(content)
            options = dict(BUDGET)
            if kind == "npz":  # a network
                options["policy"], path = str(path), path.with_suffix(".stl")
                trimesh.creation.box().export(path)
            trial = replace(trial, story=[f"damaged {kind}"], counts=Counter({"files": 1, f"{kind} files": 1}))
            try:
                told, files = self._files.decompose(JobSpec(options, ending=".obj"), path, "mesh")
            except WorkerDiedError as error:
                trial.end, trial.said = end_of(error)
                return trial
        trial.cpu, said = told["cpu"], str(told.get("error", ""))
        if said:
            is_typed = not said.startswith(("a bug in rlacd", "there is not enough memory"))
            return replace(trial, end="refused" if is_typed else "untyped", said=[] if is_typed else [said])
        # Of a robot there is a file for each hull.
        read = [hull for name, data in files.items() if name.endswith(".obj") for hull in read_hulls(data, "obj")]
        said = "; ".join(f"hull {i}: {why}" for i, hull in enumerate(read) if (why := why_not_convex(*hull)))
        trial.counts["decompositions"] = 1
        return replace(trial, end="invalid" if said else "loaded", said=[said] if said else [])

    def retry(self, trial: Trial, shape: Shape, options: dict[str, Any]) -> Trial:
        """Decompose a shape, possibly again with another number of threads, and judge the result."""
        random = np.random.default_rng([self.seed, trial.number, 11])
        ending, twice = str(random.choice(FORMATS)), bool(random.random() < 1 / AGAIN)
        spec = JobSpec.of(options, file_type=ending)
        trial = replace(trial, end="done", said=[], story=list(shape.steps), options=spec.options)
        trial.counts = Counter(decompositions=1)
        mesh = write_mesh(self.folder / f"{trial.number}.ply", shape.vertices, shape.faces)
        try:
            told, files = self._shapes.decompose(spec, mesh, "out")
            trial.cpu = told["cpu"]
            if "error" in told:
                trial.end, trial.said = _refusal(shape, ending, told)
                return trial
            if twice and told["report"]["complete"]:
                other = JobSpec.of({**options, "threads": options["threads"] % 3 + 1}, file_type=ending)
                again, same = self._shapes.decompose(other, mesh, "out")
                trial.cpu += again["cpu"]
                if files != same:
                    return replace(trial, end="wrong", said=[f"other bytes on other threads {again.get('error', '')}"])
                trial.counts += Counter(decompositions=1, twice=1)
        except WorkerDiedError as error:
            trial.end, trial.said = end_of(error)
            return trial
        finally:
            mesh.unlink()
        trial.counts["hulls"] = told["report"]["hulls"]
        if ending in ("obj", "ply"):
            trial.said = judge(Case(shape, options, read_hulls(files[f"out.{ending}"], ending), told["report"]))
        return replace(trial, end="wrong" if trial.said else "done")

    def _shape_seed(self, number: int) -> int:
        return self.seed * 10**9 + number

    def _file(self, trial: Trial, random: np.random.Generator) -> Trial:
        return self.reread(trial, *self.damaged(trial.number))

    def _shape(self, trial: Trial, random: np.random.Generator) -> Trial:
        return self.retry(trial, *self.shape(trial.number))

    _mesh = _shape

    def _fault(self, trial: Trial, random: np.random.Generator) -> Trial:
        """Decompose without a fault, by the command under a fault over an older result, and by the command again."""
        shape, options = self.shape(trial.number)
        options.pop("timeout", None)
        if options.get("preset") == "unreal":
            del options["preset"]  # its files have another format
        ending = str(random.choice([*FORMATS, "mjcf", "folder"]))
        space = options.get("criterion")
        if isinstance(space, NavigableSpace) and space.radius is not None and float(space.radius) < 0.1:
            del options["criterion"]  # would give tens of thousands of parts
        spec = JobSpec.of(options, file_type=None if ending == "folder" else ending, folders=ending == "folder")
        trial = replace(trial, story=[*shape.steps, ending], options=options)
        with TemporaryDirectory(dir=self.folder) as place:
            mesh = write_mesh(Path(place) / "mesh.ply", shape.vertices, shape.faces)
            out = Path(place) / "out"
            out.mkdir()
            said, whole = self._shapes.decompose(spec, mesh, "out")
            trial.cpu += said["cpu"]
            if "error" in said:
                return replace(trial, end="refused", counts=Counter(faults=1))
            size = sum(map(len, whole.values()))
            fault = draw_fault(random, said["cpu"], size)
            trial = replace(trial, story=[*trial.story, f"{fault.name} {fault.environment or fault.memory or ''}"])
            main = next((name for name in whole if "/" not in name), "") if ending != "folder" else ""
            old = {main: b"old"} if main and random.random() < 0.5 else {}
            for name, content in old.items():
                (out / name).write_bytes(content)
            words = ["decompose", str(mesh), "-o", str(out / (main or "out")) + ("" if main else "/"), "--quiet"]
            words += [*(["--format", "obj"] if ending == "folder" else []), *faults.words_of(options)]
            first = faults.command(words, fault)
            after = faults.tree(out)
            found = faults.complaints(fault, first)
            found += faults.left_behind(fault, first.code, main, old, after, whole)
            if first.code == 4 and main.endswith((".obj", ".ply")):
                report = {**said["report"], "complete": False, "warnings": ["Incomplete exceed outside the hulls"]}
                hulls = read_hulls(after[main], main[-3:])
                report |= {"hulls": len(hulls), "hausdorff": {"missed": None, "added": None}, "concavity": None}
                found += judge(Case(shape, {**options, "max_hulls": None}, hulls, report))
            if fault.name == "timeout":
                found += _lateness(first.cpu, float(fault.words[1]), options["threads"])
            again = faults.command(words)
            now = faults.tree(out)
            if again.code != 0 or any(now.get(name) != content for name, content in whole.items()):
                found.append(f"the command again ends with {again.code} and other files: {again.said[-300:]}")
            if not fault.kills and (strays := now.keys() - whole.keys() - old.keys()):
                found.append(f"the command again leaves {', '.join(sorted(strays))}")
        counts = Counter(decompositions=3, faults=1, hulls=said["report"]["hulls"])
        counts[fault.name] += 1
        return replace(
            trial, end="wrong" if found else "done", said=found, counts=counts, cpu=trial.cpu + first.cpu + again.cpu
        )

    def _batch(self, trial: Trial, random: np.random.Generator) -> Trial:
        """Run a batch without a fault; under a fault; and again, after which all files must be equal."""
        with TemporaryDirectory(dir=self.folder) as place:
            assets = Path(place) / "assets"
            assets.mkdir()
            meshes = int(random.integers(2, 5))
            for i in range(meshes):
                shape = make_shape(self._shape_seed(trial.number) + 10**12 * (i + 1))
                write_mesh(assets / f"{i}.ply", shape.vertices, shape.faces)
                trial.story += [*shape.steps, f"{i}.ply"]
            (assets / "bad.stl").write_text("no mesh")
            words = ["batch", str(assets), "--quality=fast", "--threshold=0.2", "--jobs=1"]
            words.append(f"--format={random.choice(['obj', 'glb', 'urdf'])}")
            calm = faults.command([*words, "-o", f"{place}/calm"])
            fault = draw_fault(random, calm.cpu / 4, 20_000)
            while fault.memory or fault.words or fault.name == "clock jumps":  # other trials cover those
                fault = draw_fault(random, calm.cpu / 4, 20_000)
            trial.story.append(f"{fault.name} {fault.environment}")
            codes = tuple(5 if code == 0 else code for code in fault.codes)
            first = faults.command([*words, "-o", f"{place}/out"], replace(fault, codes=codes))
            found = faults.complaints(replace(fault, codes=codes), first)
            again = faults.command([*words, "-o", f"{place}/out"])
            expected, got = (_results(Path(place) / name) for name in ("calm", "out"))
            if calm.code != 5:
                found.append(f"undisturbed it ended with {calm.code}: {calm.said[-300:]}")
            if again.code != calm.code:
                found.append(f"the second run ended with {again.code}: {again.said[-300:]}")
            if expected != got:
                names = sorted(name for name in expected | got if expected.get(name) != got.get(name))
                found.append(f"the second run ends with other files: {', '.join(names)}")
        counts = Counter({"batches": 1, f"batch {fault.name}": 1, "decompositions": 3 * meshes})
        cpu = calm.cpu + first.cpu + again.cpu
        return replace(trial, end="wrong" if found else "done", said=found, counts=counts, cpu=cpu)


def _refusal(shape: Shape, ending: str, told: dict[str, Any]) -> tuple[str, list[str]]:
    """Tell whether an error is the right one for this input."""
    error = told["error"]
    if error.startswith("a bug in rlacd") or "memory" in error:
        return "bug", [error]
    if told.get("unusable"):
        is_right = len(finite_faces(shape)) == 0
    else:
        is_right = ending in ("glb", "urdf") and "precision" in error  # single precision cannot hold every hull
    return ("refused", []) if is_right else ("wrong", [error])


def _results(folder: Path) -> faults.Tree:
    """The files of a batch that are the same in every run."""
    return {
        name: content
        for name, content in faults.tree(folder).items()
        if name != "timings.jsonl" and not name.startswith(".rlacd/")
    }


def _lateness(cpu: float, timeout: float, threads: int) -> list[str]:
    """Lower bound of a command's lateness: wall time is at least CPU time over the number of threads."""
    late = (cpu - 4 * faults.STARTING) / min(threads, os.cpu_count() or 1) - LATE[1] * timeout
    return [f"it came {late:.1f} s after its timeout of {timeout:g} s, at least"] if late > LATE[0] else []


def _small_meshes(meshes: Path) -> list[Path]:
    with open(meshes / "index.csv", encoding="utf-8", newline="") as listing:
        return [meshes / row["file"] for row in csv.DictReader(listing) if 4 <= int(row["faces"]) <= LARGEST_MESH]
