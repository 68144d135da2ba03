"""How much of a hull a solid fills: what a boolean finds, whatever touches, overlaps or coincides."""

from __future__ import annotations

import itertools
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import trimesh
from hypothesis import given, settings
from hypothesis import strategies as st
from manifold3d import Manifold, OpType

from rlacd import _native
from rlacd.io.read.load import load_mesh
from rlacd.repair.repair import repair
from rlacd.solid.component import Component, Plane
from rlacd.solid.hull import Hull
from rlacd.solid.manifold import to_manifold
from tests.shapes import block, component_of

GROWN = 3.1e-8
"""The result may be larger by this share of the hull's volume."""

LAST_BITS = 1e-13


def against_of(solid: Component) -> _native.Against:
    return _native.Against(solid.vertices, solid.faces)


def boolean(solid: Any, hull: Hull) -> float:
    return float((solid ^ to_manifold(hull.vertices, hull.faces)).volume())


def holds(found: float, volume: float, hull: Hull) -> bool:
    """Whether a result is the volume, or that of a hull which is larger by a hair."""
    return -LAST_BITS - 1e-12 * volume <= found - volume <= GROWN * hull.volume + LAST_BITS


def hulls_near(points: np.ndarray, random: np.random.Generator, count: int) -> Iterator[Hull]:
    """Hulls of the points, whose facets touch the solid's faces; of grid points; of any points near one of them."""
    for size in random.integers(4, 40, size=count).tolist():
        near = points[random.integers(len(points))]
        for corners in (
            points[random.integers(len(points), size=size)],
            random.integers(-4, 5, size=(size, 3)) / 2,
            near + 10 ** random.uniform(-3, 0) * random.normal(size=(size, 3)),
        ):
            hull = Hull.of(corners)
            if hull is not None:
                yield hull


def plane_through(solid: Component, random: np.random.Generator) -> Plane:
    """A plane along an axis, in a face or through a corner."""
    triangle = solid.vertices[solid.faces[random.integers(len(solid.faces))]]
    normals = np.eye(3)[random.integers(3)], np.cross(triangle[1] - triangle[0], triangle[2] - triangle[0])
    normal = (*normals, random.normal(size=3))[random.integers(3)]
    length = np.linalg.norm(normal)
    normal = normal / length if length > 1e-9 else np.eye(3)[2]
    return Plane((*normal.tolist(),), float(normal @ triangle[0] + random.choice([0, 0.05]) * random.normal()))


def pieces_of(solid: Component, random: np.random.Generator, cuts: int) -> list[Component]:
    pieces = solid.pieces()
    for _ in range(cuts):
        piece = pieces.pop(random.integers(len(pieces)))
        pieces += [one for side in piece.cut(plane_through(piece, random)) if side is not None for one in side.pieces()]
    return pieces


def hulls_of_pieces(pieces: list[Component]) -> Iterable[tuple[Hull, float]]:
    """The hulls of the pieces and the joint hulls of two of them, with the volume that they hold at least."""
    yield from ((piece.hull, piece.volume) for piece in pieces)
    for a, b in itertools.combinations(pieces[:6], 2):
        yield Hull.around(a.hull, b.hull), a.volume + b.volume


def solids() -> dict[str, Component]:
    bumpy = trimesh.creation.icosphere(subdivisions=4)
    bumpy.vertices *= 1 + 0.1 * np.random.default_rng(0).normal(size=(len(bumpy.vertices), 1))
    steps = [block(0.5, 1, 0.5, (0.5 * i, 0, 0.5 * i)) for i in range(-2, 3)]
    return {
        "box": Component(block(1, 2, 3)),
        "ring": component_of(trimesh.creation.torus(0.7, 0.25, 64, 32)),
        "bumpy ball": component_of(bumpy),
        "hollow box": Component(block(2, 2, 2) - block(1.5, 1.5, 1.5)),
        "two boxes": Component(block(0.9, 1, 1) + block(1, 1, 1, (1, 0, 0))),
        "steps": Component(Manifold.batch_boolean(steps, OpType.Add)),
        "shell": Component(Manifold.sphere(1, 64) - Manifold.sphere(0.999, 64)),
        "sheet with holes": Component(block(2, 2, 1e-3) - block(1, 0.5, 1) - block(0.25, 1, 1, (0.5, 0.5, 0))),
    }


@pytest.mark.parametrize("name", solids())
def test_it_is_the_volume_of_a_boolean(name: str) -> None:
    solid, random = solids()[name], np.random.default_rng(1)
    against, whole = against_of(solid), to_manifold(solid.vertices, solid.faces)
    for hull in hulls_near(solid.vertices, random, 25):
        assert holds(against.filled(hull.body), boolean(whole, hull), hull)


