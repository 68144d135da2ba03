"""Light trials: small damaged files read, small shapes decomposed and judged, many a second in one process.

Like the trials of `fuzz.trials`, each is a function of a seed and its number alone. They differ in what they cost:
inputs are small, and `LightTrials` starts no process. `WarmTrials` runs them in one that is replaced when it dies,
hangs or grows.
"""

from __future__ import annotations

import logging
import math
import pickle
import resource
import sys
import time
import warnings
from collections import Counter
from dataclasses import replace
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np
import trimesh
from scipy.spatial import ConvexHull

import rlacd
from fuzz.choices import draw_options
from fuzz.judges import Case, judge
from fuzz.mutations import Seed, mutated, nudged, packed
from fuzz.recipes import Shape, concatenated, make_shape
from fuzz.trials import Trial
from fuzz.watched import Watched, end_of
from rlacd.io.read.load import load_mesh
from rlacd.pool import Blobs, ProcessLimits, Server, Values, WorkerDiedError
from rlacd.solid.input_mesh import InputMesh

KINDS = {"read": 0.91, "small": 0.09}
"""Relative frequency of each kind of light trial."""

LARGEST_FILE = 10_000
"""Bytes of the files that are damaged."""

MOST_FACES = 48
"""Of a small shape."""

BALLS, DENSE = 5, 200
"""One in so many small shapes is round, under limits on its corners; one in so many has over 10,000 triangles, too."""

MOST_OF_PLATES = 200
"""Faces of a plate with holes."""

SAMPLES = 100
"""Points of the input and of the hulls that the judges look at."""

DECOMPOSED = 0.5
"""Share of the damaged files that are decomposed, if they are read and small: one in a hundred of all."""

SPACE_SECONDS = 1.0
"""The timeout where balls decide: loose triangles and small balls may give tens of thousands of parts."""

LONGEST_SENTENCE = 700

CPU_SECONDS = 30.0
"""CPU seconds that a light trial may take."""

LIMITS = ProcessLimits(600.0, 2 * 2**30)

LIFE = 5000
"""Number of trials after which the process is replaced."""

ROOM = 3 * 2**30
"""Bytes of address space beside what the process has when it begins."""

_HERE = ("3mf", "dae", "glb", "gltf", "obj", "off", "ply", "stl", "xyz")
"""Formats that are read in this process; the others start one of their own for each file (`rlacd.io.read.apart`)."""

Options = dict[str, Any]


