"""Holes, cavities and damage: what is closed, what is filled, and what stays open."""

import re

import numpy as np
import pytest
import trimesh
from manifold3d import Manifold

import rlacd
from fuzz.flaws import FAMILIES
from rlacd.io.read.load import load_mesh
from rlacd.repair.distance import SurfaceQuery
from rlacd.repair.holes import HOLE
from rlacd.repair.repair import repair
from rlacd.repair.union import to_arrays
from rlacd.repair.wanted import DEFAULT_GAP
from rlacd.solid.distance import hull_union
from rlacd.solid.frame import HALF_THICKNESS, Frame
from rlacd.solid.hull import Hull
from tests.repair.repaired import BOX, join, moved, solid_of, steps, volume, with_hole, without


def test_a_box_with_a_missing_side_is_a_thin_walled_box():
    solid = solid_of(without(BOX, *np.flatnonzero(BOX.face_normals[:, 2] > 0.9)))
    assert steps(solid) == ["slab"]
    walls = 5 * 4 * 2 * HALF_THICKNESS
    assert solid.manifold.volume() == pytest.approx(walls, rel=0.02)
    assert solid.bodies[0].deviation <= 2 * HALF_THICKNESS + 1e-9


@pytest.mark.parametrize(("width", "subdivisions", "said"), [(DEFAULT_GAP / 2, 6, False), (0.08, 5, True)])
@pytest.mark.promise("repair-said")
def test_a_small_hole_in_a_scan_is_closed_and_reported_but_a_pinhole_is_not(width, subdivisions, said):
    mesh, full = with_hole(width, subdivisions=subdivisions)
    solid = solid_of(mesh)
    assert steps(solid) == ["capped"]
    assert (DEFAULT_GAP if said else 0) <= solid.bodies[0].deviation <= (HOLE if said else DEFAULT_GAP)
    assert volume(solid) == pytest.approx(full, rel=1e-2 if said else 1e-3)
    assert ["Holes were closed" in line for line in solid.warnings] == [True] * said


@pytest.mark.parametrize(("gap", "filled"), [(0.1, False), (0.2, True)])
def test_a_ball_that_does_not_pass_a_hole_decides(gap, filled):
    mesh, full = with_hole(0.2)
    assert volume(solid_of(mesh, gap=gap)) / full == pytest.approx(1.0 if filled else 0.0, abs=0.01)


@pytest.mark.parametrize(("gap", "filled"), [(0.015, False), (DEFAULT_GAP, True)])
def test_a_small_ball_rolls_on_a_grid_fine_enough(gap, filled):
    box = without(BOX, *np.flatnonzero(BOX.face_normals[:, 2] > 0.9))
    lid = trimesh.Trimesh([[-1, -1, 1.05], [1, -1, 1.05], [1, 1, 1.05], [-1, 1, 1.05]], [[0, 1, 2], [0, 2, 3]])
    assert (volume(solid_of(join(box, lid), gap=gap)) > 7) == filled


def revolved(*profile, sections=24):
    mesh = trimesh.creation.revolve(np.array(profile), sections=sections)
    return trimesh.Trimesh(mesh.vertices, mesh.faces, process=False)


BOTTLE = ((0, 0), (0.35, 0), (0.35, 1.4), (0.12, 1.7), (0.12, 2))
WINE_BOTTLE = ((0, 0), (0.3, 0), (0.3, 1.3), (0.06, 1.6), (0.06, 2))
CUP = ((0, 0), (0.4, 0), (0.5, 1))
LAMPSHADE = ((0.6, 0), (0.3, 0.8))
# Two mouths with a lip in their plane: caps would continue it smoothly.
PIPE = ((0.3, 0), (0.5, 0), (0.5, 2), (0.3, 2))
LONG_PIPE = ((0.08, 0), (0.08, 2))
HOLLOW = [
    (PIPE, 8),
    (LONG_PIPE, 24),
    (BOTTLE, 24),
    (BOTTLE, 8),
    (WINE_BOTTLE, 24),
    (CUP, 24),
    (CUP, 8),
    (LAMPSHADE, 24),
    (LAMPSHADE, 8),
]


