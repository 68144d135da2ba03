"""Cutting by a plane and clipping to a hull: closed, nothing lost, no triangles piling up, whatever touches it."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import trimesh
from hypothesis import given, settings
from hypothesis import strategies as st
from manifold3d import CrossSection, Manifold, Mesh64, OpType

from rlacd import _native
from rlacd.io.read.load import load_mesh
from rlacd.repair.repair import repair
from rlacd.solid.component import Component, Plane
from rlacd.solid.hull import Hull
from rlacd.solid.manifold import to_manifold
from tests.hulls import hull_of
from tests.shapes import block, component_of, is_closed

LAST_BITS = 1e-12


def sides_of(component: Component, plane: Plane) -> tuple[Component | None, Component | None]:
    """Cut, and hold what comes of it against what any cut has to be."""
    sides = component.cut(plane)
    volumes = [0.0 if side is None else side.volume for side in sides]
    assert sum(volumes) == pytest.approx(component.volume, rel=1e-9, abs=LAST_BITS)
    for side, sign in zip(sides, (1, -1), strict=True):
        if side is not None:
            assert is_closed(side.faces)
            assert len(np.unique(side.faces)) == len(side.vertices)
            assert (sign * (side.vertices @ plane.normal - plane.offset)).max() < LAST_BITS
            assert np.isin(np.arange(len(side.vertices)), side.faces).all()
    return sides


def plane_through(random: np.random.Generator, component: Component) -> Plane:
    """A plane of the kinds that are cut along: a coordinate axis, through a corner or not; a face; any."""
    kind, axis = random.integers(4), int(random.integers(3))
    corner = component.vertices[random.integers(len(component.vertices))]
    normal = np.eye(3)[axis]
    if kind == 0:
        return Plane((*normal.tolist(),), float(random.uniform(*component.box[:, axis])))
    if kind == 2:
        a, b, c = component.vertices[component.faces[random.integers(len(component.faces))]]
        normal, corner = np.cross(b - a, c - a), a
    elif kind == 3:
        normal = random.normal(size=3)
    length = np.linalg.norm(normal)
    if length < 1e-9:
        return Plane((0.0, 0.0, 1.0), float(corner[2]))
    return Plane((*(normal / length).tolist(),), float(normal / length @ corner))


@settings(deadline=None, max_examples=60)
@given(st.integers(0, 10**6))
def test_both_sides_are_closed_and_nothing_is_lost(seed: int) -> None:
    """Heaps of blocks, cut again and again, against manifold3d's own cut."""
    random = np.random.default_rng(seed)
    blocks = [block(*random.uniform(0.1, 1, 3), tuple(random.uniform(-0.4, 0.4, 3))) for _ in range(5)]
    pieces = [Component(Manifold.batch_boolean(blocks, OpType.Add))]
    for _ in range(6):
        component = pieces.pop(random.integers(len(pieces)))
        plane = plane_through(random, component)
        sides = sides_of(component, plane)
        above, below = to_manifold(component.vertices, component.faces).split_by_plane(plane.normal, plane.offset)
        for side, expected in zip(sides, (below, above), strict=True):
            assert (0.0 if side is None else side.volume) == pytest.approx(expected.volume(), rel=1e-6, abs=1e-9)
        pieces += [side for side in sides if side is not None]


@pytest.mark.parametrize("name", ["vhacd/cow-nonormals", "gazebo_models/mars_rover__rover", "capod/class14__m161"])
def test_real_solids_are_cut_without_loss(corpus: Path, name: str) -> None:
    random = np.random.default_rng(5)
    pieces = [Component(repair(load_mesh(corpus / f"test/{name}.ply"), threads=1).manifold)]
    for _ in range(30):
        component = pieces.pop(random.integers(len(pieces)))
        for side in sides_of(component, plane_through(random, component)):
            pieces += [] if side is None else [piece for piece in side.pieces() if piece.volume > 1e-6]


@pytest.mark.parametrize("turned", [False, True])
def test_slices_have_no_more_triangles_than_they_need(turned: bool) -> None:
    """What the triangles of a flat face have between them goes, on either side."""
    bar = block(2, 0.3, 0.4)
    bar = bar.rotate((20, 30, 40)) if turned else bar
    rest, normal = Component(bar), np.array([1.0, 0, 0])
    if turned:
        normal = Component(bar).principal_axes[0]
    for offset in np.linspace(-0.9, 0.9, 30):
        slice_, after = sides_of(rest, Plane((*normal.tolist(),), float(offset)))
        assert len(slice_.faces) == 12
        rest = after
    assert len(rest.faces) == 12