class LightTrials:
    """Runs light trials in this process.

    Parameters
    ----------
    seed : int
    seeds : dict
        Valid files to damage, by format (`fuzz.damaged.seeds_of`).
    folder : Path
        For the damaged files. A file opened elsewhere is a failure.
    """

    def __init__(self, seed: int, seeds: dict[str, list[Seed]], folder: Path) -> None:
        self.seed = seed
        small = {kind: [seed for seed in some if len(seed.content) <= LARGEST_FILE] for kind, some in seeds.items()}
        self._seeds = {
            kind: within
            for kind, some in small.items()
            if kind in _HERE and (within := [s for s in some if _is_here(s)])
        }
        if "dae" in self._seeds:
            self._seeds["zae"] = [Seed(packed({"mesh.dae": seed.content})) for seed in self._seeds["dae"]]
        self._folder = folder
        self._eye = _OpenedFiles(folder)

    def kind(self, number: int) -> str:
        """The kind of trial of a number."""
        return "read" if np.random.default_rng([self.seed, number, 20]).random() < KINDS["read"] else "small"

    def trial(self, number: int) -> Trial:
        """Run a trial."""
        start = time.process_time()
        trial = Trial(self.seed, number, self.kind(number))
        trial = self.retry(trial, *self.shape(number)) if trial.kind == "small" else self._read(trial)
        trial.cpu = time.process_time() - start
        return trial

    def shape(self, number: int) -> tuple[Shape, Options]:
        """Shape and options of a trial of the kind ``small``: the first of its shapes that is small enough."""
        if number % BALLS == 0:
            random = np.random.default_rng([self.seed, number, 22])
            return (_dense if number % DENSE == 0 else _balls)(random), _limits(random)
        for tries in range(100):
            shape = make_shape(self.seed * 10**12 + number * 100 + tries)
            if len(shape.faces) <= (MOST_FACES if len(shape.axes) == 0 else MOST_OF_PLATES):
                break
        return shape, _cheap(draw_options(self.seed * 10**12 + number))

    def retry(self, trial: Trial, shape: Shape, options: Options) -> Trial:
        """Decompose a shape with these options, and judge the result."""
        trial = replace(trial, story=list(shape.steps), options=options)
        end, said, hulls = _decomposed(shape, options)
        counts = Counter(decompositions=int(hulls > 0), hulls=hulls)
        return replace(trial, end=end, said=said, counts=counts)

    def damaged(self, number: int) -> tuple[str, Seed]:
        """The format and content of a trial of the kind ``read``."""
        random = np.random.default_rng([self.seed, number, 21])
        kind = list(self._seeds)[int(random.integers(len(self._seeds)))]
        seeds = self._seeds[kind]
        seed = seeds[random.integers(len(seeds))]
        damage = mutated if random.random() < 0.5 else nudged
        return kind, Seed(damage(kind, seed, seeds, random), seed.beside)

    def _read(self, trial: Trial) -> Trial:
        return self.reread(trial, *self.damaged(trial.number))

    def reread(self, trial: Trial, kind: str, file: Seed) -> Trial:
        """Read a file, check what was read, and decompose some of them."""
        for name, content in file.beside.items():
            (self._folder / name).write_bytes(content)
        path = self._folder / f"mesh.{kind}"
        path.write_bytes(file.content)
        trial = replace(trial, story=[f"damaged {kind}"], end="loaded", counts=Counter({"files": 1}))
        try:
            with self._eye:
                mesh = load_mesh(path)
        except rlacd.RlacdError as error:
            said = str(error)
            trial.counts[f"{kind} refused"] += 1
            is_sentence = said and "\n" not in said and len(said) <= LONGEST_SENTENCE
            trial.end, trial.said = ("refused", []) if is_sentence else ("wrong", [f"no sentence: {said!r:.900}"])
        except MemoryError as error:
            trial.end, trial.said = "memory", [repr(error)]
        except Exception as error:  # any other is a failure, and is what is looked for
            trial.end, trial.said = "untyped", [f"{type(error).__name__}: {error!s:.300}"]
        else:
            trial.counts[f"{kind} read"] += 1
            trial.said = wrong_in(mesh)
            trial.end = "wrong" if trial.said else "loaded"
            if trial.end == "loaded" and _chosen(trial) and 0 < len(mesh.faces) <= MOST_FACES:
                trial = self._decompose(trial, mesh)
        if self._eye.seen:
            trial.end, trial.said = "wrong", [*trial.said, *sorted(self._eye.seen)]
        return trial

    def _decompose(self, trial: Trial, mesh: InputMesh) -> Trial:
        shape = Shape(mesh.vertices, mesh.faces, tuple(trial.story))
        end, said, hulls = _decomposed(shape, _cheap(draw_options(trial.seed * 10**12 + trial.number)))
        trial.counts += Counter(decompositions=int(hulls > 0), hulls=hulls)
        return replace(trial, end="loaded" if end in ("done", "refused") else end, said=said)


class WarmTrials(LightTrials):
    """Light trials in a process of their own."""

    def __init__(self, seed: int, seeds: dict[str, list[Seed]], cpu_seconds: float = CPU_SECONDS) -> None:
        self._scratch = TemporaryDirectory(prefix="rlacd-light-")
        super().__init__(seed, seeds, Path(self._scratch.name))
        self._given = Path(self._scratch.name, "seeds")
        self._given.write_bytes(pickle.dumps((seed, seeds)))
        self._process, self._life = Watched(LIMITS, cpu_seconds), 0

    def trial(self, number: int) -> Trial:
        """Run a trial."""
        return self._ask(Trial(self.seed, number, self.kind(number)), "trial", number)

    def retry(self, trial: Trial, shape: Shape, options: Options) -> Trial:
        """Decompose another shape with other options."""
        return self._ask(trial, "retry", trial, shape, options)

    def reread(self, trial: Trial, kind: str, file: Seed) -> Trial:
        """Read another file."""
        return self._ask(trial, "reread", trial, kind, file)

    def close(self) -> None:
        """End the process."""
        self._process.close()
        self._scratch.cleanup()

    def _ask(self, trial: Trial, *request: Any) -> Trial:
        self._life += 1
        given = {"blobs": {"request": pickle.dumps(request)}, "fresh": self._life % LIFE == 0}
        try:
            answer = self._process.ask("fuzz.light:make_server", {"seeds": str(self._given)}, **given)
        except WorkerDiedError as error:
            end, said = end_of(error)
            return replace(trial, end=end, said=said, counts=Counter(files=int(trial.kind == "read")))
        done: Trial = pickle.loads(answer.blobs["trial"])
        return done