@pytest.mark.parametrize(("profile", "sections"), HOLLOW)
def test_a_pipe_a_bottle_a_cup_and_a_lampshade_stay_hollow_unless_they_shall_be_solid(profile, sections):
    mesh = revolved(*profile, sections=sections)
    hollow = solid_of(mesh)
    assert steps(hollow) == ["slab"]
    assert "--openings solid fills it" in hollow.warnings[0]
    full = solid_of(mesh, open_bodies="solid")
    assert steps(full) == ["capped"]
    assert volume(full) == pytest.approx(trimesh.convex.convex_hull(mesh).volume, rel=0.35)
    thin = solid_of(mesh, open_bodies="thin")
    assert thin.manifold.volume() == hollow.manifold.volume()
    assert not thin.warnings


FENDER = trimesh.creation.cylinder(1.0, 0.5, sections=32)
FENDER.update_faces((FENDER.triangles_center[:, 1] > 0) & (FENDER.face_normals @ [0, 0, 1] < 0.5))
FLASK = ((0, 0), (0.5, 0), (0.5, 1.4), (0.3, 1.7))


@pytest.mark.parametrize(
    ("mesh", "step"),
    [
        (revolved(*CUP), "slab"),
        (revolved(*LAMPSHADE), "slab"),
        (revolved(*LONG_PIPE), "slab"),
        (trimesh.Trimesh(FENDER.vertices, FENDER.faces), "slab"),
        (revolved(*FLASK), "capped"),
        (revolved(*BOTTLE), "capped"),
    ],
    ids=["cup", "lampshade", "pipe", "fender", "flask", "bottle"],
)
def test_of_links_only_those_with_openings_as_wide_as_they_are_stay_open(mesh, step):
    assert steps(solid_of(mesh)) == ["slab"]
    link = solid_of(mesh, open_bodies="small")
    assert steps(link) == [step]
    if step == "capped":
        assert volume(link) == pytest.approx(volume(solid_of(mesh, open_bodies="solid")))
        assert "Holes were closed" in link.warnings[0]


def bent_tube(radii, sections=8):
    """A tube along half a circle of radius 1, open at both ends, with these radii along its way."""
    turn = np.linspace(0, 2 * np.pi, sections, endpoint=False)
    way = np.linspace(0, np.pi, len(radii))
    out = 1 + np.multiply.outer(radii, np.cos(turn))
    up = np.multiply.outer(radii, np.sin(turn))
    points = np.stack([out * np.cos(way)[:, None], out * np.sin(way)[:, None], up], axis=-1).reshape(-1, 3)
    i, j = (a.ravel() for a in np.mgrid[: len(radii) - 1, :sections])
    a, b = sections * i + j, sections * i + (j + 1) % sections
    return trimesh.Trimesh(
        points, np.concatenate([np.stack([a, b, b + sections], 1), np.stack([a, b + sections, a + sections], 1)])
    )


@pytest.mark.parametrize(
    ("radius", "bulge", "sections", "step"),
    [(0.055, 0.0, 8, "capped"), (0.055, 0.3, 8, "slab"), (0.1, 0.0, 4, "slab"), (0.1, 0.0, 8, "slab")],
)
def test_the_ends_of_a_cable_are_closed_and_those_of_a_flask_or_a_pipe_are_not(radius, bulge, sections, step):
    """All have two openings; a thin cable is solid, and a bar as wide as a pipe cannot be told from one."""
    solid = solid_of(bent_tube(radius + bulge * np.sin(np.linspace(0, np.pi, 25)) ** 2, sections))
    assert steps(solid) == [step]
    assert ("Holes were closed" if step == "capped" else "--openings solid fills it") in solid.warnings[0]


