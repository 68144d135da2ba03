"""Welding cracks looks at few faces; it changes the same as if it looked at all of them."""

from __future__ import annotations

import numpy as np
import pytest
import trimesh
from hypothesis import given, settings
from hypothesis import strategies as st

from rlacd import _native
from rlacd.repair.cracks import close_cracks, free_edges, split_at_free_vertices, weld_free_vertices
from rlacd.solid.arrays import FloatArray
from rlacd.solid.topology import Edges, IntArray, first_of_doubled, nondegenerate

TOLERANCES = (2e-5, 5e-4)


def closed_globally(vertices: FloatArray, faces: IntArray) -> tuple[IntArray, IntArray]:
    """The definition: every step on all faces."""
    everywhere = np.ones(len(vertices), dtype=bool)

    def free(some: IntArray) -> IntArray:
        return free_edges(some, Edges.of(some, len(vertices)))

    origin = np.arange(len(faces))
    for tolerance in TOLERANCES:
        if len(free(faces)) == 0:
            break
        welded = weld_free_vertices(vertices, faces, free(faces), tolerance)
        split, parent, _ = split_at_free_vertices(vertices, welded, everywhere, tolerance)
        keep = nondegenerate(split)
        keep[keep] = first_of_doubled(split[keep], len(vertices))
        if len(free(split[keep])) < len(free(faces)) and keep.any():
            faces, origin = split[keep], origin[parent[keep]]
    return faces, origin


def cracked(mesh: trimesh.Trimesh, seed: int, cut: float, missing: float) -> tuple[FloatArray, IntArray]:
    """Some faces get corners of their own, a little away; some are split on one side only; some are missing."""
    rng = np.random.default_rng(seed)
    faces = np.array(mesh.faces, dtype=np.int64)
    vertices = np.array(mesh.vertices)
    apart = np.flatnonzero(rng.random(len(faces)) < cut)
    own = vertices[faces[apart]].reshape(-1, 3)
    own = own + rng.choice([0, 1e-5, 3e-4, 2e-3], (len(own), 1)) * rng.normal(size=own.shape)
    faces[apart] = len(vertices) + np.arange(len(own)).reshape(-1, 3)
    vertices = np.concatenate([vertices, own])
    whole = np.flatnonzero(rng.random(len(faces)) < cut)
    a, b, c = faces[whole].T
    middle = len(vertices) + np.arange(len(whole))
    vertices = np.concatenate([vertices, (vertices[a] + vertices[b]) / 2])
    faces[whole] = np.stack([a, middle, c], axis=1)
    faces = np.concatenate([faces, np.stack([middle, b, c], axis=1)])
    faces = faces[rng.random(len(faces)) >= missing]
    points, welded, _ = _native.weld(vertices, rng.permutation(faces))
    return points, welded.astype(np.int64)


@settings(max_examples=60, deadline=None)
@given(st.integers(0, 2**32), st.sampled_from([0.0, 0.02, 0.3, 1.0]), st.sampled_from([0.0, 0.03, 0.5]))
def test_only_faces_beside_free_edges_matter(seed: int, cut: float, missing: float) -> None:
    vertices, faces = cracked(trimesh.creation.icosphere(2), seed, cut, missing)
    if len(faces) == 0:
        return
    found, origin = close_cracks(vertices, faces, Edges.of(faces, len(vertices)), TOLERANCES)
    expected, expected_origin = closed_globally(vertices, faces)
    assert np.array_equal(found, expected)
    assert np.array_equal(origin, expected_origin)


def test_an_edge_that_a_weld_leaves_free_counts() -> None:
    """Two faces become one when a and b are welded: their other edge, from p to q, is free from then on."""
    a, b, p, q, c, d, e, f = range(8)
    pocket = [(0, 0, 0), (0, 0, 1e-6), (1, 0, 0), (1, 3e-4, 0), (0.5, -1, 0), (0.5, -1, 1), (0.5, 1, 0), (0.5, 1, 1)]
    around_p, around_q = [(p, q, a), (p, a, c), (p, c, d), (p, d, b), (p, b, q)], [(q, b, e), (q, e, f), (q, f, a)]
    crack = [(5, 0, 0), (5, 1, 0), (6, 0, 0), (5, 0, 1e-6), (5, 1, 1e-6), (4, 0, 0)]  # closes at the same time
    vertices = np.array(pocket + crack, dtype=float)
    faces = np.array([*around_p, *around_q, (8, 9, 10), (12, 11, 13)])
    found, origin = close_cracks(vertices, faces, Edges.of(faces, len(vertices)), TOLERANCES)
    assert p in found
    assert q not in found
    expected = closed_globally(vertices, faces)
    assert np.array_equal(found, expected[0])
    assert np.array_equal(origin, expected[1])


@pytest.mark.parametrize("seed", range(3))
def test_cracks_are_closed(seed: int) -> None:
    ball = trimesh.creation.icosphere(3)
    vertices, faces = cracked(ball, seed, 0.05, 0.0)
    before = len(free_edges(faces, Edges.of(faces, len(vertices))))
    found, _ = close_cracks(vertices, faces, Edges.of(faces, len(vertices)), (*TOLERANCES, 2e-2))
    left = len(free_edges(found, Edges.of(found, len(vertices))))
    assert left < before / 4
