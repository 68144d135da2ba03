"""The plugin for Godot's editor in a real Godot: its button is pressed, the scene is saved, and bodies collide."""

from __future__ import annotations

import json
import shutil
import stat
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import trimesh

from tests import godot

PLUGIN = Path(__file__).resolve().parents[1] / "integrations" / "godot" / "addons" / "rlacd"

TURN = trimesh.transformations.rotation_matrix(0.7, (1, 2, 3))
PLACE = trimesh.transformations.translation_matrix((3, 1, -2)) @ TURN @ np.diag([1.5, 1.5, 1.5, 1.0])

SCENE = """[gd_scene load_steps=2 format=2]

[ext_resource path="res://elbow.glb" type="PackedScene" id=1]

[node name="Room" type="Spatial"]

[node name="Bend" parent="." instance=ExtResource( 1 )]
transform = Transform( {} )
"""

# Presses the button of the plugin as a user does, twice: the second run replaces the bodies of the first.
DRIVER = """tool
extends EditorPlugin
var frames = 0
func _process(_delta):
	frames += 1
	var editor = get_editor_interface()
	if editor.get_resource_filesystem().is_scanning():
		frames = 0
	elif frames == 10:
		editor.open_scene_from_path("res://room.tscn")
	elif frames == 20:
		editor.get_selection().clear()
		editor.get_selection().add_node(editor.get_edited_scene_root().get_node("Bend"))
	elif frames == 30 or frames == 40:
		var dock = _find(get_tree().root, "res://addons/rlacd/dock.gd")
		dock._command.text = COMMAND if frames == 30 or not LAST else LAST
		for child in dock.get_children():
			if child is Button and not child is OptionButton:
				child.emit_signal("pressed")
		_say(dock._said.text)
	elif frames == 50:
		editor.save_scene()
		_say("done")
		get_tree().quit()
func _say(text):
	var file = File.new()
	file.open("res://" + ("done" if text == "done" else "said%d" % frames) + ".txt", File.WRITE)
	file.store_string(text)
	file.close()
func _find(node, script):
	if node.get_script() != null and node.get_script().resource_path == script:
		return node
	for child in node.get_children():
		var found = _find(child, script)
		if found != null:
			return found
"""

# Asks the physics where a small ball collides.
PROBE = """extends SceneTree
var frames = 0
func _init():
	root.add_child(load("res://room.tscn").instance())
func _iteration(_delta):
	frames += 1
	if frames != 3:
		return false
	var file = File.new()
	file.open("res://points.json", File.READ)
	var ball = SphereShape.new()
	ball.radius = 0.001
	var asked = PhysicsShapeQueryParameters.new()
	asked.set_shape(ball)
	var hits = ""
	for point in JSON.parse(file.get_as_text()).result:
		asked.transform = Transform(Basis(), Vector3(point[0], point[1], point[2]))
		var hit = root.world.direct_space_state.intersect_shape(asked, 1)
		hits += "0" if hit.empty() else "1"
	print("hits ", hits)
	var bend = root.get_node("Room/Bend")
	for child in bend.get_children():
		if child is StaticBody:
			print("body ", child.name, " ", child.get_child_count(), " ", child.transform == Transform.IDENTITY)
	print("end")
	quit()
"""


def elbow() -> trimesh.Trimesh:
    beams = ([(0, 0, 0), (2, 0.4, 0.4)], [(0, 0, 0), (0.4, 1.5, 0.4)])
    return trimesh.boolean.union([trimesh.creation.box(bounds=bounds) for bounds in beams])


def command(folder: Path) -> str:
    """This rlacd as a program."""
    path = folder / "rlacd.sh"
    path.write_text(f'#!/bin/sh\nexec "{sys.executable}" -m rlacd "$@" --threads 1\n')
    path.chmod(path.stat().st_mode | stat.S_IXUSR)
    return str(path)


def room(folder: Path, *, last: str = "") -> None:
    """A project with an elbow, turned, moved and stretched, in which both plugins have run."""
    godot.project(folder, "rlacd", "driver")
    shutil.copytree(PLUGIN, folder / "addons" / "rlacd")
    driver = folder / "addons" / "driver"
    driver.mkdir()
    (driver / "plugin.cfg").write_text('[plugin]\n\nname="driver"\nauthor=""\nversion="1"\nscript="plugin.gd"\n')
    constants = f"const COMMAND = {json.dumps(command(folder))}\nconst LAST = {json.dumps(last)}\n"
    head, _, rest = DRIVER.partition("var frames")
    (driver / "plugin.gd").write_text(f"{head}{constants}var frames{rest}")
    scene = trimesh.Scene()
    scene.add_geometry(elbow(), node_name="Elbow", transform=trimesh.transformations.scale_matrix(2.0))
    scene.export(folder / "elbow.glb")
    numbers = [*PLACE[:3, :3].ravel().tolist(), *PLACE[:3, 3].tolist()]
    (folder / "room.tscn").write_text(SCENE.format(", ".join(f"{number:.9g}" for number in numbers)))
    godot.edit(folder, until="done.txt")


def probed(folder: Path, points: Any) -> tuple[Any, list[list[str]]]:
    (folder / "points.json").write_text(json.dumps(points.tolist()))
    (folder / "probe.gd").write_text(PROBE)
    words = [line.split() for line in godot.play(folder, "probe.gd").splitlines()]
    hits = next(line[1] for line in words if line[:1] == ["hits"])
    return np.array([letter == "1" for letter in hits]), [line[1:] for line in words if line[:1] == ["body"]]


@pytest.mark.nightly
def test_the_button_makes_bodies_that_collide_where_the_mesh_is(tmp_path: Path) -> None:
    room(tmp_path)
    for frame in (30, 40):
        assert (tmp_path / f"said{frame}.txt").read_text() == "2 shapes in 1 body."
    placed = elbow().apply_scale(2.0).apply_transform(PLACE)
    low, high = 2 * elbow().bounds
    points = trimesh.transform_points(np.random.default_rng(0).uniform(low, high, size=(400, 3)), PLACE)
    depth = trimesh.proximity.signed_distance(placed, points)
    points, inside = points[abs(depth) > 0.2], depth[abs(depth) > 0.2] > 0
    assert 20 < inside.sum() < len(inside) - 20
    hits, bodies = probed(tmp_path, points)
    assert bodies == [["Elbow_hulls", "2", "True"]], "one body, of the second run, not scaled"
    assert (hits == inside).all()


@pytest.mark.nightly
def test_a_command_that_is_missing_is_said_to_be(tmp_path: Path) -> None:
    room(tmp_path, last="/nowhere/rlacd")
    said = (tmp_path / "said40.txt").read_text()
    assert said.startswith("Elbow: ")
    assert "/nowhere/rlacd" in said
    assert "pip install rlacd" in said
    _, bodies = probed(tmp_path, np.zeros((1, 3)))
    assert bodies == [["Elbow_hulls", "2", "True"]], "those of the first run stay"