@pytest.mark.parametrize(
    ("profile", "step"),
    [
        (((0, 0), (0.095, 0), (0.095, 2)), "capped"),
        (((0, 0), (0.2, 0), (0.2, 2)), "slab"),
        (((0, 0), (0.3, 0), (0.3, 1.3), (0.02, 1.6), (0.02, 2)), "capped"),
    ],
    ids=["handle", "wide glass", "neck that no ball passes"],
)
def test_the_one_open_end_of_a_handle_or_a_hair_thin_neck_is_closed_and_the_mouth_of_a_glass_is_not(profile, step):
    assert steps(solid_of(revolved(*profile))) == [step]
    assert steps(solid_of(revolved(*profile), open_bodies="thin")) == ["slab"]


@pytest.mark.parametrize("shift", [0.0, 0.3])
def test_a_hole_in_which_a_basin_hangs_is_not_closed(shift):
    """A box whose top has a hole; a basin that does not hang in the hole, but below it, leaves it a wound."""
    half = np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]])
    top = np.vstack([np.c_[half, np.ones(4)], np.c_[0.5 * half, np.ones(4)]])
    ring = [[a, (a + 1) % 4, 4 + b] for a in range(4) for b in (a, (a + 1) % 4)]
    ring = [[a, b, c] if c == 4 + (a + 1) % 4 else [a, 4 + (a + 1) % 4, 4 + a] for a, b, c in ring]
    counter = join(without(BOX, *np.flatnonzero(BOX.face_normals[:, 2] > 0.9)), trimesh.Trimesh(top, ring))
    counter.merge_vertices()
    basin = trimesh.creation.box(extents=(1.04, 1.04, 0.8))
    basin = moved(without(basin, *np.flatnonzero(basin.face_normals[:, 2] > 0.9)), 0, 0, 0.62 - shift)
    alone = solid_of(counter)
    assert steps(alone) == ["capped"]
    assert volume(alone) == pytest.approx(8, rel=1e-3)
    solid = solid_of(join(counter, basin))
    inside = SurfaceQuery(*to_arrays(solid.manifold)).inside(solid.frame.to_frame(np.array([[0.0, 0.0, 0.6]])))
    assert inside.all() == (shift > 0)


def test_a_car_is_solid(corpus):
    """Two of its seven bodies are open, where nothing can get inside."""
    solid = repair(load_mesh(corpus / "test/gazebo_models/hatchback__hatchback.ply"))
    assert set(steps(solid)) == {"closed", "capped"}
    assert not solid.warnings
    assert solid.manifold.volume() > 0.5 * solid.manifold.hull().volume()


@pytest.mark.parametrize(("slit", "filled"), [(0.02, True), (0.2, False)])
def test_a_cupboard_is_solid_if_nothing_gets_past_its_door(slit, filled):
    """Its boxes share edges, so it is one body without free edges: an outer skin with a room."""
    walls = [
        ((-1, -1, -1), (1, 1, -0.9)),
        ((-1, -1, 0.9), (1, 1, 1)),
        ((-1, -1, -0.9), (-0.9, 1, 0.9)),
        ((0.9, -1, -0.9), (1, 1, 0.9)),
        ((-0.9, 0.9, -0.9), (0.9, 1, 0.9)),
    ]
    door = ((-0.9, -1, -0.9), (0.9 - slit, -0.9, 0.9))
    cupboard = join(*(trimesh.creation.box(bounds=bounds) for bounds in [*walls, door]))
    solid = solid_of(cupboard)
    assert steps(solid) == ["outer skin"]
    assert volume(solid) == pytest.approx(8 if filled else 2.16, rel=0.02)
    assert volume(solid_of(cupboard, open_bodies="thin")) == pytest.approx(2.16, rel=0.02)
    hulls = rlacd.decompose(cupboard, quality="fast")
    assert len(hulls) <= 2 if filled else len(hulls) >= 6


