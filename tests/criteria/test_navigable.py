"""The navigable space: where balls are, where they get in, and what they make of a part."""

from __future__ import annotations

import csv
import itertools
import json
from pathlib import Path
from typing import Any

import manifold3d
import numpy as np
import pytest
import trimesh
from click.testing import CliRunner
from scipy.spatial import cKDTree
from scipy.spatial.transform import Rotation

import rlacd
from fuzz.geometry import Polytope
from rlacd import _native
from rlacd.cli.main import app
from rlacd.errors import OptionError
from rlacd.extras.criteria.navigable import LEAST_RADIUS, Balls, Navigable, NavigableSpace
from rlacd.io.read.load import load_mesh
from rlacd.repair.repair import repair
from rlacd.solid.component import Component, Part
from rlacd.solid.distance import hull_union
from rlacd.solid.hull import Hull
from rlacd.solid.solid import Solid
from tests.shapes import Floats, box, elbow, from_manifold, point_to_triangles, trimesh_of

# With these the balls are 0.1 wide in a frame 2 wide.
R, T = RADIUS, TOLERANCE = 0.1, 0.04


def solid_of(manifold: Any) -> Solid:
    return repair(load_mesh(trimesh_of(manifold)), keep_cavities=True, threads=1)


def prepare(manifold: Any, radius: float = RADIUS, tolerance: float = TOLERANCE, **options: Any) -> Navigable:
    return Navigable.of(NavigableSpace(radius, tolerance, **options), solid_of(manifold), threads=1)


TURNS = [(0, 0, 0), (31, 17, 53), (45, 45, 0), (10, 80, 33)]
"""As it is, and turned by angles that nothing is aligned with."""


def turned(manifold: Any, turn: int) -> Any:
    return manifold.rotate(TURNS[turn])


def torus(hole: float, tube: float = 0.3) -> Any:
    """Around z, as large as the frame when hole + 2 tube is 1."""
    circle = manifold3d.CrossSection.circle(tube, 24).translate((hole + tube, 0))
    return manifold3d.Manifold.revolve(circle, 48)


def table() -> Any:
    legs = [box((x, y, -0.8), (x + 0.15, y + 0.15, 0.1)) for x in (-1, 0.85) for y in (-0.7, 0.55)]
    return box((-1, -0.7, 0), (1, 0.7, 0.15)) + manifold3d.Manifold.batch_boolean(legs, manifold3d.OpType.Add)


def house(door: float | None, wall: float = 0.06, height: float = 1.2) -> Any:
    """A furnished room, 1.4 x 1.4 x 1.6 inside; its door is as wide as given and higher."""
    inside = box((-0.7, -0.7, -0.8), (0.7, 0.7, 0.8))
    outer = box((-0.7 - wall, -0.7 - wall, -0.8 - wall), (0.7 + wall, 0.7 + wall, 0.8 + wall))
    shell = outer - inside
    if door is not None:
        shell -= box((0.1 - door / 2, 0.5, -0.8), (0.1 + door / 2, 1, -0.8 + height))
    return shell + box((-0.71, -0.5, -0.81), (-0.3, 0.1, -0.3)) + box((0.3, -0.4, -0.81), (0.5, -0.2, 0.2))


def upright(points: Floats, turn: int) -> Floats:
    """Points of a turned shape, turned back."""
    return Rotation.from_euler("xyz", TURNS[turn], degrees=True).inv().apply(points)


def inside_house(nav: Navigable, manifold: Any, turn: int) -> Floats:
    """Which centres lie within the walls."""
    centres = solid_of(manifold).frame.to_input(nav.balls.centres)
    return (np.abs(upright(centres, turn)) < (0.7, 0.7, 0.8)).all(axis=1)


def depth_of(hull: Any, points: Floats) -> Floats:
    """Signed distance to a hull, negative inside, by brute force."""
    polytope = Polytope(np.asarray(hull.vertices), np.asarray(hull.faces))
    return np.asarray(np.minimum(polytope.height(points), 0) + polytope.distance(points))


SHAPES = {
    "bracket": box((-1, -1, -0.5), (1, 1, 0.5)) - box((-0.4, -0.4, 0), (2, 2, 2)),
    "torus": torus(0.4),
    "table": table(),
    "turned table": turned(table(), 1),
    "open house": house(0.4),
    "two boxes": box((-1, -0.3, -0.3), (-0.2, 0.3, 0.3)) + box((0.2, -0.3, -0.3), (1, 0.3, 0.3)),
}