def test_a_section_may_have_holes_and_islands() -> None:
    rings = [CrossSection.circle(r, 32) for r in (1.0, 0.8, 0.5, 0.2)]
    tube = Component(Manifold.extrude((rings[0] - rings[1]) + (rings[2] - rings[3]), 2).translate((0, 0, -1)))
    below, above = sides_of(tube, Plane((0.0, 0.6, 0.8), 0.1))
    assert [len(side.pieces()) for side in (below, above)] == [2, 2]
    area = _native.mesh_area(below.vertices, below.faces) + _native.mesh_area(above.vertices, above.faces)
    section = (1 - 0.64 + 0.25 - 0.04) * 32 * np.sin(np.pi / 32) * np.cos(np.pi / 32) / 0.8
    assert area - _native.mesh_area(tube.vertices, tube.faces) == pytest.approx(2 * section)


def test_what_touches_the_plane_from_one_side_stays_whole() -> None:
    """A corner, an edge, a valley and a face: no side gets a sliver of them."""
    roof = Manifold.extrude(CrossSection([[(-1, 0), (0, 0.5), (1, 0), (1, 1), (-1, 1)]]), 1)  # a valley at y = 0.5
    tip = Manifold.hull_points(np.array([(0, 0, 0), (1, 0, 1), (-1, 1, 1), (-1, -1, 1)], dtype=float))
    for solid, plane in (
        (Component(roof), Plane((0.0, 1.0, 0.0), 0.0)),
        (Component(tip), Plane((0.0, 0.0, 1.0), 0.0)),
        (Component(tip), Plane((0.0, 0.0, 1.0), 1.0)),
        (Component(block(1, 1, 1)), Plane((1.0, 0.0, 0.0), 0.5)),
        (Component(block(1, 1, 1)), Plane((np.sqrt(0.5), np.sqrt(0.5), 0.0), np.sqrt(0.5))),
    ):
        sides = sides_of(solid, plane)
        (whole,) = [side for side in sides if side is not None]
        assert np.array_equal(whole.vertices[whole.faces], solid.vertices[solid.faces])
    below, above = sides_of(Component(roof), Plane((0.0, 1.0, 0.0), 0.5))  # through the valley
    assert len(below.pieces()) == 2
    assert above.volume == pytest.approx(1)


def test_an_inner_shell_that_is_cut_becomes_a_dent() -> None:
    hollow = Component(block(2, 2, 2) - block(1, 1, 1))
    below, above = sides_of(hollow, Plane((1.0, 0.0, 0.0), 0.0))
    assert below.volume == above.volume == pytest.approx(3.5)
    assert below.pieces() == [below]
    whole, _ = sides_of(hollow, Plane((1.0, 0.0, 0.0), 0.75))
    assert [piece.volume for piece in whole.pieces()] == pytest.approx([6.0])


def test_cavities_stay_in_the_piece_around_them() -> None:
    hollow = Manifold.sphere(1, 32) - Manifold.sphere(0.5, 32)
    solid = Component(hollow + Manifold.cube((1, 1, 1)).translate((2, 0, 0)))
    pieces = sorted(solid.pieces(), key=lambda piece: piece.volume)
    assert len(pieces) == 2
    assert pieces[1].volume == pytest.approx(hollow.volume())


@pytest.mark.parametrize("axis", range(3))
def test_a_cut_along_an_axis_is_exact(axis: int) -> None:
    """Faces in the plane stay whole on their own side, whatever the last bits of its offset: no side keeps a sliver."""

    def upright(lower: tuple[float, float, float], upper: tuple[float, float, float]) -> Manifold:
        a, b = np.roll(lower, axis + 1), np.roll(upper, axis + 1)  # the last coordinate becomes number `axis`
        corners = [np.where([i & 1, i & 2, i & 4], b, a) for i in range(8)]
        return Manifold.hull_points(np.array(corners))

    normal = tuple(np.eye(3)[axis].tolist())
    for offset in np.linspace(-0.4, 0.6, 30):
        slab, foot = upright((0, 0, -0.7), (1, 1, offset)), upright((0.2, 0.2, offset), (0.3, 0.3, 1))
        overhang = upright((0.2, 0.2, offset), (1.5, 0.3, 1))
        for upper in (foot, overhang):
            below, above = Component(slab + upper).cut(Plane(normal, float(offset)))
            assert below.box[1, axis] == offset == above.box[0, axis]
            for side, solid in ((below, slab), (above, upper)):
                assert side.volume == pytest.approx(solid.volume(), rel=1e-12)
                assert side.hull.volume == pytest.approx(solid.volume(), rel=1e-12)


