r"""Damage real files of every format and check that each gives hulls or one typed error: no crash, no hang, no flood.

    python -m fuzz.damaged MESHES --minutes 10 --out files.jsonl [--seed 0] [--formats obj,glb]
    python -m fuzz.damaged --table files.jsonl
    python -m fuzz.damaged MESHES --seed 0 --only 1234 --keep folder     # one input again, its file kept
    python -m fuzz.damaged --minimise finding.obj                        # cut what it does not need

MESHES is the folder of real meshes. The seeds are the files in its ``raw/`` and small meshes of its index, written in
every format. Every input depends on the seed and its number alone, and is decomposed within a small budget by the
watched processes of a batch (`rlacd.batch`). Inputs that ended badly are written to the output.
"""

from __future__ import annotations

import argparse
import csv
import json
import os
import re
import shutil
import sys
import time
import uuid
from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from importlib.util import find_spec
from itertools import chain, count
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any
from unittest import mock

import numpy as np
import trimesh

from fuzz.fbx import PIVOTED, Model, fbx
from fuzz.files import read_hulls
from fuzz.geometry import why_not_convex
from fuzz.mutations import Seed, damaged, repacked
from fuzz.networks import q_network
from fuzz.worker import Watched
from rlacd.batch import JobSpec
from rlacd.pool import ProcessLimits, WorkerDiedError

CPU_SECONDS, SECONDS, MEMORY = 60.0, 1800.0, 2 * 2**30
"""Limits of an input: CPU time, wall time, bytes. A decomposition gets a timeout of one second."""

Row = dict[str, Any]

BUDGET = {"threshold": 0.2, "max_hulls": 3, "quality": "fast", "timeout": 1.0, "threads": 1, "resolution": 30}

LARGEST_SEED = 60_000

SMALL_MESHES = 12

BOX = trimesh.creation.box()

CASES = Path(__file__).parents[1] / "tests" / "cases"

URDF = (
    '<?xml version="1.0"?>\n<robot name="r">\n<link name="a">\n<collision name="c">\n<origin xyz="0 0 1"/>\n'
    '<geometry><mesh filename="box.stl" scale="1 2 -1"/></geometry>\n</collision>\n</link>\n<link name="b"/>\n'
    '<joint name="j" type="fixed">\n<parent link="a"/>\n<child link="b"/>\n</joint>\n</robot>\n'
)
MJCF = (
    '<mujoco model="m">\n<compiler meshdir="."/>\n<include file="parts.xml"/>\n<worldbody>\n'
    '<body name="x" childclass="c">\n<geom name="g" mesh="b" mass="2"/>\n<geom type="box" size="1 1 1"/>\n</body>\n'
    "</worldbody>\n</mujoco>\n"
)
MJCF_PARTS = (
    '<mujoco>\n<default>\n<default class="c">\n<geom type="mesh" group="3"/>\n</default>\n</default>\n<asset>\n'
    '<mesh name="b" file="box.msh" scale="1 1 2"/>\n</asset>\n<worldbody>\n<geom mesh="b" type="mesh"/>\n'
    "</worldbody>\n</mujoco>\n"
)

OFF_LETTERS = {"N": " 0 0 1", "C": " 255 128 0 255", "ST": " 0.5 0.25"}
"""Numbers that each letter before ``OFF`` adds to a vertex's line, in this order."""

WELL = ("loaded", "refused")
"""Acceptable outcomes of an input."""

ENDS = (*WELL, "crash", "hang", "memory", "untyped", "invalid")
"""All outcomes: ``untyped`` is an error that is not one of the package's own, ``invalid`` an invalid hull."""