@pytest.mark.slow
@pytest.mark.parametrize("name", SHAPES)
def test_balls_are_where_the_definition_says(name: str) -> None:
    solid = solid_of(SHAPES[name])
    nav = Navigable.of(NavigableSpace(RADIUS, TOLERANCE), solid)
    check_balls(nav, solid)


def check_balls(nav: Navigable, solid: Solid) -> None:
    mesh = from_manifold(solid.manifold)
    hull = Hull.of(mesh.vertices)
    centres, radii = nav.balls.centres, nav.balls.radii
    assert len(centres) > 0
    assert (radii >= nav.radius - 1e-8).all()
    distance = point_to_triangles(centres, mesh.vertices, mesh.faces)
    np.testing.assert_allclose(radii, distance - nav.tolerance, atol=2e-8)
    assert (_native.Surface(mesh.vertices, mesh.faces).winding(centres, accuracy=np.inf) < 0.01).all()
    away = depth_of(hull, centres)
    assert (away <= nav.radius + 1e-8).all()
    assert (away < radii).all()
    # On the boundary: at the distance of radius and tolerance from the surface, or of the radius from the hull.
    on = np.minimum(np.abs(distance - nav.radius - nav.tolerance), np.abs(away - nav.radius))
    assert on.max() < 1e-7


@pytest.mark.slow
@pytest.mark.parametrize("name", SHAPES)
@pytest.mark.parametrize(("radius", "tolerance"), [(0.1, 0.04), (0.05, 0.1), (0.1, 0.01)])
def test_the_boundary_is_covered(name: str, radius: float, tolerance: float) -> None:
    """Points at the distance of radius and tolerance, found without a grid; all of these shapes are open."""
    solid = solid_of(SHAPES[name])
    nav = Navigable.of(NavigableSpace(radius, tolerance), solid)
    mesh = from_manifold(solid.manifold)
    surface, hull = _native.Surface(mesh.vertices, mesh.faces), Hull.of(mesh.vertices)
    points = np.random.default_rng(5).uniform(-1.2, 1.2, (60_000, 3))
    points = points[surface.winding(points) < 0.5]
    closest, _ = surface.closest(points)
    distance = np.linalg.norm(points - closest, axis=1)
    far = distance > nav.radius + nav.tolerance
    level = closest[far] + (points - closest)[far] * ((nav.radius + nav.tolerance) / distance[far])[:, None]
    to_hull = hull_union([hull]).distance(level)
    level = level[to_hull < 0.5 * nav.radius]  # farther out a ball hardly touches the hull
    assert len(level) > 200
    gap, _ = cKDTree(nav.balls.centres).query(level)
    assert gap.max() < 0.75 * nav.radius
    assert np.quantile(gap, 0.99) < 0.6 * nav.radius


@pytest.mark.slow
@pytest.mark.parametrize("turn", range(2))
@pytest.mark.parametrize("wall", [0.01, 0.06, 0.3])
@pytest.mark.parametrize("share", [0.98, 1.02])
def test_a_door_lets_in_what_is_narrower(turn: int, wall: float, share: float) -> None:
    diameter = 0.2
    home = turned(house(share * diameter, wall), turn)
    nav = Navigable.of(NavigableSpace(radius_abs=diameter / 2, tolerance_abs=0.02), solid_of(home))
    assert inside_house(nav, home, turn).any() == (share > 1)


def test_a_sealed_house_is_one_part_and_its_inside_counts_when_asked_for() -> None:
    home = house(None)
    shut = prepare(home)
    assert len(shut.balls) == 0
    assert shut.is_met(Component(solid_of(home).manifold))
    everything = prepare(home, reachable_only=False)
    assert len(everything.balls) > 100
    assert inside_house(everything, home, 0).all()
    check_balls(everything, solid_of(home))
    assert not everything.is_met(Component(solid_of(home).manifold))


