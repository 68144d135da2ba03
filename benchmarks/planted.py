"""Solids that were made of k convex bodies: how many hulls they take, and how much the hulls add."""

from __future__ import annotations

import statistics
import warnings
from collections.abc import Callable, Iterator
from typing import Any

import click
import numpy as np
import trimesh
from manifold3d import Manifold, Mesh64, OpType
from numpy.typing import NDArray

import rlacd

Points = NDArray[np.float64]
Bodies = list[Points]


def box(lower: tuple[float, float, float], upper: tuple[float, float, float]) -> Points:
    """The corners [8, 3] of a box."""
    return np.array(
        [[x, y, z] for x in (lower[0], upper[0]) for y in (lower[1], upper[1]) for z in (lower[2], upper[2])]
    )


UNIT = box((-1, -1, -1), (1, 1, 1))


def turned(points: Points, rng: np.random.Generator) -> Points:
    """Points [N, 3] turned at random."""
    q, _ = np.linalg.qr(rng.normal(size=(3, 3)))
    return np.asarray(points @ (q * np.sign(np.linalg.det(q))))


def shelf(rng: np.random.Generator, k: int) -> Bodies:
    """Two sides, a back and boards between them."""
    thick = rng.uniform(0.01, 0.04)
    sides = [box((0, 0, 0), (thick, 0.3, 1.2)), box((0.8 - thick, 0, 0), (0.8, 0.3, 1.2))]
    boards = [box((0, 0, z), (0.8, 0.3, z + thick)) for z in np.linspace(0, 1.2 - thick, k - 3)]
    return [*sides, box((0, 0, 0), (0.8, thick, 1.2)), *boards]


def table(rng: np.random.Generator, k: int) -> Bodies:
    """A board on legs."""
    leg = rng.uniform(0.04, 0.1)
    legs = [box((x, y, 0), (x + leg, y + leg, 0.71)) for x in np.linspace(0.03, 1.1, (k - 1) // 2) for y in (0.03, 0.6)]
    return [box((0, 0, 0.7), (1.2, 0.74, 0.74)), *legs]


def stairs(rng: np.random.Generator, k: int) -> Bodies:
    """Steps that stand on the ground."""
    return [box((i, 0, 0), (i + 1, rng.uniform(2, 5), (i + 1) * 0.7)) for i in range(k)]


def comb(rng: np.random.Generator, k: int) -> Bodies:
    """Teeth on a bar."""
    teeth = [box((2 * i, 0, 0), (2 * i + rng.uniform(0.5, 1), 1, rng.uniform(3, 6))) for i in range(k - 1)]
    return [box((0, 0, -1), (2 * k, 1, 0.5)), *teeth]


def boxes(rng: np.random.Generator, k: int) -> Bodies:
    """Boxes along the axes that cross."""
    sizes = [np.array([rng.uniform(0.3, 0.9), rng.uniform(0.05, 0.35), rng.uniform(0.05, 0.25)]) for _ in range(k)]
    return [UNIT * size[rng.permutation(3)] + rng.uniform(-0.6, 0.6, 3) for size in sizes]


def bars(rng: np.random.Generator, k: int) -> Bodies:
    """Bars in all directions that cross."""
    sizes = [[rng.uniform(0.5, 1), rng.uniform(0.06, 0.12), rng.uniform(0.06, 0.12)] for _ in range(k)]
    return [turned(UNIT * size, rng) + rng.uniform(-0.45, 0.45, 3) for size in sizes]


def rods(rng: np.random.Generator, k: int) -> Bodies:
    """Rods of sixteen sides that cross."""
    angle = np.arange(16) * np.pi / 8
    ring = np.stack([np.cos(angle), np.sin(angle)], axis=1)

    def rod() -> Points:
        around, end = rng.uniform(0.07, 0.14) * ring, rng.uniform(0.4, 0.9)
        ends = [np.column_stack([around, np.full(16, z)]) for z in (-end, end)]
        return turned(np.concatenate(ends), rng) + rng.uniform(-0.45, 0.45, 3)

    return [rod() for _ in range(k)]


def blobs(rng: np.random.Generator, k: int) -> Bodies:
    """Ellipsoids that cross."""

    def blob() -> Points:
        points = rng.normal(size=(60, 3))
        points /= np.linalg.norm(points, axis=1)[:, None]
        return turned(points * rng.uniform(0.15, 0.5, 3), rng) + rng.uniform(-0.7, 0.7, 3)

    return [blob() for _ in range(k)]


KINDS: tuple[Callable[[np.random.Generator, int], Bodies], ...] = (shelf, table, stairs, comb, boxes, bars, rods, blobs)


def planted(k: int, seed: int) -> Iterator[tuple[str, Manifold, int]]:
    """A solid of each kind, turned at random: its name, the solid, and the number of its bodies."""
    for kind in KINDS:
        rng = np.random.default_rng((seed, k))
        bodies = kind(rng, k)
        middle = turned(np.concatenate(bodies), rng)
        parts = np.split(middle, np.cumsum([len(body) for body in bodies])[:-1])
        hulls = [Manifold.hull_points(np.ascontiguousarray(part)) for part in parts]
        yield kind.__name__, Manifold.batch_boolean(hulls, OpType.Add), len(bodies)


@click.command()
@click.option("--quality", type=click.Choice(["fast", "balanced", "best"]), default="balanced", show_default=True)
@click.option("--threshold", "-t", default=0.05, show_default=True)
@click.option("--seeds", default=3, show_default=True, help="Solids of each kind and number.")
def app(quality: Any, threshold: float, seeds: int) -> None:
    """Solids made of k convex bodies, flush or crossing: hulls / k, and the volume of the hulls' union / the solid's.

    The last line holds geometric means.
    """
    rows: dict[str, list[tuple[float, float]]] = {}
    for k in (5, 9, 16):
        for seed in range(seeds):
            for name, solid, bodies in planted(k, seed):
                mesh = solid.to_mesh64()
                with warnings.catch_warnings():
                    warnings.simplefilter("ignore")
                    hulls = rlacd.decompose(
                        trimesh.Trimesh(mesh.vert_properties[:, :3], mesh.tri_verts, process=False),
                        threshold=threshold,
                        quality=quality,
                    ).hulls
                own = [Manifold(Mesh64(hull.vertices, hull.faces.astype(np.uint64))) for hull in hulls]
                added = Manifold.batch_boolean(own, OpType.Add).volume() / solid.volume()
                rows.setdefault(name, []).append((len(hulls) / bodies, added))
    click.echo(f"{'kind':8} {'hulls / k':>9} {'union / solid':>13}")
    for name, found in [*rows.items(), ("all", [pair for some in rows.values() for pair in some])]:
        hulls_of_k, union = (statistics.geometric_mean(column) for column in zip(*found, strict=True))
        click.echo(f"{name:8} {hulls_of_k:9.3f} {union:13.3f}")