@pytest.mark.parametrize("name", solids())
def test_hulls_of_pieces_hold_their_pieces(name: str) -> None:
    """Their corners and facets lie on the solid's."""
    solid = solids()[name]
    against, whole = against_of(solid), to_manifold(solid.vertices, solid.faces)
    pieces = pieces_of(solid, np.random.default_rng(2), 8)
    for hull, least in hulls_of_pieces(pieces):
        found = against.filled(hull.body)
        assert found >= (1 - 1e-9) * least - LAST_BITS
        assert holds(found, boolean(whole, hull), hull)


@settings(deadline=None, max_examples=40)
@given(st.integers(0, 10**6))
def test_heaps_of_blocks_whose_faces_coincide(seed: int) -> None:
    random = np.random.default_rng(seed)
    sizes, places = random.integers(1, 5, size=(6, 3)) / 4, random.integers(-3, 4, size=(6, 3)) / 4
    blocks = [block(*size, tuple(place)) for size, place in zip(sizes.tolist(), places.tolist(), strict=True)]
    solid = Component(Manifold.batch_boolean(blocks, OpType.Add))
    against, whole = against_of(solid), to_manifold(solid.vertices, solid.faces)
    hulls = [hull for hull, _ in hulls_of_pieces(pieces_of(solid, random, 4))]
    for hull in (*hulls, *hulls_near(solid.vertices, random, 4)):
        assert holds(against.filled(hull.body), boolean(whole, hull), hull)


@settings(deadline=None, max_examples=30)
@given(st.integers(0, 10**6))
def test_bodies_that_touch_or_overlap_count_one_by_one(seed: int) -> None:
    """Boxes on a grid, not united: faces lie on each other, edges and corners meet."""
    random = np.random.default_rng(seed)
    bodies = [Component(block(1, 1, 1, tuple(place))) for place in (random.integers(-2, 3, size=(5, 3)) / 2).tolist()]
    meshes = [trimesh.Trimesh(body.vertices, body.faces, process=False) for body in bodies]
    together = against_of(component_of(trimesh.util.concatenate(meshes)))
    corners = np.concatenate([body.vertices for body in bodies])
    for hull in (*(body.hull for body in bodies), *hulls_near(corners, random, 6)):
        own = sum(against_of(body).filled(hull.body) for body in bodies)
        assert together.filled(hull.body) == pytest.approx(min(own, hull.volume), rel=1e-9, abs=1e-7 * hull.volume)


@settings(deadline=None, max_examples=30)
@given(st.integers(0, 10**6), st.floats(-3, 3))
def test_turned_and_scaled_copies_agree(seed: int, exponent: float) -> None:
    random, scale = np.random.default_rng(seed), 10**exponent
    turn = np.linalg.qr(random.normal(size=(3, 3)))[0]
    turn *= np.sign(np.linalg.det(turn))
    solid = solids()["steps"]
    turned = _native.Against(np.ascontiguousarray(scale * solid.vertices @ turn.T), solid.faces)
    for hull, _ in hulls_of_pieces(pieces_of(solid, random, 3)):
        own = against_of(solid).filled(hull.body)
        body = _native.ConvexBody(np.ascontiguousarray(scale * hull.vertices @ turn.T), hull.faces)
        assert turned.filled(body) / scale**3 == pytest.approx(own, abs=GROWN * hull.volume + LAST_BITS)


def test_what_is_inside_is_full_and_what_is_outside_empty() -> None:
    against = against_of(solids()["hollow box"])
    for at, volume in (((0, 0, 0), 0), ((0.875, 0, 0), 1e-3), ((0, 0.8, 0.8), 1e-3), ((0, 0, 5), 0)):
        hull = Component(block(0.1, 0.1, 0.1, at)).hull
        assert against.filled(hull.body) == pytest.approx(volume, rel=1e-12, abs=1e-18)


@pytest.mark.parametrize("name", ["vhacd/bunny", "gazebo_models/mars_rover__rover", "ikea_assembled/table_benno_0141"])
def test_real_solids(corpus: Path, name: str) -> None:
    solid, random = (
        Component(repair(load_mesh(corpus / f"test/{name}.ply"), threads=1).manifold),
        np.random.default_rng(4),
    )
    against, whole = against_of(solid), to_manifold(solid.vertices, solid.faces)
    pieces = [piece for piece in pieces_of(solid, random, 12) if piece.volume > 1e-9]
    for hull, least in hulls_of_pieces(pieces):
        found = against.filled(hull.body)
        assert found >= (1 - 1e-9) * least - LAST_BITS
        assert found == pytest.approx(boolean(whole, hull), abs=1e-7 * hull.volume)
