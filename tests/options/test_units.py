"""Units and the up axis: what a file says, what options say, and that Python and the command line agree."""

from __future__ import annotations

import re
import warnings
from pathlib import Path

import numpy as np
import pytest
import trimesh
from click.testing import CliRunner
from lxml import etree

import rlacd
from rlacd.cli.main import app
from rlacd.errors import OptionError
from rlacd.io.write.model import SHEET
from rlacd.solid.frame import HALF_THICKNESS
from tests.assets import write_mesh
from tests.models import TABLE_VOLUME, decomposed_table, fall_in_mujoco, table

UP = {"glb": "y", "gltf": "y", "obj": "z", "stl": "z", "ply": "z", "off": "z", "dae": "z", "3mf": "z"}
"""The axis that points up in files of each format that say nothing else."""


def told(path: Path, axis: str, metres: float) -> None:
    """Put an up axis and a unit into a COLLADA file."""
    text = path.read_text()
    head, _, rest = text.partition("<asset>")
    _, _, rest = rest.partition("</asset>")
    said = f'<asset><unit name="u" meter="{metres:g}"/><up_axis>{axis.upper()}_UP</up_axis></asset>'
    path.write_text(head + said + rest)


@pytest.mark.parametrize("ending", [*UP, "dae x", "dae y"])
def test_python_and_the_command_line_agree_on_what_points_up(tmp_path: Path, ending: str) -> None:
    ending, _, axis = ending.partition(" ")
    path = write_mesh(table(), tmp_path / f"chair.{ending}")
    up = axis or UP[ending]
    if ending == "dae":
        told(path, up, 1.0)
    result = rlacd.decompose(path, threads=1)
    assert result.report.up == up
    result.save(tmp_path / "python" / "chair.xml")
    run = CliRunner().invoke(
        app,
        ["decompose", str(path), "-o", str(tmp_path / "shell" / "chair.xml"), "--threads", "1", "--density", "1000"],
    )
    assert run.exit_code == 0, run.output
    by_python, by_shell = ((tmp_path / way / "chair.xml").read_bytes() for way in ("python", "shell"))
    assert by_python == by_shell
    body = etree.fromstring(by_python).find("worldbody/body")
    assert (body.get("quat") is None) == (up == "z")


def test_units_that_files_state(tmp_path: Path) -> None:
    assert rlacd.decompose(write_mesh(table(), tmp_path / "chair.glb"), threads=1).report.metres == 1.0
    assert rlacd.decompose(write_mesh(table(), tmp_path / "chair.3mf"), threads=1).report.metres == 1e-3
    assert rlacd.decompose(write_mesh(table(), tmp_path / "chair.stl"), threads=1).report.metres is None
    path = write_mesh(table(), tmp_path / "chair.dae")
    told(path, "z", 0.0254)
    in_inches = rlacd.decompose(path, threads=1)
    assert in_inches.report.metres == pytest.approx(0.0254)
    assert np.allclose(in_inches.source.extents, table().extents, atol=1e-6)  # as they are, unless asked for
    in_metres = rlacd.decompose(path, threads=1, unit="file")
    assert np.allclose(in_metres.source.extents, table().extents * 0.0254, atol=1e-7)
    assert not any("overrides" in said for said in in_metres.report.warnings)
    otherwise = rlacd.decompose(path, threads=1, unit="mm").report.warnings
    assert any("the unit of chair.dae is 0.0254 m" in said and "--unit mm overrides" in said for said in otherwise)
    with pytest.raises(OptionError, match="does not say its unit"):
        rlacd.decompose(write_mesh(table(), tmp_path / "chair.ply"), unit="file")


@pytest.mark.parametrize(("unit", "metres"), [("mm", 1e-3), ("cm", 1e-2), ("m", 1.0), ("in", 0.0254)])
def test_a_unit_and_a_factor_convert_everything(unit: str, metres: float) -> None:
    plain = rlacd.decompose(table(), quality="fast", threads=1)
    result = rlacd.decompose(table(), quality="fast", unit=unit, scale=2.0, threads=1)  # type: ignore[arg-type]
    factor = 2 * metres
    assert len(result) == len(plain)
    assert result.report.mass.volume_abs == pytest.approx(TABLE_VOLUME * factor**3, rel=1e-6)
    volumes = [sorted(hull.volume for hull in each) for each in (result, plain)]
    assert np.allclose(volumes[0], np.array(volumes[1]) * factor**3, rtol=1e-6, atol=0)
    assert np.allclose(result.source.vertices, plain.source.vertices * factor, rtol=1e-12, atol=0)