def test_a_surface_that_is_not_closed_keeps_all_its_points_on_both_sides() -> None:
    box = trimesh.creation.box((1, 1, 1))
    vertices, opened = np.array(box.vertices), np.array(box.faces[1:], dtype=np.int32)
    for axis in np.eye(3):
        for side, sign in zip(_native.cut(vertices, opened, *axis.tolist(), 0.1, -1.0), (1, -1), strict=True):
            assert side is not None
            corners = vertices[sign * (vertices @ axis - 0.1) < 0]
            assert (np.abs(side[0][:, None] - corners).sum(axis=2).min(axis=0) == 0).all()


def test_a_rim_that_runs_an_edge_both_ways_leaves_both_sides_closed() -> None:
    """Where a real solid overlaps itself and a sliver of it lies above the plane, straightening makes such a rim."""
    case = np.load(Path(__file__).parent / "cases" / "edge_both_ways.npz")
    assert is_closed(case["faces"])
    for side in _native.cut(case["vertices"], case["faces"], *case["normal"].tolist(), float(case["offset"]), -1.0):
        assert side is not None
        assert is_closed(side[1])


def blob(seed: int) -> trimesh.Trimesh:
    """The hull of random points."""
    random = np.random.default_rng(seed)
    return hull_of(random.normal(size=(12, 3)) * 0.3 + random.uniform(-0.2, 0.2, 3))


def plane_at(offset: float, random: np.random.Generator) -> Plane:
    normal = random.normal(size=3)
    return Plane((*(normal / np.linalg.norm(normal)).tolist(),), offset)


def volume(side: Component | None) -> float:
    return 0.0 if side is None else side.volume


@given(seed=st.integers(0, 10**6), number=st.integers(2, 5), inside_out=st.booleans())
def test_a_solid_that_overlaps_itself_is_cut_like_its_bodies_one_by_one(seed, number, inside_out) -> None:
    bodies = [blob(seed + i) for i in range(number)]
    if inside_out:
        bodies[0].invert()
    whole, plane = component_of(trimesh.util.concatenate(bodies)), plane_at(0.05, np.random.default_rng(seed))
    original = _native.Surface(whole.vertices, whole.faces)
    for k, side in enumerate(whole.cut(plane, -np.inf)):
        own = [volume(component_of(body).cut(plane, -np.inf)[k]) for body in bodies]
        assert volume(side) == pytest.approx(sum(own), abs=1e-9)
        if side is not None:
            assert is_closed(side.faces)
            caps = side.vertices[side.faces]
            caps = caps[(np.abs(caps @ plane.normal - plane.offset) < 1e-12).all(axis=1)]
            caps = caps[trimesh.triangles.area(caps) > 1e-6]
            if len(caps):
                assert (np.abs(original.winding(caps.mean(axis=1))) > 0.5).all(), "no cap outside"


@given(seed=st.integers(0, 10**6))
def test_cuts_follow_cuts_without_piling_up_vertices(seed) -> None:
    """Caps lie on each other where a solid overlaps itself; the next plane cuts all of them at the same points."""
    surface = component_of(trimesh.util.concatenate([blob(seed + i) for i in range(3)]))
    random, size = np.random.default_rng(seed), len(surface.faces)
    for _ in range(8):
        surface, _ = surface.cut(plane_at(0.25, random), -np.inf)
        assert is_closed(surface.faces)
    assert len(surface.faces) < 10 * size