@pytest.mark.parametrize(("width", "filled"), [(0.001, True), (0.04, False)])
def test_a_deep_hair_thin_slit_in_a_body_is_filled(width, filled):
    blocks = [
        ((-1, -1, -1), (1, 1, -0.5)),
        ((-1, -1, -0.5), (-width / 2, 1, 1)),
        ((width / 2, -1, -0.5), (1, 1, 1)),
    ]
    split = join(*(trimesh.creation.box(bounds=bounds) for bounds in blocks))
    assert steps(solid_of(split)) == ["outer skin"]
    assert volume(solid_of(split, open_bodies="thin")) == pytest.approx(8 - 3 * width, rel=1e-6)
    # What is nearer to the outside than two radii of the ball may stay open: it is too shallow to need a cut.
    empty = 8 - volume(solid_of(split))
    assert 0 <= empty < 0.5 * width if filled else empty == pytest.approx(3 * width, rel=0.05)
    assert (len(rlacd.decompose(split, quality="fast")) == 1) == filled


@pytest.mark.slow
@pytest.mark.parametrize(
    "name", ["kitchenCabinetDrawer-1", "kitchenCabinetUpperLow", "kitchenFridge", "kitchenFridgeBuiltIn"]
)
def test_closed_furniture_is_a_few_hulls(name, corpus):
    result = rlacd.decompose(corpus / "train" / "kenney_cc0" / f"furniture_pack__{name}.ply", quality="fast")
    assert len(result) <= 6
    assert result.report.hausdorff.added < 0.05
    assert result.report.hausdorff.missed == 0


@pytest.mark.parametrize("reach", [0.1, 0.5, 2.0])
@pytest.mark.parametrize("tilt", [0.2, 1.0, 1.9])
def test_a_lid_that_stands_open_on_a_closed_box_is_kept(reach, tilt):
    corners = BOX.vertices[(BOX.vertices[:, 2] > 0) & (BOX.vertices[:, 0] > 0)]
    tips = corners + reach * np.array([-np.cos(tilt), 0, np.sin(tilt)])
    hinge = [int(np.flatnonzero((BOX.vertices == corner).all(axis=1))[0]) for corner in corners]
    lid = [[*hinge, 8], [hinge[1], 9, 8]]
    box = trimesh.Trimesh(np.concatenate([BOX.vertices, tips]), np.concatenate([BOX.faces, lid]), process=False)
    solid = solid_of(box)
    assert volume(solid) == pytest.approx(8, rel=0.01)
    points = solid.frame.to_frame(tips)
    assert SurfaceQuery(*to_arrays(solid.manifold)).distance(points).max() < 2 * HALF_THICKNESS


@pytest.mark.parametrize("count", [4, 8])
@pytest.mark.parametrize("way", [(0, 0, 0.4), (0.25, 0.25, 0.3), (0.6, 0.6, 0), (-0.3, -0.3, 0)])
def test_a_cup_with_flaps_on_its_rim_stays_hollow(count, way):
    """They lie flat on its side, lean outwards or inwards, or point at the middle; what they leave is still a mouth."""
    cup = revolved(*CUP, sections=8)
    top = cup.vertices[:, 2].max()
    rim = np.flatnonzero(cup.vertices[:, 2] > top - 1e-9)
    edges = [edge for edge in cup.edges_unique.tolist() if set(edge) <= set(rim.tolist())][:count]
    n = len(cup.vertices)
    tips = cup.vertices[edges].mean(axis=1)
    tips = tips + np.array(way) * np.column_stack([np.sign(tips[:, :2]), np.ones(len(tips))])
    faces = np.concatenate([cup.faces, [[a, b, n + i] for i, (a, b) in enumerate(edges)]])
    solid = solid_of(trimesh.Trimesh(np.concatenate([cup.vertices, tips]), faces, process=False))
    assert volume(solid) < 0.1 * trimesh.convex.convex_hull(cup).volume


