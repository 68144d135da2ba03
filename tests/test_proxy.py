"""Dense solids are decomposed through a simpler copy; what is promised holds for the solid itself."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np
import pytest
import trimesh

import rlacd
from rlacd import _native
from rlacd.criteria import Concavity
from rlacd.planes.sweep import SweepCache
from rlacd.policies import make_policy
from rlacd.proxy.model import Transfer
from rlacd.proxy.simplify import simplify
from rlacd.repair.union import unite
from rlacd.run import Run
from rlacd.solid.component import Component, Part
from rlacd.solid.distance import hull_union
from rlacd.solid.frame import Frame
from rlacd.solid.hull import Hull
from rlacd.solid.manifold import to_manifold
from rlacd.solid.solid import Shape
from tests.shapes import box, component_of, trimesh_of


def noisy(mesh: trimesh.Trimesh, noise: float = 0.001) -> trimesh.Trimesh:
    """A shape about 2 long, with its vertices moved along their normals."""
    mesh = mesh.copy()
    mesh.apply_scale(2 / max(mesh.extents))
    shift = np.random.default_rng(0).normal(0, noise, (len(mesh.vertices), 1))
    return trimesh.Trimesh(mesh.vertices + shift * mesh.vertex_normals, mesh.faces, process=False)


def ring() -> trimesh.Trimesh:
    return noisy(trimesh.creation.torus(1.0, 0.3, 120, 60))


def bars() -> trimesh.Trimesh:
    return trimesh_of(box((-1, -0.15, -0.15), (1, 0.15, 0.15)) + box((-0.15, -1, -0.15), (0.15, 1, 0.15)))


def cross() -> trimesh.Trimesh:
    united = bars()
    return noisy(trimesh.Trimesh(*trimesh.remesh.subdivide_to_size(united.vertices, united.faces, 0.04)))


def bricks(count: int, edge: float) -> trimesh.Trimesh:
    """A bar of bricks with their own noise: slits full of bridges between walls that would coincide without it."""
    row = []
    for number in range(count):
        brick = trimesh.creation.box((2 / count, 0.4, 0.4))
        brick.apply_translation((2 * number / count, 0, 0))
        dense = trimesh.Trimesh(*trimesh.remesh.subdivide_to_size(brick.vertices, brick.faces, edge))
        shift = np.random.default_rng(number).normal(0, 0.001, (len(dense.vertices), 1))
        row.append(trimesh.Trimesh(dense.vertices + shift * dense.vertex_normals, dense.faces, process=False))
    return trimesh.util.concatenate(row)


SHAPES = {"ring": ring, "cross": cross}


def in_frame(hulls: Iterable[trimesh.Trimesh], mesh: trimesh.Trimesh) -> list[Hull]:
    return [Hull.of(Frame.of(mesh.vertices).to_frame(hull.vertices)) for hull in hulls]


def uncovered(hulls: Iterable[trimesh.Trimesh], mesh: trimesh.Trimesh) -> float:
    """How far some of the mesh is from the hulls, at most, in the frame."""
    vertices = Frame.of(mesh.vertices).to_frame(mesh.vertices)
    return hull_union(in_frame(hulls, mesh), 1).under(vertices, np.array(mesh.faces, dtype=np.int32), 1e-4, 1)[1]


@pytest.mark.parametrize("shape", SHAPES)
@pytest.mark.parametrize("quality", ["fast", "balanced"])
@pytest.mark.promise("dense")
def test_promises_hold_on_the_solid_itself(shape: str, quality: rlacd.QualityName) -> None:
    mesh = SHAPES[shape]()
    result = rlacd.decompose(mesh, quality=quality)
    assert "transfer" in result.report.seconds
    assert not result.report.warnings
    assert result.report.concavity.max <= 0.05
    assert uncovered(result, mesh) <= 1e-3
    solid = Component((Frame.of(mesh.vertices).to_frame(mesh.vertices), np.array(mesh.faces, dtype=np.int32)))
    for hull in in_frame(result, mesh):
        assert Concavity(0.0501).is_met(Part(hull, (), solid))


def test_a_part_without_room_below_the_threshold_keeps_its_own_hull() -> None:
    """A simplified hull that grows to the noise would break the criterion, which the solid's own hull just meets."""
    shape = trimesh.creation.box((2, 1, 1))
    solid = component_of(noisy(trimesh.Trimesh(*trimesh.remesh.subdivide_to_size(shape.vertices, shape.faces, 0.05))))
    proxy = simplify(solid, 0.05)
    broken, met = 0.0, 0.1
    while met - broken > 1e-6:
        middle = (broken + met) / 2
        broken, met = (broken, middle) if Concavity(middle).is_met(solid) else (middle, met)
    goal, policy = Concavity(met), make_policy("greedy", SweepCache(), None)
    transfer = Transfer(solid, proxy, goal, policy, Run(1))
    (part,), _ = transfer([proxy.component])
    assert goal.is_met(part)
    assert hull_union([part.hull], 1).distance(solid.vertices, 1).max() <= 1e-9


