"""Closed cavities: filled or kept, told, and never weighed. Masses are compared with trimesh's."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
import trimesh
from lxml import etree

import rlacd
from rlacd.errors import OptionError
from tests.models import mujoco_model
from tests.repair.repaired import BOX, join, moved, solid_of, volume, without


def inverted(mesh: Any) -> Any:
    return trimesh.Trimesh(mesh.vertices, mesh.faces[:, ::-1], process=False)


def cube(side: float) -> Any:
    return trimesh.creation.box(extents=(side,) * 3)


def slabs() -> Any:
    """Six walls 0.2 thick around a room, as bodies of their own."""
    sizes = {2: (2.0, 2.0, 0.2), 0: (0.2, 2.0, 1.6), 1: (1.6, 0.2, 1.6)}
    walls = [
        (trimesh.creation.box(extents=size), 0.9 * side * np.eye(3)[k]) for k, size in sizes.items() for side in (1, -1)
    ]
    return join(*(moved(wall, *place) for wall, place in walls))


HOLLOW, BALL = join(BOX, inverted(cube(1.9))), trimesh.creation.icosphere(subdivisions=2)
ROOM = join(BOX, inverted(cube(1.6)), cube(0.4))
MATRYOSHKA = join(BOX, inverted(cube(1.6)), moved(join(cube(1.0), inverted(cube(0.6))), 0.2, 0.1, 0))
CAVITIES = {
    "hollow": (HOLLOW, 8, 1),
    "a room with a stool": (ROOM, 8, 1),
    "inside out": (inverted(ROOM), 8, 1),
    "slabs": (join(slabs(), cube(0.4)), 8, 1),
    "a cavity in what stands in a cavity": (MATRYOSHKA, 8, 2),
    "two, one at an edge of the other's box": (
        join(BOX, inverted(moved(cube(0.8), -0.5, 0, 0)), inverted(moved(cube(0.6), 0.4, 0.5, 0))),
        *(8, 2),
    ),
    "against a wall": (
        join(BOX, inverted(moved(cube(0.8), 0.6, 0.2, 0.1)), inverted(moved(cube(0.4), -0.6, 0, 0))),
        8,
        2,
    ),
    "a cracked wall": (join(BOX, inverted(without(BALL, 7))), 8, 1),
    "side by side": (join(moved(BALL, -2, 0, 0), inverted(moved(BALL, 2, 0, 0))), 2 * BALL.volume, 0),
}
"""Each with its volume without cavities, and how many there are."""


def bounded(name: str) -> Any:
    """A closed mesh whose faces bound what those of the case do, outwards."""
    if name == "side by side":
        return join(moved(BALL, -2, 0, 0), moved(BALL, 2, 0, 0))
    mesh = join(BOX, inverted(BALL)) if name == "a cracked wall" else CAVITIES[name][0]
    return inverted(mesh) if mesh.volume < 0 else mesh


@pytest.mark.parametrize("name", CAVITIES)
def test_closed_cavities_are_filled_or_kept_whatever_their_windings(name: str) -> None:
    mesh, filled, _ = CAVITIES[name]
    assert volume(solid_of(mesh)) == pytest.approx(filled)
    assert volume(solid_of(mesh, keep_cavities=True)) == pytest.approx(bounded(name).volume)


@pytest.mark.parametrize("keep", [False, True])
@pytest.mark.parametrize("name", CAVITIES)
@pytest.mark.promise("mass")
def test_a_body_weighs_what_its_windings_bound_and_a_filled_cavity_is_told(name: str, keep: bool) -> None:
    mesh, filled, count = CAVITIES[name]
    mesh, judge = (moved(one, 3, -2, 1).apply_scale(0.1) for one in (mesh, bounded(name)))
    report = rlacd.decompose(mesh, keep_cavities=keep, quality="fast", threads=1).report
    mass = report.mass
    assert mass.volume_abs == pytest.approx(judge.volume)
    assert mass.centre_abs == pytest.approx(judge.center_mass)
    assert np.array(mass.inertia_abs) == pytest.approx(judge.moment_inertia, abs=1e-9 * judge.moment_inertia.max())
    said = [warning for warning in report.warnings if "cavit" in warning]
    assert len(said) == (count > 0 and not keep)
    if said:
        assert said[0].startswith(f"{count} closed cavit")
        assert f"volume {filled / 1000 - judge.volume:.4g}" in said[0]


@pytest.mark.parametrize("criterion", [None, "distance", "volume"])
def test_a_kept_cavity_stays_free_by_every_criterion(criterion: Any) -> None:
    ball = moved(trimesh.creation.icosphere(radius=0.7), 0.05, 0, 0).vertices
    kept = rlacd.decompose(ROOM, criterion=criterion, keep_cavities=True, threads=1)
    stool = np.abs(ball).max(axis=1) < 0.25
    assert not any(hull.contains(ball[~stool]).any() for hull in kept)
    assert kept.report.warnings == ()
    assert len(rlacd.decompose(ROOM, criterion=criterion, threads=1)) == 1


def test_navigable_space_says_by_itself_whether_balls_get_into_cavities() -> None:
    with pytest.raises(OptionError, match=r"keep_cavities .* seeds or reachable_only=False"):
        rlacd.decompose(ROOM, criterion=rlacd.NavigableSpace(0.2), keep_cavities=True)
    space = rlacd.NavigableSpace(0.2, 0.02, seeds=[[0.5, 0.5, 0.5]])
    assert len(rlacd.decompose(ROOM, criterion=space, keep_cavities=True, threads=1)) > 1


def test_what_sheets_enclose_weighs_as_much_as_what_repair_makes_of_it() -> None:
    """Sheets have no inside by their windings, nor has a cavity that only they close."""
    lid = np.flatnonzero(BOX.face_normals[:, 2] > 0.9)
    apart = join(without(BOX, *lid), moved(trimesh.Trimesh(BOX.vertices, BOX.faces[lid]), 0, 0, 0.01))
    result = rlacd.decompose(apart, threads=1)
    assert result.report.mass.volume_abs == pytest.approx(8, rel=0.02)


@pytest.mark.parametrize("ending", ["xml", "urdf", "sdf", "usda"])
@pytest.mark.promise("mass")
def test_files_weigh_a_hollow_body_as_the_input_does(tmp_path: Path, ending: str) -> None:
    path = rlacd.decompose(HOLLOW, threads=1).save(tmp_path / f"box.{ending}")
    moment = HOLLOW.moment_inertia[0, 0] * 1000
    if ending == "xml":
        model = mujoco_model(path)
        found = model.body_mass[1], model.body_inertia[1][0]
    elif ending == "usda":
        physics = pytest.importorskip("pxr.UsdPhysics", reason="the extra usd is not installed")
        from pxr import Usd

        stage = Usd.Stage.Open(str(path))
        body = physics.MassAPI(stage.GetDefaultPrim())
        found = body.GetMassAttr().Get(), body.GetDiagonalInertiaAttr().Get()[0]
    else:
        inertial = etree.parse(path).find(".//inertial")
        mass, first = inertial.find("mass"), inertial.find("inertia")
        found = tuple(map(float, (mass.get("value") or mass.text, first.get("ixx") or first.findtext("ixx"))))
    assert found == pytest.approx((HOLLOW.volume * 1000, moment), rel=1e-5)


@pytest.mark.promise("robot-mass")
def test_robots_keep_the_mass_of_hollow_meshes(tmp_path: Path) -> None:
    HOLLOW.export(tmp_path / "box.stl")
    shape = "<asset><mesh name='box' file='box.stl' inertia='exact'/></asset>"
    body = "<body><freejoint/><geom type='mesh' mesh='box'/></body>"
    (tmp_path / "robot.xml").write_text(f"<mujoco>{shape}<worldbody>{body}</worldbody></mujoco>")
    done = rlacd.rewrite_robot(tmp_path / "robot.xml", tmp_path / "out.xml", threads=1)
    assert mujoco_model(done.path).body_mass[1] == pytest.approx(HOLLOW.volume * 1000, rel=1e-5)
    assert any("1 closed cavity" in warning for warning in done.warnings)
