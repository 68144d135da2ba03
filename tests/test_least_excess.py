"""The plane of least excess against a sweep of all planes."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from manifold3d import Manifold

from rlacd import _native
from rlacd.planes.candidates import Candidates, axis_and_principal
from rlacd.planes.sweep import SLIVER, SLIVERS, TIE, Sweep, SweepCache, least_excess, sweep
from rlacd.policies import SCORES
from rlacd.policies.greedy import excess_norm, hull_sum
from rlacd.solid.arrays import FloatArray, IntArray
from rlacd.solid.component import Component, Plane
from tests.test_sweep import SOLIDS, crowded_pyramid, finned_tetrahedron, gear

EXPONENTS = {"hull_sum": 1.0, "max_excess": math.inf, "excess_norm": SCORES["excess-norm"]}
COSTS = {"hull_sum": hull_sum, "max_excess": lambda swept: excess_cost(swept, math.inf), "excess_norm": excess_norm}


def excess_cost(swept: Sweep, exponent: float) -> FloatArray:
    below = np.maximum(swept.hull_below - swept.solid_below, 0)
    above = np.maximum(swept.hull_above - swept.solid_above, 0)
    return np.maximum(below, above) if math.isinf(exponent) else below**exponent + above**exponent


def cheapest(scored: Sweep, cost: FloatArray) -> Plane | None:
    """The first of the valid planes of least cost; those that leave slivers only if there is no other."""
    for sliver in SLIVERS:
        valid = scored.valid(sliver)
        if valid.any():
            equal = cost[valid].min() + TIE * cost[valid].max()
            return scored.candidates.plane(int(np.argmax(valid & (cost <= equal))))
    return None


@pytest.mark.parametrize("score", EXPONENTS)
@pytest.mark.parametrize("name", SOLIDS)
def test_it_is_the_plane_that_a_sweep_of_all_finds(name: str, score: str) -> None:
    component = Component(SOLIDS[name]())
    sweeps = SweepCache()
    swept = sweeps.of(component)
    found = least_excess(component, sweeps.candidates(component), EXPONENTS[score])
    assert found is not None
    assert found == cheapest(swept, COSTS[score](swept))


@pytest.mark.parametrize("solid", [crowded_pyramid(12), crowded_pyramid(40), finned_tetrahedron()])
def test_it_is_so_where_the_mesh_is_degenerate(solid: tuple[FloatArray, IntArray]) -> None:
    component = Component(solid)
    candidates = axis_and_principal(component)
    swept = sweep(component, candidates)
    assert least_excess(component, candidates, EXPONENTS["excess_norm"]) == cheapest(swept, excess_norm(swept))


@st.composite
def blocks_and_planes(draw: st.DrawFn) -> tuple[Component, Candidates]:
    """A few blocks with corners on a coarse grid, and planes on it and off it: many meet faces, some miss the solid."""
    grid = st.integers(0, 6)
    solid = Manifold()
    for _ in range(draw(st.integers(1, 4))):
        corner = [draw(grid) / 4 for _ in range(3)]
        solid += Manifold.cube([draw(st.integers(1, 4)) / 4 for _ in range(3)]).translate(corner)
    if draw(st.booleans()):
        solid = solid.rotate((0, 0, 45)) + Manifold.sphere(draw(st.integers(1, 3)) / 4, 12)
    directions, offsets = [], []
    for _ in range(draw(st.integers(1, 8))):
        normal = np.array([draw(st.integers(-2, 2)) for _ in range(3)], dtype=np.float64)
        if not normal.any():
            normal[2] = 1
        directions.append(normal / np.linalg.norm(normal))
        offsets.append(sorted(draw(st.lists(st.integers(-4, 12).map(lambda i: i / 4), min_size=5, max_size=5))))
    return Component(solid), Candidates(np.array(directions) + 0.0, np.array(offsets))


@settings(max_examples=150, deadline=None)
@given(blocks_and_planes(), st.sampled_from([1.0, 1.3, 2.0, math.inf]))
def test_no_valid_plane_costs_less(case: tuple[Component, Candidates], exponent: float) -> None:
    component, candidates = case
    swept = sweep(component, candidates)
    valid = next((v for s in (SLIVER, SLIVER / 100) if (v := swept.valid(s)).any()), None)
    found = least_excess(component, candidates, exponent)
    if valid is None:
        assert found is None
        return
    assert found is not None
    cost = excess_cost(swept, exponent)
    chosen = next(i for i in np.flatnonzero(valid) if candidates.plane(int(i)) == found)
    # Excesses are differences of volumes: those of nearly convex solids are nothing but rounding.
    rounding = 1e-12 * component.hull.volume
    rounding = rounding if math.isinf(exponent) else exponent * component.hull.volume ** (exponent - 1) * rounding
    most = component.hull.volume - (0 if exponent == 1 else component.volume)
    tie = 1e-9 * max(most, 0.0) ** (1 if math.isinf(exponent) else exponent)
    assert cost[chosen] <= cost[valid].min() + tie + rounding


def test_the_first_of_equal_planes_is_taken() -> None:
    solid = Component(gear() + gear().translate((4, 0, 0)).mirror((1, 0, 0)).translate((4, 0, 0)))
    waist = 0.5 * (solid.box[0, 0] + solid.box[1, 0])
    for shift in (0.3, -0.3):  # the solid is symmetric about its waist
        candidates = Candidates(np.eye(3)[[0, 0]], np.array([[waist + shift], [waist - shift]]))
        assert least_excess(solid, candidates, 1.3) == Plane((1.0, 0.0, 0.0), waist + shift)


def test_slivers_are_left_only_where_every_plane_leaves_one() -> None:
    notched = Component(Manifold.cube((4, 4, 1)) - Manifold.cube((1, 1, 0.02)))
    shaving, middle = Candidates(np.eye(3)[2:], np.array([[0.02]])), Candidates(np.eye(3)[2:], np.array([[0.02, 0.5]]))
    plane = least_excess(notched, shaving, 1.0)
    assert plane.offset == 0.02, "nothing else is left"
    plane = least_excess(notched, middle, 1.0)
    assert plane.offset == 0.5, "the notch is not worth a film"
    assert least_excess(notched, Candidates(np.eye(3)[2:], np.array([[-1.0, 0.0, 1.0, 7.0]])), 1.0) is None


def test_no_planes_no_choice() -> None:
    assert least_excess(Component(gear()), Candidates(np.zeros((0, 3)), np.zeros((0, 1))), 1.0) is None


def ask(vertices: FloatArray, offsets: list[float], exponent: float = 1.3, tie: float = 0.0) -> int:
    faces = Component(gear()).faces
    return _native.find_least_excess(
        vertices, faces, np.eye(3)[:1], np.array([offsets]), exponent, tie, 1e-11, [SLIVER], 1
    )


def test_what_makes_no_sense_is_refused() -> None:
    vertices = Component(gear()).vertices
    assert ask(vertices, [0.1, 0.2]) in (0, 1)
    with pytest.raises(ValueError, match="finite and ascend"):
        ask(vertices, [0.5, 0.2])
    with pytest.raises(ValueError, match="finite and ascend"):
        ask(vertices, [0.2, math.nan])
    with pytest.raises(ValueError, match="exponent"):
        ask(vertices, [0.2], exponent=0.9)
    with pytest.raises(ValueError, match="exponent"):
        ask(vertices, [0.2], exponent=math.nan)
    with pytest.raises(ValueError, match="tie"):
        ask(vertices, [0.2], tie=-1.0)
    with pytest.raises(ValueError, match="not finite"):
        ask(np.where(vertices == vertices.max(), np.nan, vertices), [0.2])