def test_a_mass_of_ones_own(tmp_path: Path) -> None:
    rest = fall_in_mujoco(decomposed_table().save(tmp_path / "table.xml", mass=3.5))
    assert rest.mass == pytest.approx(3.5, rel=1e-6)
    with pytest.raises(OptionError, match="mass"):
        decomposed_table().save(tmp_path / "table.xml", mass=-1.0)
    with pytest.raises(OptionError, match="density is 1000"):
        decomposed_table().save(tmp_path / "table.xml", mass=1.0, density=1000.0)  # the default, but given


@pytest.mark.parametrize("ending", ["xml", "urdf", "sdf"])
@pytest.mark.parametrize(
    ("factor", "says"),
    [(1000, "--unit mm or --unit cm converts"), (1e4, "--unit mm converts"), (1e7, "--scale"), (1e-3, "--scale")],
)
def test_an_implausible_body_is_doubted_with_what_would_help(
    tmp_path: Path, ending: str, factor: float, says: str
) -> None:
    """A table of 0.4 m, in other units; none makes one of a body of 0.4 mm."""
    big = table().apply_scale(factor)
    result = rlacd.decompose(big, threads=1, quality="fast")
    with pytest.warns(
        rlacd.ImplausibleBodyWarning, match=rf"{re.escape(f'{0.4 * factor:.3g}')} m long .*in metres: {says}"
    ):
        result.save(tmp_path / f"table.{ending}")
    big.export(tmp_path / "big.stl")
    said = CliRunner().invoke(app, ["decompose", str(tmp_path / "big.stl"), "-o", str(tmp_path / f"cli.{ending}")])
    assert f"in metres: {says}" in said.output
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        result.save(tmp_path / "table.obj")
        rlacd.decompose(big, scale=1 / factor, quality="fast", threads=1).save(tmp_path / f"small.{ending}")


@pytest.mark.parametrize(("units", "metres"), [("mm", 0.001), ("meters", 1.0), ("inches", 0.0254)])
def test_the_unit_that_a_trimesh_object_states_is_known(units: str, metres: float) -> None:
    mesh = trimesh.creation.box((40, 30, 20))
    mesh.units = units
    for given in (mesh, trimesh.Scene(mesh)):
        result = rlacd.decompose(given, threshold=f"{1000 * metres}mm", quality="fast", threads=1)
        assert result.report.options["threshold_abs"] == pytest.approx(1.0)
        assert result.report.metres == pytest.approx(metres)
    mesh.units = "unknown"
    with pytest.raises(OptionError, match="does not say its unit"):
        rlacd.decompose(mesh, threshold="1mm")


def test_a_hollow_shell_is_doubted_unless_its_mass_is_given(tmp_path: Path) -> None:
    """A box of faces without its lid: repair makes its walls a thousandth of its longest side thick."""
    walls = trimesh.creation.box((0.2, 0.2, 0.2))
    walls.update_faces(walls.face_normals[:, 2] < 0.5)
    shell = rlacd.decompose(walls, openings="thin", quality="fast", threads=1)
    assert [body.step for body in shell.report.repair] == [SHEET]
    assert shell.report.mass.volume_abs == pytest.approx(5 * 0.2**2 * 2 * HALF_THICKNESS * 0.1, rel=0.02)
    with pytest.warns(rlacd.ImplausibleBodyWarning, match=r"hollow shell .* walls 0.0002 units thick"):
        shell.save(tmp_path / "shell.xml")
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        shell.save(tmp_path / "shell.xml", mass=0.3)
        shell.save(tmp_path / "shell.glb")
        decomposed_table().save(tmp_path / "table.xml")


def test_a_scene_has_a_floor_to_land_on(tmp_path: Path) -> None:
    mujoco = pytest.importorskip("mujoco", reason="the extra sim is not installed")
    upright = table().apply_transform(trimesh.transformations.rotation_matrix(-np.pi / 2, (1, 0, 0)))
    result = rlacd.decompose(upright, threads=1)
    model = mujoco.MjModel.from_xml_path(str(result.save(tmp_path / "table.xml", scene=True, up="y")))
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    assert data.ncon == 0
    for _ in range(1000):
        mujoco.mj_step(model, data)
    assert data.ncon > 0
    assert np.abs(data.qvel).max() < 0.05
    assert 0.1 < data.xipos[1][2] < 0.2  # it stands on its legs
    with pytest.raises(OptionError, match="MJCF"):
        result.save(tmp_path / "table.urdf", scene=True)
