tool
extends Reference
# From a mesh to convex shapes, by the command `rlacd decompose`.
#
# A mesh is decomposed in the space of the node that gets the body, with all transforms between the two applied:
# physics bodies must not be scaled.

const MARK = "rlacd_hulls_of"  # metadata of a body: the name of the mesh that it was made for


# All visible meshes in a node and below it.
static func meshes_below(node):
	var found = []
	if node is MeshInstance and node.mesh != null and node.visible:
		found.append(node)
	for child in node.get_children():
		if not child is CollisionObject:
			found += meshes_below(child)
	return found


# Returns {"hulls": [PoolVector3Array, ...], "error": ""}.
static func decompose(mesh, node, command, options):
	var from = OS.get_user_data_dir().plus_file("rlacd_%d.stl" % OS.get_process_id())
	var to = from.get_basename() + "_hulls.obj"
	var files = Directory.new()
	if not files.dir_exists(OS.get_user_data_dir()):
		files.make_dir_recursive(OS.get_user_data_dir())
	if _write(from, mesh, node) != OK:
		return {"hulls": [], "error": "cannot write %s" % from}
	var said = []
	var given = ["decompose", from, "-o", to, "--preset", "godot", "--quiet"] + options
	var code = OS.execute(command, given, true, said, true)
	var text = "" if said.empty() else said[0].strip_edges()
	var hulls = _read(to) if code == 0 else []
	for path in [from, to]:
		files.remove(path)
	if not hulls.empty():
		return {"hulls": hulls, "error": ""}
	var install = "cannot run %s; install it with  pip install rlacd  or give its path" % command
	var missing = text == "" or code == 127  # what shells say of a program that is not there
	return {"hulls": [], "error": install if missing else text}


# A body with a shape for each hull, to be put below `node`.
static func body_of(mesh, node, hulls):
	var body = StaticBody.new()
	body.name = "%s_hulls" % mesh.name
	body.set_meta(MARK, mesh.name)
	for index in hulls.size():
		var shape = ConvexPolygonShape.new()
		shape.points = hulls[index]
		var place = CollisionShape.new()
		place.name = "hull_%03d" % index
		place.shape = shape
		body.add_child(place)
	return body


# Binary STL, which holds floats as they are.
static func _write(path, mesh, node):
	var way = Transform.IDENTITY
	var at = mesh
	while at != node:
		if at is Spatial:
			way = at.transform * way
		at = at.get_parent()
	var corners = mesh.mesh.get_faces()
	var file = File.new()
	var failed = file.open(path, File.WRITE)
	if failed != OK:
		return failed
	for _i in 20:
		file.store_32(0)
	file.store_32(corners.size() / 3)
	for first in range(0, corners.size(), 3):
		for _i in 3:
			file.store_float(0.0)
		for corner in [first, first + 2, first + 1]:  # in Godot front faces turn clockwise
			var point = way.xform(corners[corner])
			file.store_float(point.x)
			file.store_float(point.y)
			file.store_float(point.z)
		file.store_16(0)
	file.close()
	return OK


# The vertices of each object of an OBJ file.
static func _read(path):
	var file = File.new()
	var hulls = []
	if file.open(path, File.READ) != OK:
		return hulls
	var points = PoolVector3Array()
	while not file.eof_reached():
		var words = file.get_line().split(" ", false)
		if words.size() > 1 and words[0] == "o" and points.size() > 0:
			hulls.append(points)
			points = PoolVector3Array()
		elif words.size() > 3 and words[0] == "v":
			points.append(Vector3(float(words[1]), float(words[2]), float(words[3])))
	file.close()
	if points.size() > 0:
		hulls.append(points)
	return hulls