@pytest.mark.parametrize("shape", SHAPES)
def test_noise_and_density_cost_hardly_any_parts(shape: str) -> None:
    dense = SHAPES[shape]()
    plain = {"ring": trimesh.creation.torus(1.0, 0.3, 32, 16), "cross": bars()}[shape]
    assert "transfer" not in rlacd.decompose(plain, quality="fast").report.seconds, "it is decomposed as it is"
    assert len(rlacd.decompose(dense, quality="fast")) <= len(rlacd.decompose(plain, quality="fast")) + 1


def test_noisy_walls_of_bodies_that_touch_need_no_cuts() -> None:
    mesh = bricks(4, 0.03)
    result = rlacd.decompose(mesh, quality="fast")
    assert len(result) == 1
    assert not result.report.warnings
    assert result.report.hausdorff.added <= 0.012  # a bar that is noisy in one piece: 0.010


@pytest.mark.slow
def test_limits_hold_and_are_met_by_the_threshold() -> None:
    result = rlacd.decompose(ring(), quality="fast", max_vertices=32)
    assert max(len(hull.vertices) for hull in result) <= 32
    assert result.report.concavity.max <= 0.05
    assert not result.report.warnings
    few = rlacd.decompose(ring(), quality="fast", max_hulls=3)
    assert len(few) <= 3
    assert few.report.hausdorff.missed <= 1e-3


@pytest.mark.slow
@pytest.mark.promise("dense")
def test_stopped_at_any_time_the_hulls_cover_the_solid() -> None:
    mesh = ring()
    for stage in ("simplify", "cut", "merge", "transfer"):
        result = rlacd.decompose(mesh, progress=lambda p, stage=stage: p.stage != stage)
        assert not result.report.complete
        assert uncovered(result, mesh) <= 1e-3


def test_simplifying_gives_the_same_bytes_every_time_and_for_any_number_of_threads() -> None:
    mesh = noisy(trimesh.creation.torus(1.0, 0.3, 200, 100))  # large enough for sweeps, and for several threads
    found = []
    for threads in (1, 1, 3):
        simplifier = _native.Simplifier(np.array(mesh.vertices), np.array(mesh.faces, dtype=np.int32))
        simplifier.reduce(500, threads)
        found.append(simplifier.mesh())
    assert len({vertices.tobytes() for vertices, _ in found}) == 1
    simple = trimesh.Trimesh(*found[0], process=False)
    assert len(simple.faces) <= 500
    assert simple.is_watertight
    assert simple.euler_number == 0


def test_simple_hulls_hold_the_full_ones_and_have_fewer_corners() -> None:
    mesh = trimesh.creation.capsule(height=2, radius=1, count=[32, 32])
    mesh.vertices *= 1 - 1e-3 * (np.arange(len(mesh.vertices)) % 3 == 0)[:, None]  # dents: no hull is full of it
    simple, full = (rlacd.decompose(mesh, quality="fast", detail=detail) for detail in ("simple", "full"))
    assert len(simple) == len(full) == 1
    assert len(simple.hulls[0].vertices) < 0.8 * len(full.hulls[0].vertices)
    assert (simple.hulls[0].volume, full.hulls[0].volume) == (
        pytest.approx(mesh.volume, rel=0.03),
        pytest.approx(mesh.convex_hull.volume),
    )
    (held,) = in_frame(full, mesh)
    assert hull_union(in_frame(simple, mesh), 1).distance(held.vertices, 1).max() <= 1e-9
    assert simple.report.concavity.max <= 0.05


def test_pieces_make_a_proxy_of_a_union_full_of_tunnels() -> None:
    """As if repair had not filled the slits between the bricks."""
    mesh = bricks(4, 0.03)
    pieces: list[Shape] = [
        to_manifold(np.array(brick.vertices), np.array(brick.faces)) for brick in mesh.split(only_watertight=False)
    ]
    solid = Component(unite(pieces))
    tunnels = 1 - (len(solid.vertices) - len(solid.faces) // 2) // 2
    assert tunnels > 20
    without, proxy = simplify(solid, 0.05), simplify(solid, 0.05, pieces=pieces)
    assert len(proxy.component.faces) < 500
    assert without is None or len(without.component.faces) > 10 * len(proxy.component.faces)
    simple = trimesh.Trimesh(proxy.component.vertices, proxy.component.faces, process=False)
    assert simple.is_watertight
    assert simple.volume == pytest.approx(solid.volume, rel=0.01)
    surface, corners = _native.Surface(solid.vertices, solid.faces), proxy.component.vertices
    assert surface.distance(corners[surface.winding(corners) < 0.5], 1).max() <= 0.005