@pytest.mark.parametrize("apart", [0.1, 0.3])
def test_what_caps_leave_of_a_room_that_nothing_can_enter_is_filled(apart):
    """A deep chest and its flat lid, open towards each other, and a belt around the slit that touches neither."""
    belt = Manifold.cube((2.12, 2.12, apart + 0.2), True) - Manifold.cube((2.02, 2.02, apart + 0.3), True)
    chest = trimesh.creation.box((2, 2, 2)).apply_translation((0, 0, -1 - apart / 2))
    lid = trimesh.creation.box((2, 2, 0.6)).apply_translation((0, 0, 0.3 + apart / 2))
    chest = without(chest, *np.flatnonzero(chest.face_normals[:, 2] > 0.9))
    lid = without(lid, *np.flatnonzero(lid.face_normals[:, 2] < -0.9))
    around = trimesh.Trimesh(*to_arrays(belt), process=False)
    solid = solid_of(join(chest, lid, around))
    assert volume(solid) == pytest.approx(4 * (2.6 + apart) + belt.volume(), rel=0.01)
    ajar = solid_of(join(chest, lid, around.copy().apply_scale((1.2, 1.2, 1))))
    assert volume(ajar) < 4, "where something gets in, they are shells"


@pytest.mark.parametrize("share", [0.05, 0.1, 0.2])
@pytest.mark.parametrize("family", FAMILIES)
@pytest.mark.parametrize("name", ["ball", "torus"])
@pytest.mark.promise("repair-keeps")
def test_a_damaged_solid_stays_the_solid_it_was(name, family, share):
    """Where whole patches are gone, it may not; then a warning says where."""
    mesh = {
        "ball": trimesh.creation.icosphere(subdivisions=2),
        "torus": trimesh.creation.torus(1, 0.35, major_sections=20, minor_sections=10),
    }[name]
    damaged = FAMILIES[family](np.array(mesh.vertices), np.array(mesh.faces), share, np.random.default_rng(5))
    solid = solid_of(trimesh.Trimesh(*damaged, process=False))
    repaired = SurfaceQuery(*to_arrays(solid.manifold))
    points = solid.frame.to_frame(mesh.vertices)
    missed = np.where(repaired.inside(points), 0, repaired.distance(points)).max()
    kept = volume(solid) == pytest.approx(mesh.volume, rel=0.03) and missed <= 0.03
    assert kept or (family in ("missing patches", "mixture") and " at (" in " ".join(solid.warnings))


@pytest.mark.slow
@pytest.mark.parametrize("family", ["moth holes", "missing patches"])
@pytest.mark.promise("loss-named")
def test_warnings_and_report_name_where_a_damaged_scan_may_have_lost_something(family):
    """Of four bodies the first two are damaged. What is lost is no farther from the middle of a hole than that is wide.

    Places in the warnings are those of the report, in the input's unit, and lie on damaged bodies.
    """
    places = np.array([(0, 0, 0), (30, 0, 0), (0, 30, 0), (30, 30, 0)])
    whole = trimesh.creation.capsule(height=14, radius=4, count=(8, 12))
    damaged = [FAMILIES[family](np.array(whole.vertices), whole.faces, 0.2, np.random.default_rng(i)) for i in (0, 1)]
    damaged += [(whole.vertices, whole.faces)] * 2
    scan = trimesh.util.concatenate(
        [trimesh.Trimesh(v + place, f, process=False) for (v, f), place in zip(damaged, places, strict=True)]
    )
    result = rlacd.decompose(scan, quality="fast", threads=1)
    holes = result.report.holes
    assert {tuple(places[np.linalg.norm(places - hole.at_abs, axis=1).argmin()]) for hole in holes} == {
        (0, 0, 0),
        (30, 0, 0),
    }
    points = np.concatenate([whole.vertices + place for place in places])
    missed = hull_union([hull for part in result if (hull := Hull.of(part.vertices))], 1).distance(
        np.ascontiguousarray(points)
    )
    lost = points[missed > 0.005 * np.ptp(points, axis=0).max() / 2]
    assert (len(lost) > 0) == (family == "missing patches")
    for point in lost:
        assert any(np.linalg.norm(point - hole.at_abs) <= hole.width_abs for hole in holes)
    (said,) = [line for line in result.report.warnings if "holes" in line.lower() or "open at" in line]
    named = re.findall(r"\(([^()]*, [^()]*, [^()]*)\), body (\d+)", said)
    assert len(named) == 5
    for place, body in named:
        hole = min(holes, key=lambda one: np.linalg.norm(np.array(one.at_abs) - [float(x) for x in place.split(",")]))
        assert np.allclose(hole.at_abs, [float(x) for x in place.split(",")], rtol=1e-3, atol=1e-6)
        assert int(body) == hole.body