def test_balls_from_seeds_stay_where_they_can_come_from_there() -> None:
    """A notch outside, a room inside: the seed says which of them counts, the door whether both do."""
    notch = box((-0.5, -2, 0.5), (0.5, -0.9, 2))
    shut, opened = (house(door, 0.3) - notch for door in (None, 0.3))
    within = ((0.0, 0.3, 0.3),)
    nav = prepare(shut, seeds=within)
    assert len(nav.balls) > 100
    assert inside_house(nav, shut, 0).all()
    nav = prepare(shut, seeds=[(0, -5, 0)])
    assert len(nav.balls) > 10
    assert not inside_house(nav, shut, 0).any()
    nav = prepare(opened, seeds=within)
    assert inside_house(nav, opened, 0).any()
    assert not inside_house(nav, opened, 0).all()
    np.testing.assert_array_equal(nav.balls.centres, prepare(opened).balls.centres)


def test_the_ground_keeps_balls_above_it() -> None:
    """A table on the ground: balls go under it from the sides. A crate upside down: nothing comes in."""
    ground = ((0, 0, 2), -1.6)  # z = -0.8; the normal's length does not matter
    solid = solid_of(table())
    nav = Navigable.of(NavigableSpace(RADIUS, TOLERANCE, closed_planes=[ground]), solid)
    floor = float(solid.frame.to_frame([[0, 0, -0.8]])[0, 2])
    lowest = nav.balls.centres[:, 2] - nav.balls.radii
    assert lowest.min() == pytest.approx(floor, abs=1e-9)
    assert (nav.balls.radii >= nav.radius - 1e-8).all()
    under = (np.abs(nav.balls.centres[:, :2]) < 0.5).all(axis=1)
    assert under.any()
    crate = box((-0.5, -0.5, -0.8), (0.5, 0.5, 0)) - box((-0.4, -0.4, -1), (0.4, 0.4, -0.1))
    assert len(prepare(crate).balls) > 0
    assert len(prepare(crate, closed_planes=[ground]).balls) == 0


ODD = {
    "radius": [0, float("nan"), "wide"],
    "tolerance": [-0.1, float("inf")],
    "radius_abs": [0.0],
    "tolerance_abs": [-1],
    "seeds": [[(0, 0)], [], [(0, 0, float("nan"))], "here"],
    "closed_planes": [[((0, 0, 0), 1)], [(0, 0, 1)], 3],
    "reachable_only": ["yes"],
}


@pytest.mark.parametrize(("name", "value"), [(name, value) for name, values in ODD.items() for value in values])
def test_options_out_of_range_are_reported(name: str, value: Any) -> None:
    with pytest.raises(OptionError, match=rf"\b{name}\b"):
        NavigableSpace(**{name: value})


@pytest.mark.parametrize(
    ("seed", "says"), [((0, 0, 0.05), "inside"), ((0, 0, 0.2), "radius"), ((0, 0, -0.75), "closed plane")]
)
def test_a_seed_without_room_is_reported(seed: tuple[float, float, float], says: str) -> None:
    with pytest.raises(OptionError, match=says):
        prepare(table(), seeds=[seed], closed_planes=[((0, 0, 1), -0.8)])


@pytest.mark.parametrize(
    ("solid", "radius", "says"),
    [(table(), 3.0, "larger than the object"), (box((-1, -0.5, -0.2), (1, 0.5, 0.2)), RADIUS, "")],
)
def test_what_no_ball_is_near_is_one_hull(solid: Any, radius: float, says: str) -> None:
    nav = prepare(solid, radius)
    assert len(nav.balls) == 0
    assert says in "".join(nav.warnings)
    assert bool(nav.warnings) == bool(says)
    assert nav.is_met(Component(solid_of(solid).manifold))


def test_a_radius_too_small_for_the_grid_is_reported() -> None:
    nav = prepare(box((-1, -0.2, -0.2), (1, 0.2, 0.2)) - box((-0.5, -0.1, 0), (0.5, 0.1, 1)), 0.004, 0.004)
    assert len(nav.balls) > 0
    assert any("is small" in warning for warning in nav.warnings)


def test_what_was_open_is_reported() -> None:
    cube = trimesh.creation.box()
    cup = trimesh.Trimesh(cube.vertices, cube.faces[cube.face_normals[:, 2] < 0.5])
    nav = Navigable.of(NavigableSpace(), repair(load_mesh(cup)))
    assert any("open bod" in warning for warning in nav.warnings)
    assert len(nav.balls) > 0


# The criterion.


