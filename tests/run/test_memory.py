"""Meshes that need more memory than is left are refused with one sentence; control groups limit what is left."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import psutil
import pytest
import trimesh

from rlacd import memory
from rlacd.errors import MeshDataError
from rlacd.io.read.load import load_mesh
from rlacd.repair.repair import repair


def test_what_is_left_is_no_more_than_the_machine_has() -> None:
    assert 0 < memory.memory_left() <= psutil.virtual_memory().total


@pytest.mark.parametrize("kind", ["ply", "stl", "obj"])
def test_a_file_that_declares_too_much_is_refused_before_it_is_parsed(kind: str, tmp_path: Path, monkeypatch) -> None:
    path = tmp_path / f"ball.{kind}"
    ball = trimesh.creation.icosphere(3)
    ball.export(path)
    monkeypatch.setattr(memory, "_UNQUESTIONED", 0)
    monkeypatch.setattr(memory, "memory_left", lambda: len(ball.faces) * memory.BYTES_READ - 1)
    monkeypatch.setattr(np, "frombuffer", lambda *_, **__: pytest.fail("it was parsed"))
    with pytest.raises(
        MeshDataError, match=r"ball\.\w+ has 1,280 triangles, which need about 0\.0 GB of memory"
    ) as error:
        load_mesh(path)
    assert "simplify it first" in str(error.value)


def test_a_closed_mesh_needs_less_than_one_that_has_to_be_repaired(monkeypatch) -> None:
    ball = trimesh.creation.icosphere(3)
    monkeypatch.setattr(memory, "_UNQUESTIONED", 0)
    monkeypatch.setattr(memory, "memory_left", lambda: len(ball.faces) * memory.BYTES_READ)
    assert repair(load_mesh(ball)).bodies[0].step == "closed"
    opened = load_mesh((ball.vertices, ball.faces[1:]))
    with pytest.raises(MeshDataError, match="1,279 triangles"):
        repair(opened)


@pytest.mark.parametrize("version", [1, 2])
def test_control_groups_limit_what_is_left(version: int, tmp_path: Path, monkeypatch) -> None:
    names = ["memory.limit_in_bytes", "memory.usage_in_bytes", "total_inactive_file"]
    names = ["memory.max", "memory.current", "inactive_file"] if version == 2 else names
    root = tmp_path / "memory" if version == 1 else tmp_path
    group = root / "outer" / "inner"
    group.mkdir(parents=True)
    for folder, limit in ((group, "max" if version == 2 else str(2**63)), (group.parent, "1000000")):
        (folder / names[0]).write_text(limit + "\n")
        (folder / names[1]).write_text("900000\n")
        (folder / "memory.stat").write_text(f"cache 5\n{names[2]} 40000\n")
    line = "0::/outer/inner" if version == 2 else "4:cpu,memory:/outer/inner"
    read = Path.read_text
    monkeypatch.setattr(memory, "_CGROUPS", tmp_path)
    monkeypatch.setattr(
        Path, "read_text", lambda self, *a, **k: line if str(self) == "/proc/self/cgroup" else read(self, *a, **k)
    )
    assert memory.memory_left() == 140_000
