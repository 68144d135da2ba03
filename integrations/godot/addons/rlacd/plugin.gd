tool
extends EditorPlugin
# A dock with the options, and the nodes that it puts into the edited scene.

const Dock = preload("dock.gd")
const Hulls = preload("hulls.gd")

var _dock


func _enter_tree():
	_dock = Dock.new()
	_dock.connect("wanted", self, "_on_wanted")
	add_control_to_dock(DOCK_SLOT_RIGHT_UL, _dock)


func _exit_tree():
	remove_control_from_docks(_dock)
	_dock.queue_free()


func _on_wanted():
	_dock.say(make_hulls(_dock.command(), _dock.options()))


# Give every selected node a static body for each mesh in it or below it; returns what happened, in a sentence.
func make_hulls(command, options):
	var root = get_editor_interface().get_edited_scene_root()
	var selected = []
	for node in get_editor_interface().get_selection().get_transformable_selected_nodes():
		if node is Spatial and not node is CollisionObject:
			selected.append(node)
	if root == null or selected.empty():
		return "Select one or more nodes with meshes in the scene."
	var made = []
	for node in selected:
		for mesh in Hulls.meshes_below(node):
			var found = Hulls.decompose(mesh, node, command, options)
			if found.error != "":
				return "%s: %s" % [mesh.name, found.error]
			made.append({"node": node, "body": Hulls.body_of(mesh, node, found.hulls)})
	if made.empty():
		return "There is no mesh in the selected nodes."
	_put(made, selected, root)
	var count = 0
	for each in made:
		count += each.body.get_child_count()
	return "%s in %s." % [_counted(count, "shape", "shapes"), _counted(made.size(), "body", "bodies")]


func _counted(count, one, many):
	return "%d %s" % [count, one if count == 1 else many]


# One step that can be undone: bodies of an earlier run go, the new ones come.
func _put(made, selected, root):
	var steps = get_undo_redo()
	steps.create_action("Convex hulls (rlacd)")
	for node in selected:
		for child in node.get_children():
			if child.has_meta(Hulls.MARK):
				steps.add_do_method(node, "remove_child", child)
				steps.add_undo_method(self, "_add", node, child, root)
				steps.add_undo_reference(child)
	for each in made:
		steps.add_do_method(self, "_add", each.node, each.body, root)
		steps.add_do_reference(each.body)
		steps.add_undo_method(each.node, "remove_child", each.body)
	steps.commit_action()


# Nodes without an owner are neither shown in the scene's tree nor saved.
func _add(node, body, root):
	node.add_child(body, true)
	body.owner = root
	for shape in body.get_children():
		shape.owner = root