def part_of(hull: Hull, within: Part | None = None) -> Part:
    mesh = hull.vertices, hull.faces, hull.volume
    part = Component.of((*mesh, *mesh))
    part.within = within
    return part


def some_balls(count: int = 400, seed: int = 3) -> Navigable:
    rng = np.random.default_rng(seed)
    balls = Balls(rng.uniform(-1, 1, (count, 3)), rng.uniform(0.05, 0.2, count))
    return Navigable(0.05, 0.02, balls)


def some_hull(seed: int, size: float = 0.4) -> Hull:
    rng = np.random.default_rng(seed)
    return Hull.of(rng.uniform(-1, 1, 3) * 0.7 + size * rng.uniform(-1, 1, (20, 3)))


@pytest.mark.parametrize("seed", range(8))
def test_error_is_the_deepest_intrusion(seed: int) -> None:
    nav, hull = some_balls(seed=seed), some_hull(seed, 0.1 + 0.1 * seed)
    depth = nav.balls.radii - depth_of(hull, nav.balls.centres)
    assert nav.error(part_of(hull)) == pytest.approx(max(0.0, depth.max()), abs=1e-7)
    assert nav.is_met(part_of(hull)) == (depth.max() <= 1e-9)
    for factor in (1.5, 5.0, 12.0):
        coarser = nav.scaled(factor)
        allowance = 0.02 * (factor - 1)
        assert coarser.allowance == pytest.approx(allowance)
        expected = depth[nav.balls.radii > allowance].max(initial=0.0) <= max(allowance, 1e-9)
        assert coarser.is_met(part_of(hull)) == expected
        assert coarser.error(part_of(hull)) == nav.error(part_of(hull))


def test_a_part_smaller_than_half_the_tolerance_is_done() -> None:
    nav = Navigable(0.2, 0.2, Balls(np.zeros((1, 3)), np.array([0.2])))
    for side, done in ((0.09, True), (0.11, False)):
        hull = Hull.of(side * np.array(list(itertools.product((0, 1), repeat=3)), dtype=float))
        assert nav.is_met(part_of(hull)) == done
        assert (nav.error(part_of(hull)) == 0) == done


@pytest.mark.parametrize("seed", range(4))
def test_balls_give_way_to_finished_parts(seed: int) -> None:
    nav = some_balls(seed=seed)
    parts = [part_of(some_hull(10 * seed + i, 0.3)) for i in range(4)]
    settled = nav.settled(parts)
    assert all(settled.is_met(part) for part in parts)
    away = np.min([depth_of(part.hull, nav.balls.centres) for part in parts], axis=0)
    left = np.minimum(nav.balls.radii, away)
    kept = left >= LEAST_RADIUS * nav.radius
    np.testing.assert_allclose(settled.balls.radii, left[kept], atol=1e-7)
    np.testing.assert_array_equal(settled.balls.centres, nav.balls.centres[kept])
    assert settled.conflicts.dropped == (~kept).sum()
    assert settled.conflicts.shrunk == (kept & (left < nav.balls.radii - 1e-9)).sum()
    lost = np.where(kept, nav.balls.radii - left, nav.balls.radii)
    assert settled.conflicts.most == pytest.approx(lost.max(), abs=1e-7)
    assert nav.settled([]) is nav


# --- in decompose -----------------------------------------------------------------------------------------------------


AIR = np.array([[-0.6, 0.5, 0.6]])
"""A place in the house where nothing stands."""


def intrusion(result: rlacd.Decomposition) -> float:
    """Deepest that any hull reaches into any ball, in the input's unit."""
    balls = result.balls
    return max(float((balls.radii - depth_of(hull, balls.centres)).max(initial=0.0)) for hull in result)


@pytest.mark.promise("navigable")
def test_a_door_wider_than_the_ball_opens_the_inside() -> None:
    space = rlacd.NavigableSpace(radius_abs=0.1, tolerance_abs=0.02)
    shut, opened = (rlacd.decompose(trimesh_of(house(door, 0.15)), criterion=space) for door in (0.19, 0.21))
    assert min(depth_of(hull, AIR) for hull in shut) < 0 < min(depth_of(hull, AIR) for hull in opened)
    assert len(shut) < 6 < len(opened)
    assert intrusion(opened) <= 1e-9