def make_server(folder: Path) -> Server:
    """The process of `WarmTrials`."""
    enter_worker()
    light: list[LightTrials] = []

    def answer(values: Values, blobs: Blobs) -> tuple[dict[str, Any], dict[str, bytes]]:
        if not light:
            seed, seeds = pickle.loads(Path(values["seeds"]).read_bytes())
            light.append(LightTrials(seed, seeds, folder))
        method, *given = pickle.loads(blobs["request"])
        return {}, {"trial": pickle.dumps(getattr(light[0], method)(*given))}

    return answer


def wrong_in(mesh: InputMesh) -> list[str]:
    """What is wrong with a mesh that was read: everything behind the reader relies on these facts."""
    found = []
    vertices, faces = mesh.vertices, mesh.faces
    if vertices.shape[1:] != (3,) or vertices.dtype != np.float64 or not np.isfinite(vertices).all():
        found.append(f"vertices {vertices.shape} of {vertices.dtype}, not all finite or no points")
    if faces.shape[1:] != (3,) or faces.dtype != np.int64:
        found.append(f"faces {faces.shape} of {faces.dtype}")
    if len(faces) and (faces.min() < 0 or faces.max() >= len(vertices)):
        found.append(f"faces use vertices {faces.min()} to {faces.max()} of {len(vertices)}")
    if not len(vertices):
        found.append("no points")
    if mesh.node_of is not None and (
        len(mesh.node_of) != len(faces) or (len(faces) and mesh.node_of.max() >= len(mesh.nodes))
    ):
        found.append(f"{len(mesh.node_of)} faces of {len(mesh.nodes)} nodes, but {len(faces)} faces")
    return found


def enter_worker() -> None:
    """Prepare a process that runs light trials and nothing else: bounded memory, no messages of parsers."""
    size = int(Path("/proc/self/statm").read_text(encoding="ascii").split()[0]) * resource.getpagesize()
    resource.setrlimit(resource.RLIMIT_AS, (size + ROOM, size + ROOM))
    resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
    logging.disable(logging.CRITICAL)
    warnings.simplefilter("ignore")


def _is_here(file: Seed) -> bool:
    """Whether no decoder in another process is needed."""
    return b"KHR_draco_mesh_compression" not in file.content


def _chosen(trial: Trial) -> bool:
    return bool(np.random.default_rng([trial.seed, trial.number, 22]).random() < DECOMPOSED)


def _dense(random: np.random.Generator) -> Shape:
    """A bumpy body, long, flat or round, and bent."""
    ball = trimesh.creation.icosphere(5)
    bumps = np.sin(np.array(ball.vertices) @ (3 * random.normal(size=(3, 3)))).sum(axis=1)
    corners = ball.vertices * (1 + random.choice([0.0, 0.03, 0.1]) * bumps)[:, None] * random.uniform(0.05, 1, 3)
    corners[:, 2] += random.uniform(0, 0.5) * np.sin(random.uniform(1, 5) * corners[:, 0])
    return Shape(corners, np.array(ball.faces, dtype=np.int64), ("dense",), True)