def seeds_of(meshes: Path) -> dict[str, list[Seed]]:
    """Collect real files, and small real meshes written in every format, by format."""
    found: dict[str, list[Seed]] = {}
    for path in sorted((meshes / "raw").iterdir()):
        if path.stat().st_size < LARGEST_SEED:
            found.setdefault(path.suffix[1:], []).append(Seed(path.read_bytes()))
    with open(meshes / "index.csv", encoding="utf-8", newline="") as listing:
        small = [row["file"] for row in csv.DictReader(listing) if 8 < int(row["faces"]) < 150]
    for name in small[:: max(1, len(small) // SMALL_MESHES)][:SMALL_MESHES]:
        mesh = trimesh.load_mesh(meshes / name, process=False)
        for kind, seed in chain(written(mesh), written_by_extras(mesh)):
            found.setdefault(kind, []).append(seed)
    found["npz"] = [Seed(q_network())]
    return found


def written(mesh: trimesh.Trimesh) -> Iterator[tuple[str, Seed]]:
    """Write a mesh in every format."""
    mesh = trimesh.Trimesh(mesh.vertices, mesh.faces, process=False)
    scene = trimesh.Scene()
    scene.add_geometry(mesh, node_name="first", geom_name="mesh")
    scene.graph.update("second", "first", matrix=trimesh.transformations.translation_matrix([3, 0, 0]), geometry="mesh")
    yield "obj", Seed(mesh.export(file_type="obj").encode())
    yield from (("off", Seed(off_variant(mesh, letters))) for letters in ("", "N", "STCN"))
    yield "stl", Seed(mesh.export(file_type="stl"))
    yield "stl", Seed(mesh.export(file_type="stl_ascii").encode())
    yield "ply", Seed(mesh.export(file_type="ply"))
    yield "ply", Seed(mesh.export(file_type="ply", encoding="ascii"))
    with mock.patch("uuid.uuid4", side_effect=(uuid.UUID(int=i) for i in count())):  # reproducible names
        yield "dae", Seed(re.sub(rb"\d{4}-\d\d-\d\dT[^<]*", b"2000-01-01T00:00:00", mesh.export(file_type="dae")))
        yield "3mf", Seed(repacked({}, scene.export(file_type="3mf")))
    yield "glb", Seed(scene.export(file_type="glb"))
    yield "xyz", Seed("\n".join(" ".join(map(str, row)) for row in mesh.vertices.tolist()).encode())
    files = scene.export(file_type="gltf")
    yield "gltf", Seed(files.pop("model.gltf"), files)
    counts = np.array([len(mesh.vertices), 0, 0, len(mesh.faces)], "<i4").tobytes()
    msh = counts + mesh.vertices.astype("<f4").tobytes() + mesh.faces.astype("<i4").tobytes()
    yield "msh", Seed(msh)
    yield "urdf", Seed(URDF.encode(), {"box.stl": mesh.export(file_type="stl")})
    yield "xml", Seed(MJCF.encode(), {"parts.xml": MJCF_PARTS.encode(), "box.msh": msh})


def written_by_extras(mesh: trimesh.Trimesh) -> Iterator[tuple[str, Seed]]:
    """Write a mesh in the formats of the extras that are installed: Draco, FBX, USD; STEP and IGES files are others."""
    if find_spec("DracoPy"):
        yield "glb", Seed(trimesh.Scene(mesh).export(file_type="glb", extension_draco=True))
    if find_spec("ufbx"):
        model = Model("mesh", mesh.vertices, mesh.faces.tolist(), (1.0, 0.0, 0.0), properties=PIVOTED)
        yield from (("fbx", Seed(fbx([model, replace(model, below=0)], text=text))) for text in (False, True))
    if find_spec("cascadio"):
        yield "step", Seed((CASES / "stand.step").read_bytes())
        yield "igs", Seed((CASES / "ball_inch.igs").read_bytes())
    if not find_spec("pxr"):
        return
    from pxr import Sdf, Usd, UsdGeom, UsdUtils, Vt

    with TemporaryDirectory(prefix="rlacd-fuzz-") as scratch:
        for kind in ("usda", "usdc"):
            path = Path(scratch) / f"mesh.{kind}"
            stage = Usd.Stage.CreateNew(str(path))
            shape = UsdGeom.Mesh.Define(stage, "/top/mesh")
            shape.CreatePointsAttr(Vt.Vec3fArray.FromNumpy(mesh.vertices.astype(np.float32)))
            shape.CreateFaceVertexCountsAttr(Vt.IntArray([3] * len(mesh.faces)))
            shape.CreateFaceVertexIndicesAttr(Vt.IntArray(mesh.faces.ravel().tolist()))
            stage.Save()
            yield kind, Seed(path.read_bytes())
        packed = Path(scratch) / "mesh.usdz"
        UsdUtils.CreateNewUsdzPackage(Sdf.AssetPath(str(path)), str(packed))
        yield "usdz", Seed(packed.read_bytes())


def off_variant(mesh: trimesh.Trimesh, letters: str) -> bytes:
    """Write a mesh as an OFF file, with the vertex data that the letters before its keyword announce."""
    behind = "".join(text for letter, text in OFF_LETTERS.items() if letter in letters)
    lines = [f"{letters}OFF # {mesh.extents}", f"{len(mesh.vertices)} {len(mesh.faces)} 0"]
    lines += [f"{x} {y} {z}{behind}" for x, y, z in mesh.vertices.tolist()]
    lines += [f"3 {a} {b} {c}{' 255 0 0' * ('C' in letters)}" for a, b, c in mesh.faces.tolist()]
    return "\n".join(lines).encode()


@dataclass
class Fuzzer:
    """Makes damaged inputs and decomposes them."""

    seeds: dict[str, list[Seed]]
    seed: int
    folder: Path
    worker: Watched = field(default_factory=lambda: Watched(ProcessLimits(SECONDS, MEMORY), CPU_SECONDS))

    def input(self, number: int) -> tuple[str, Path]:
        """Write the input of a number; returns its format and its file."""
        rng = np.random.default_rng([self.seed, number])
        kind = list(self.seeds)[number % len(self.seeds)]
        seeds = self.seeds[kind]
        seed = seeds[rng.integers(len(seeds))]
        path = self.folder / f"{number}.{kind}"
        seed = damaged(kind, seed, seeds, rng)
        path.write_bytes(seed.content)
        for name, content in seed.beside.items():
            (self.folder / name).write_bytes(content)
        return kind, path

    def result(self, path: Path) -> Row:
        """Return the outcome (see `ENDS`), its message, and the CPU seconds."""
        mesh, options = path, dict(BUDGET)
        if path.suffix == ".npz":
            mesh = path.with_suffix(".stl")
            BOX.export(mesh)
            options["policy"] = str(path)
        try:
            said, files = self.worker.run(JobSpec(options, ending=".obj"), mesh, "mesh", "mesh")
        except WorkerDiedError as error:
            end = {"it needed": "memory", "it took m": "hang"}.get(error.reason[:9], "crash")
            return {"end": end, "said": f"{error.reason} {error.last_words[-300:]}", "cpu": CPU_SECONDS}
        finally:
            if mesh != path:
                mesh.unlink()
        told = str(said.get("error", ""))
        if not told:
            # Of a robot there is a file for each hull.
            read = [hull for name, data in files.items() if name.endswith(".obj") for hull in read_hulls(data, "obj")]
            wrong = "; ".join(f"hull {i}: {why}" for i, hull in enumerate(read) if (why := why_not_convex(*hull)))
            return {"end": "invalid" if wrong else "loaded", "said": wrong, "cpu": said["cpu"]}
        untyped = told.startswith(("a bug in rlacd", "there is not enough memory"))
        return {"end": "untyped" if untyped else "refused", "said": told, "cpu": said["cpu"]}

    def close(self) -> None:
        self.worker.close()


def run(args: argparse.Namespace) -> int:
    chosen = seeds_of(args.meshes)
    if args.formats:
        chosen = {kind: chosen[kind] for kind in args.formats.split(",")}
    tally: dict[str, Counter[str]] = {kind: Counter() for kind in chosen}
    numbers = [args.only] if args.only is not None else count(args.start)
    end = time.monotonic() + 60 * args.minutes
    keep = Path(args.keep) if args.keep else None
    with (
        TemporaryDirectory(prefix="rlacd-fuzz-") as scratch,
        open(args.out or os.devnull, "a", encoding="utf-8") as out,
    ):
        fuzzer = Fuzzer(chosen, args.seed, Path(scratch))
        try:
            for number in numbers:
                if time.monotonic() > end:
                    break
                kind, path = fuzzer.input(number)
                row = {"seed": args.seed, "number": number, "format": kind, **fuzzer.result(path)}
                tally[kind][row["end"]] += 1
                if row["end"] not in WELL or args.only is not None:
                    print(json.dumps(row), flush=True)
                    if keep is not None:
                        shutil.copytree(fuzzer.folder, keep / f"{args.seed}-{number}", dirs_exist_ok=True)
                out.write(json.dumps(row) + "\n")
                out.flush()
                path.unlink()
        finally:
            fuzzer.close()
    print(table(tally))
    return sum(counter[end] for counter in tally.values() for end in counter if end not in WELL)


def minimise(path: Path) -> None:
    """Remove ever smaller pieces as long as a finding ends the same way; the result is written as ``small-…``."""
    content = path.read_bytes()
    with TemporaryDirectory(prefix="rlacd-fuzz-") as scratch:
        fuzzer = Fuzzer({}, 0, Path(scratch))

        def ends(data: bytes) -> str:
            place = Path(scratch) / f"mesh{path.suffix}"
            place.write_bytes(data)
            row = fuzzer.result(place)
            return row["end"] if row["end"] != "untyped" else row["said"].split("(")[1].split(":")[0]

        wanted = ends(content)
        step = len(content) // 2
        while step:
            at = 0
            while at < len(content):
                shorter = content[:at] + content[at + step :]
                if shorter and ends(shorter) == wanted:
                    content = shorter
                else:
                    at += step
            step //= 2
        fuzzer.close()
    path.with_name(f"small-{path.name}").write_bytes(content)
    print(f"{wanted}: {len(content)} bytes\n{content[:2000]!r}")


def table(tally: dict[str, Counter[str]]) -> str:
    """Format the totals as Markdown."""
    lines = ["| format | tried | " + " | ".join(ENDS) + " |", "|---|--:|" + "--:|" * len(ENDS)]
    total: Counter[str] = sum(tally.values(), Counter())
    for kind, counter in [*sorted(tally.items()), ("all", total)]:
        lines.append(f"| {kind} | {counter.total()} | " + " | ".join(str(counter[end]) for end in ENDS) + " |")
    return "\n".join(lines)


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("meshes", nargs="?", type=Path)
    parser.add_argument("--minutes", type=float, default=10.0)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--start", type=int, default=0, help="number of the first input")
    parser.add_argument("--only", type=int, help="number of the only input")
    parser.add_argument("--formats", help="comma-separated; all by default")
    parser.add_argument("--out", type=Path, help="a line of JSON per input is appended to it")
    parser.add_argument("--keep", help="folder for the files that did not end well")
    parser.add_argument("--minimise", type=Path, help="a finding to make small")
    parser.add_argument("--table", type=Path, help="an output to count")
    args = parser.parse_args()
    if args.minimise:
        minimise(args.minimise)
        return 0
    if args.table:
        tally: dict[str, Counter[str]] = {}
        for line in args.table.read_text().splitlines():
            row = json.loads(line)
            tally.setdefault(row["format"], Counter())[row["end"]] += 1
        print(table(tally))
        return 0
    return min(run(args), 1)


if __name__ == "__main__":
    sys.exit(main())
