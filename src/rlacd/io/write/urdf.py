"""URDF: a link with its mass, the visible mesh, and a ``<collision>`` per hull."""

from __future__ import annotations

from lxml import etree

from rlacd.io.write.model import MeshFile, Model, Shape, numbers, primitive_sizes


def encode_urdf(model: Model, shapes: list[Shape], visual: MeshFile | None, folder: str) -> bytes:
    """Describe the body; mesh files are in `folder`, relative to the model."""
    robot = etree.Element("robot", name=model.name)
    # MuJoCo reads URDF too, but by default looks for every mesh beside it and drops visual-only geometry.
    extension = etree.SubElement(robot, "mujoco")
    etree.SubElement(extension, "compiler", strippath="false", discardvisual="false")
    link = etree.SubElement(robot, "link", name=model.name)
    inertial = etree.SubElement(link, "inertial")
    etree.SubElement(inertial, "origin", xyz=numbers(model.mass.centre_abs), rpy="0 0 0")
    etree.SubElement(inertial, "mass", value=numbers([model.mass.volume_abs]))
    axes = {"x": 0, "y": 1, "z": 2}
    etree.SubElement(
        inertial,
        "inertia",
        {
            f"i{a}{b}": numbers([model.mass.inertia_abs[axes[a], axes[b]]])
            for a, b in ("xx", "xy", "xz", "yy", "yz", "zz")
        },
    )

    def add(kind: str, shape: Shape, name: str) -> None:
        described = etree.SubElement(link, kind, name=name)
        if isinstance(shape, MeshFile):
            etree.SubElement(described, "origin", xyz=numbers(shape.shift), rpy="0 0 0")
            geometry = etree.SubElement(described, "geometry")
            etree.SubElement(geometry, "mesh", filename=f"{folder}/{shape.name}")
        else:
            etree.SubElement(described, "origin", xyz=numbers(shape.centre), rpy=numbers(shape.roll_pitch_yaw))
            etree.SubElement(etree.SubElement(described, "geometry"), shape.kind, primitive_sizes(shape))

    if visual is not None:
        add("visual", visual, f"{model.name}_visual")
    for index, shape in enumerate(shapes):
        add("collision", shape, f"{model.name}_{index:03d}")
    etree.indent(robot)
    return bytes(etree.tostring(robot, encoding="utf-8", xml_declaration=True)) + b"\n"