def _balls(random: np.random.Generator) -> Shape:
    """A few balls of up to 200 corners, stretched."""
    balls = []
    for _ in range(int(random.integers(1, 4))):
        points = random.normal(size=(int(random.choice([20, 60, 200])), 3))
        ball = ConvexHull(points / np.linalg.norm(points, axis=1)[:, None])
        outwards = np.where(np.linalg.det(ball.points[ball.simplices]) > 0, 1, -1)
        faces = np.where(outwards[:, None] > 0, ball.simplices, ball.simplices[:, ::-1]).astype(np.int64)
        corners = ball.points * random.uniform(0.2, 1, 3) + random.choice([0.0, 0.5, 3.0], 3)
        balls.append(Shape(corners, faces, ("ball",), True))
    return replace(concatenated(balls), is_closed=len(balls) == 1)


def _limits(random: np.random.Generator) -> Options:
    """Options with limits on hulls."""
    options: Options = {
        "threads": 1,
        "seed": 0,
        "quality": "fast",
        "threshold": float(random.choice([0.02, 0.05, 0.2])),
    }
    for name, share in (("max_vertices", 0.8), ("max_faces", 0.3), ("max_hulls", 0.2)):
        if random.random() < share:
            options[name] = int(random.choice([4, 5, 8, 16, 24, 32, 64] if name != "max_hulls" else [1, 2, 3]))
    if random.random() < 0.2:
        options["preset"] = str(random.choice(list(rlacd.PRESETS)))
    return options


def _cheap(options: Options) -> Options:
    """Make rarer among random options what takes long even for small shapes; `fuzz.trials` tries that."""
    if "criterion" in options:
        options["timeout"] = min(options.get("timeout", math.inf), SPACE_SECONDS)
    is_rare = options["seed"] % 3 == 0
    if "criterion" in options and not is_rare:
        del options["criterion"]
        options["threshold"] = 0.1
    if options.get("quality") != "fast" and options.get("merge", True) and not is_rare:
        options.pop("search_steps", None)
        options["quality"] = "fast"
    if options.get("quality", "balanced") != "fast" and options.get("merge", True):
        options["search_steps"] = min(options.get("search_steps", 7), 7)
    if "threshold" in options:
        options["threshold"] = max(options["threshold"], 0.05)
    return options


def _decomposed(shape: Shape, options: Options) -> tuple[str, list[str], int]:
    """Decompose and judge: how it ended, complaints, and the number of hulls."""
    try:
        result = rlacd.decompose((shape.vertices, shape.faces), **options)
    except (rlacd.MeshDataError, rlacd.EmptyMeshError) as error:
        usable = np.isfinite(shape.vertices[shape.faces]).all(axis=(1, 2)).any()
        return ("wrong", [f"refused: {error}"], 0) if usable else ("refused", [], 0)
    except MemoryError as error:
        return "memory", [repr(error)], 0
    except Exception as error:
        return "untyped", [f"{type(error).__name__}: {error!s:.300}"], 0
    report = {**(plain := result.report.as_dict()), "concavity": plain.get("concavity", {}).get("max")}
    hulls = [(np.array(hull.vertices), np.array(hull.faces)) for hull in result]
    said = judge(Case(shape, options, hulls, report), SAMPLES)
    return "wrong" if said else "done", said, len(hulls)


class _OpenedFiles:
    """Notes what is opened, started and connected to in a ``with`` block, if it is none of a reader's business."""

    def __init__(self, folder: Path) -> None:
        self.seen: set[str] = set()
        self._is_open = False
        self._allowed = (str(folder), *(place for place in {sys.prefix, sys.base_prefix, *sys.path} if place))
        sys.addaudithook(self._look)

    def __enter__(self) -> None:
        self.seen.clear()
        self._is_open = True

    def __exit__(self, *_: object) -> None:
        self._is_open = False

    def _look(self, event: str, given: tuple[Any, ...]) -> None:
        if not self._is_open:
            return
        if event == "open" and isinstance(given[0], str | bytes):
            path = given[0] if isinstance(given[0], str) else given[0].decode(errors="replace")
            if not str(Path(path).absolute()).startswith(self._allowed):
                self.seen.add(f"it opened {path!r:.200}")
        elif event in ("socket.connect", "socket.getaddrinfo", "subprocess.Popen", "os.system", "os.exec", "os.fork"):
            self.seen.add(f"it called {event} {given!r:.200}")