def test_a_threshold_does_not_go_with_it() -> None:
    with pytest.raises(rlacd.OptionError, match="has radius and tolerance instead"):
        rlacd.decompose(elbow(), criterion=rlacd.NavigableSpace(), threshold=0.1)


def test_lengths_in_the_meshs_own_unit() -> None:
    mesh = elbow()
    by_share = rlacd.decompose(mesh, criterion=rlacd.NavigableSpace(0.1, 0.04))
    mesh.apply_scale(1000)
    by_length = rlacd.decompose(mesh, criterion=rlacd.NavigableSpace(radius_abs=100.0, tolerance_abs=40.0))
    assert len(by_share) == len(by_length) == 2
    assert np.allclose(by_share.balls.centres * 1000, by_length.balls.centres, atol=1e-3)
    for share in (0.1, rlacd.NavigableSpace().radius):  # the default, but given
        with pytest.raises(rlacd.OptionError, match="and radius_abs is 1"):
            rlacd.NavigableSpace(share, radius_abs=1.0)


def bumpy_ball() -> trimesh.Trimesh:
    ball = trimesh.creation.icosphere(3)
    x, y = ball.vertices[:, :1], ball.vertices[:, 1:2]
    ball.vertices *= 1 + 0.35 * np.sin(5 * x) * np.cos(4 * y)
    return ball


@pytest.mark.slow
def test_one_pass_eliminates_parts_that_others_can_hold_together() -> None:
    """A policy that stands for a published method does not: the same cuts, merged, are more hulls."""
    space, mesh = rlacd.NavigableSpace(0.2, 0.04), bumpy_ball()
    divided = rlacd.decompose(mesh, criterion=space, quality="fast")
    merged = rlacd.decompose(mesh, criterion=space, quality="fast", policy="greedy-excess-norm+edges")
    assert len(divided) < len(merged)
    assert intrusion(divided) < 1e-6
    assert divided.report.hausdorff.missed < 5e-3
    assert "search" in divided.report.seconds
    assert "search" not in merged.report.seconds


@pytest.mark.slow
def test_the_command_takes_seeds_and_planes_and_writes_the_balls(tmp_path: Path) -> None:
    elbow().export(tmp_path / "ell.stl")
    words = ["--criterion", "navigable", "--radius-abs", "0.1", "--tolerance-abs", "0.04", "--report", "-", "-q"]
    words += ["--seed-point", "1.5,0.2,1.5", "--closed-plane", "0,0,1,-1"]
    for ending in ("csv", "glb"):
        given = ["-o", tmp_path / "out.glb", "--balls", tmp_path / f"balls.{ending}", *words]
        done = CliRunner().invoke(app, [str(word) for word in ("decompose", tmp_path / "ell.stl", *given)])
        assert done.exit_code == 0, done.output
    report = json.loads(done.stdout)
    assert report["options"]["criterion"]["seeds"] == [[1.5, 0.2, 1.5]]
    assert report["options"]["criterion"]["closed_planes"] == [[[0, 0, 1], -1]]
    with (tmp_path / "balls.csv").open() as file:
        balls = np.array([[float(row[name]) for name in ("x", "y", "z", "radius")] for row in csv.DictReader(file)])
    spheres = trimesh.load(tmp_path / "balls.glb").to_geometry()
    assert len(balls) == len(spheres.split()) == report["navigable"]["balls"] > 0
    assert report["navigable"]["intrusion"] == {"max": 0, "per_part": [0] * report["hulls"]}
    assert "concavity" not in report
    hulls = trimesh.load_scene(tmp_path / "out.glb").to_mesh().split()
    reach = np.min([point_to_triangles(balls[:, :3], hull.vertices, hull.faces) for hull in hulls], axis=0)
    assert (reach >= balls[:, 3] - 1e-4).all(), "a hull reaches into a ball"


@pytest.mark.nightly
@pytest.mark.promise("navigable")
def test_no_hull_overlaps_a_final_ball_on_real_meshes(corpus: Path) -> None:
    for name in (corpus / "quick.txt").read_text().split()[::4]:
        result = rlacd.decompose(corpus / name, criterion=rlacd.NavigableSpace(0.1, 0.02), policy="navacd")
        assert result.report.navigable.intrusion.max == 0, name
        assert result.balls is not None
        scale = np.ptp(result.source.vertices, axis=0).max()
        assert intrusion(result) <= 1e-7 * scale, name
