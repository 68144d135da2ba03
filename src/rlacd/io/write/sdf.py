"""SDFormat: a model for Gazebo and Drake, with a ``<collision>`` per hull."""

from __future__ import annotations

from lxml import etree

from rlacd.io.write.model import TO_Z_UP, MeshFile, Model, Shape, numbers, primitive_sizes

DRAKE = "http://drake.mit.edu"


def encode_sdf(model: Model, shapes: list[Shape], visual: MeshFile | None, folder: str) -> bytes:
    """Describe the body; mesh files are in `folder`, relative to the model."""
    root = etree.Element("sdf", version="1.9", nsmap={"drake": DRAKE})
    described = etree.SubElement(root, "model", name=model.name)
    if model.up != "z":
        w, x, y, z = TO_Z_UP[model.up]
        pose = etree.SubElement(described, "pose", rotation_format="quat_xyzw")
        pose.text = f"0 0 0 {numbers([x, y, z, w])}"
    link = etree.SubElement(described, "link", name=model.name)
    inertial = etree.SubElement(link, "inertial")
    _text(inertial, "pose", f"{numbers(model.mass.centre_abs)} 0 0 0")
    _text(inertial, "mass", numbers([model.mass.volume_abs]))
    inertia = etree.SubElement(inertial, "inertia")
    axes = {"x": 0, "y": 1, "z": 2}
    for a, b in ("xx", "xy", "xz", "yy", "yz", "zz"):
        _text(inertia, f"i{a}{b}", numbers([model.mass.inertia_abs[axes[a], axes[b]]]))

    def add(kind: str, file: MeshFile, name: str) -> etree._Element:
        shape = etree.SubElement(link, kind, name=name)
        if file.shift.any():
            _text(shape, "pose", f"{numbers(file.shift)} 0 0 0")
        mesh = etree.SubElement(etree.SubElement(shape, "geometry"), "mesh")
        _text(mesh, "uri", f"{folder}/{file.name}")
        return mesh

    if visual is not None:
        add("visual", visual, f"{model.name}_visual")
    for index, shape in enumerate(shapes):
        name = f"{model.name}_{index:03d}"
        if isinstance(shape, MeshFile):
            # Without this element Drake treats the mesh as a surface, with far poorer contacts.
            etree.SubElement(add("collision", shape, name), f"{{{DRAKE}}}declare_convex")
            continue
        collision = etree.SubElement(link, "collision", name=name)
        w, x, y, z = shape.quaternion
        pose = etree.SubElement(collision, "pose", rotation_format="quat_xyzw")
        pose.text = f"{numbers(shape.centre)} {numbers([x, y, z, w])}"
        primitive = etree.SubElement(etree.SubElement(collision, "geometry"), shape.kind)
        for tag, text in primitive_sizes(shape).items():
            _text(primitive, tag, text)
    etree.indent(root)
    return bytes(etree.tostring(root, encoding="utf-8", xml_declaration=True)) + b"\n"


def _text(parent: etree._Element, tag: str, text: str) -> None:
    etree.SubElement(parent, tag).text = text