@pytest.mark.parametrize("offset", [0.0, 0.25, 0.5, 1.0])
@pytest.mark.parametrize("shift", [(0.0, 0.0, 0.0), (0.5, 0.0, 0.0), (0.25, 0.5, 0.0)])
def test_slivers_that_coincide_are_closed(offset, shift) -> None:
    """Two boxes that share their faces and cross: rims coincide in part."""
    box = trimesh.creation.box(bounds=[(0, 0, 0), (1, 1, 1)])
    both = component_of(trimesh.util.concatenate([box, box.copy().apply_translation(shift)]))
    below, above = both.cut(Plane((0.0, 0.0, 1.0), offset), -np.inf)
    assert all(is_closed(side.faces) for side in (below, above) if side is not None)
    assert volume(below) == pytest.approx(2 * offset, abs=1e-9)
    assert volume(above) == pytest.approx(2 - 2 * offset, abs=1e-9)


def solids() -> dict[str, trimesh.Trimesh]:
    bumpy = trimesh.creation.icosphere(subdivisions=4)
    bumpy.vertices *= 1 + 0.1 * np.random.default_rng(0).normal(size=(len(bumpy.vertices), 1))
    return {
        "box": trimesh.creation.box((1, 2, 3)),
        "ring": trimesh.creation.torus(1.0, 0.3, 64, 32),
        "bumpy ball": bumpy,
        "hollow box": trimesh.creation.box((2, 2, 2)) + inverted(trimesh.creation.box((1.5, 1.5, 1.5))),
        "two boxes": trimesh.creation.box((1, 1, 1)) + trimesh.creation.box((1, 1, 1)).apply_translation((2, 0, 0)),
    }


def inverted(mesh: trimesh.Trimesh) -> trimesh.Trimesh:
    mesh.invert()
    return mesh


def hulls(mesh: trimesh.Trimesh, count: int = 30) -> list[Hull]:
    """One around all, one inside; of corners of the solid, whose faces touch the facets; of grid points; of any."""
    rng = np.random.default_rng(1)
    found = [Hull.of(np.array(trimesh.creation.box((side,) * 3).vertices)) for side in (9, 0.1)]
    for size in rng.integers(4, 40, size=count).tolist():
        near = mesh.vertices[rng.integers(len(mesh.vertices))]
        for points in (
            mesh.vertices[rng.integers(len(mesh.vertices), size=size)],
            rng.integers(-4, 5, size=(size, 3)) / 2,
            near + 0.3 * rng.normal(size=(size, 3)),
        ):
            hull = Hull.of(np.array(points, dtype=np.float64))
            if hull is not None:
                found.append(hull)
    return found


@pytest.mark.slow
@pytest.mark.parametrize("name", solids())
def test_clipping_agrees_with_a_boolean(name: str) -> None:
    mesh = solids()[name]
    solid = component_of(mesh)
    whole = to_manifold(solid.vertices, solid.faces)
    for hull in hulls(mesh):
        part = solid.inside(hull)
        boolean = whole ^ Manifold(Mesh64(hull.vertices, hull.faces.astype(np.uint64)))
        assert (0.0 if part is None else part.volume) == pytest.approx(boolean.volume(), abs=1e-6)
        if part is not None:
            vertices, faces = part.vertices, part.faces
            assert is_closed(faces)
            planes = hull.vertices[hull.faces]
            normals = np.cross(planes[:, 1] - planes[:, 0], planes[:, 2] - planes[:, 0])
            large = np.linalg.norm(normals, axis=1) > 1e-6
            normals = normals[large] / np.linalg.norm(normals[large], axis=1)[:, None]
            heights = np.einsum("vfk,fk->vf", vertices[:, None] - planes[None, large, 0], normals)
            assert heights[np.unique(faces)].max() < 1e-6


def test_a_surface_folded_by_noise_is_clipped_and_its_halves_add_up() -> None:
    """Some hulls have corners where the folded surface holds them twice, or turns inside out."""
    crumpled = trimesh.creation.icosphere(subdivisions=4)
    crumpled.vertices += np.random.default_rng(0).uniform(-0.1, 0.1, crumpled.vertices.shape)
    solid = component_of(crumpled)
    rng = np.random.default_rng(2)
    for _ in range(60):
        hull = Hull.of(crumpled.vertices[rng.integers(len(crumpled.vertices), size=12)] * 0.985)
        below, above = Component((hull.vertices, hull.faces)).cut(Plane((0.0, 0.6, 0.8), 0.1))
        whole, *halves = (solid.inside(one) for one in (hull, below.hull, above.hull))
        halves = [part for part in halves if part is not None]
        assert all(is_closed(part.faces) for part in (whole, *halves))
        assert whole.volume == pytest.approx(sum(half.volume for half in halves), rel=1e-3)