@pytest.mark.parametrize("seed", range(4))
def test_faces_missing_from_flat_sides_come_back_exactly(seed):
    """A cap bends as little as it can, so what is missing of a box is a box again."""
    mesh = BOX.subdivide().subdivide()
    rest = without(mesh, *np.random.default_rng(seed).permutation(len(mesh.faces))[: len(mesh.faces) // 20])
    solid = solid_of(rest)
    assert volume(solid) == pytest.approx(8, rel=1e-9)


def test_a_loop_around_an_island_keeps_the_island():
    """A face that touches the rim of its hole in one vertex is in the cap, whichever way it is wound."""
    flat = trimesh.creation.box(extents=(4, 4, 1)).subdivide().subdivide().subdivide()
    top = np.flatnonzero(flat.triangles_center[:, 2] > 0.499)
    patch = top[np.abs(flat.triangles_center[top][:, :2]).max(axis=1) < 1]
    on_rim = np.isin(flat.faces, np.delete(flat.faces, patch, axis=0))
    touching = next(face for face in patch if on_rim[face].sum() == 1)
    for turn in (1, -1):
        faces = flat.faces.copy()
        faces[touching] = faces[touching][::turn]
        mesh = trimesh.Trimesh(flat.vertices, np.delete(faces, np.setdiff1d(patch, touching), axis=0), process=False)
        solid = solid_of(mesh, open_bodies="solid")
        assert volume(solid) == pytest.approx(16, rel=1e-9)


@pytest.mark.slow
@pytest.mark.parametrize("share", [0.05, 0.1, 0.2])
@pytest.mark.parametrize("seed", [0, 1, 2])
def test_a_person_with_fins_loses_nothing(corpus, share, seed):
    mesh = load_mesh(corpus / "test/capod/class13__m155.ply")
    vertices, faces = np.asarray(mesh.vertices), np.asarray(mesh.faces, dtype=np.int64)
    damaged = FAMILIES["fins"](vertices, faces, share, np.random.default_rng(seed))
    report = rlacd.decompose(trimesh.Trimesh(*damaged, process=False), quality="fast", threads=1).report
    assert report.hausdorff.missed <= 0.005
    over = report.hausdorff.added
    assert over <= 0.062
    beyond = [line for line in report.warnings if "beyond the input's surface" in line]
    assert len(beyond) == (over > 0.055)
    for line in beyond:  # where it says, the surface is that far away
        place = [float(x) for x in re.search(r"farthest near \(([^)]*)\)", line)[1].split(",")]
        frame = Frame.of(damaged[0])
        query = SurfaceQuery(frame.to_frame(damaged[0]), damaged[1])
        assert query.distance(frame.to_frame([place]))[0] == pytest.approx(over, abs=2e-3)


def test_rooms_are_left_where_filling_them_would_cost_more_triangles_than_surface(corpus):
    solid = repair(load_mesh(corpus / "train/kaykit_cc0/dungeon__crates_stacked.ply"))
    assert "wrapped" not in steps(solid)
    assert len(solid.faces) < 3000
