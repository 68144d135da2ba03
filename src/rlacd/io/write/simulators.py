"""Models for simulators: MJCF (MuJoCo), URDF, and SDFormat (Gazebo, Drake), with mesh files in a folder beside them."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
from lxml import etree

from rlacd.io.write.model import TO_Z_UP, MeshFile, RigidBody, Shape, numbers
from rlacd.io.write.palette import hull_colors

if TYPE_CHECKING:
    from rlacd.extras.primitive import Primitive

LEAST_INERTIA = 1e-14
"""MuJoCo refuses moving bodies with less than 1e-15 of mass or inertia; those are rounded up."""

DRAKE = "http://drake.mit.edu"

_MOMENTS = {f"i{a}{b}": ("xyz".index(a), "xyz".index(b)) for a, b in ("xx", "xy", "xz", "yy", "yz", "zz")}


def encode_mjcf(model: RigidBody, shapes: list[Shape], visuals: list[MeshFile], folder: str) -> bytes:
    """A free body, with its hulls in class ``collision`` and the visible meshes in class ``visual``.

    Groups follow the convention of the MuJoCo Menagerie: 2 is visible, 3 collides and is hidden by default. Mesh files
    are in `folder`, relative to the model.
    """
    root = etree.Element("mujoco", model=model.name)
    compiler = etree.SubElement(root, "compiler", angle="radian")
    if min(model.mass.volume_abs, *np.linalg.eigvalsh(model.mass.inertia_abs)) < LEAST_INERTIA:
        compiler.set("boundmass", repr(LEAST_INERTIA))
        compiler.set("boundinertia", repr(LEAST_INERTIA))
    default = etree.SubElement(root, "default")
    for kind, collides, group in (("visual", "0", "2"), ("collision", "1", "3")):
        inner = etree.SubElement(default, "default", {"class": kind})
        etree.SubElement(inner, "geom", type="mesh", contype=collides, conaffinity=collides, group=group)
    asset = etree.SubElement(root, "asset")
    body = _body(model, asset, etree.SubElement(root, "worldbody"))

    def add(kind: str, name: str, file: MeshFile, **extra: str) -> None:
        # The body's mass is given, so the volume of a mesh does not matter; "shell" accepts open and flat ones too.
        etree.SubElement(asset, "mesh", name=name, file=f"{folder}/{file.name}", inertia="shell")
        geom = etree.SubElement(body, "geom", {"name": name, "class": kind, "mesh": name, **extra})
        if file.shift.any():
            geom.set("pos", numbers(file.shift))

    for visual in visuals:
        name = f"{model.name}_visual" if len(visuals) == 1 else visual.name.rpartition(".")[0]
        add("visual", name, visual, **_material(asset, name, visual, folder))
    colors = hull_colors(len(shapes))
    for (name, shape), color in zip(_named(model, shapes), colors, strict=True):
        rgba = numbers([*np.round(color / 255, 3), 1.0])
        if isinstance(shape, MeshFile):
            add("collision", name, shape, rgba=rgba)
        else:
            etree.SubElement(body, "geom", {"name": name, "class": "collision", **_geom(shape), "rgba": rgba})
    return _written(root)


def _body(model: RigidBody, asset: Any, world: Any) -> Any:
    """The free body, with its mass; in a scene, it stands over a floor."""
    if model.is_scene:
        _add_stage(asset, world)
    body = etree.SubElement(world, "body", name=model.name)
    if model.is_scene:
        body.set("pos", numbers([0.0, 0.0, _lift(model)]))
    if model.up != "z":
        body.set("quat", numbers(TO_Z_UP[model.up]))
    etree.SubElement(body, "freejoint", name=model.name)
    mass, inertia = model.mass, model.mass.inertia_abs
    moments = numbers([*np.diag(inertia), inertia[0, 1], inertia[0, 2], inertia[1, 2]])
    said = {"pos": numbers(mass.centre_abs), "mass": numbers([mass.volume_abs]), "fullinertia": moments}
    etree.SubElement(body, "inertial", said)
    return body


def _material(asset: Any, name: str, visual: MeshFile, folder: str) -> dict[str, str]:
    """Describe the looks of a visible mesh; returns the attributes of its geom."""
    if visual.look is None:
        return {}
    described = {"name": name, "rgba": numbers(visual.look.rgba)}
    if visual.look.picture is not None:
        etree.SubElement(asset, "texture", name=name, type="2d", file=f"{folder}/{visual.picture_name}")
        described["texture"] = name
    etree.SubElement(asset, "material", described)
    return {"material": name}


def _add_stage(asset: Any, world: Any) -> None:
    """A checkered floor and a light."""
    grid = {"builtin": "checker", "rgb1": "0.8 0.82 0.85", "rgb2": "0.7 0.72 0.75", "width": "300", "height": "300"}
    etree.SubElement(asset, "texture", {"name": "floor", "type": "2d", **grid})
    etree.SubElement(asset, "material", name="floor", texture="floor", texuniform="true", texrepeat="5 5")
    etree.SubElement(world, "light", pos="0 0 10", dir="0.3 0.2 -1", directional="true")
    etree.SubElement(world, "geom", name="floor", type="plane", size="0 0 0.05", material="floor")


def _lift(model: RigidBody) -> float:
    """How high the body has to stand for its lowest point to be a twentieth of its height above the floor."""
    axis = "xyz".index(model.up)
    bounds = np.array([hull.bounds[:, axis] for hull in model.hulls])
    lowest, highest = float(bounds[:, 0].min()), float(bounds[:, 1].max())
    return (highest - lowest) / 20 - lowest


def _geom(shape: Primitive) -> dict[str, str]:
    """The attributes of a geom; MJCF has half lengths."""
    radius, *length = shape.size
    size = [extent / 2 for extent in shape.size] if shape.kind == "box" else [radius, *(each / 2 for each in length)]
    placed = {"pos": numbers(shape.centre), "quat": numbers(shape.quaternion)}
    return {"type": shape.kind, "size": numbers(size), **placed}


def encode_urdf(model: RigidBody, shapes: list[Shape], visuals: list[MeshFile], folder: str) -> bytes:
    """A link with its mass, the visible mesh, and a ``<collision>`` per hull."""
    robot = etree.Element("robot", name=model.name)
    # MuJoCo reads URDF too, but by default looks for every mesh beside it and drops visual-only geometry.
    extension = etree.SubElement(robot, "mujoco")
    etree.SubElement(extension, "compiler", strippath="false", discardvisual="false")
    link = etree.SubElement(robot, "link", name=model.name)
    inertial = etree.SubElement(link, "inertial")
    etree.SubElement(inertial, "origin", xyz=numbers(model.mass.centre_abs), rpy="0 0 0")
    etree.SubElement(inertial, "mass", value=numbers([model.mass.volume_abs]))
    etree.SubElement(inertial, "inertia", _moments(model))
    for name, shape in _named(model, shapes, visuals):
        described = etree.SubElement(link, "visual" if shape in visuals else "collision", name=name)
        if isinstance(shape, MeshFile):
            etree.SubElement(described, "origin", xyz=numbers(shape.shift), rpy="0 0 0")
            said = "mesh", {"filename": f"{folder}/{shape.name}"}
        else:
            etree.SubElement(described, "origin", xyz=numbers(shape.centre), rpy=numbers(shape.roll_pitch_yaw))
            said = shape.kind, _sizes(shape)
        etree.SubElement(etree.SubElement(described, "geometry"), *said)
    return _written(robot)


def encode_sdf(model: RigidBody, shapes: list[Shape], visuals: list[MeshFile], folder: str) -> bytes:
    """A model for Gazebo and Drake, with a ``<collision>`` per hull."""
    root = etree.Element("sdf", version="1.11", nsmap={"drake": DRAKE})
    described = etree.SubElement(root, "model", name=model.name)
    if model.up != "z":
        _pose(described, (0, 0, 0), TO_Z_UP[model.up])
    link = etree.SubElement(described, "link", name=model.name)
    inertial = etree.SubElement(link, "inertial")
    _text(inertial, "pose", f"{numbers(model.mass.centre_abs)} 0 0 0")
    _text(inertial, "mass", numbers([model.mass.volume_abs]))
    inertia = etree.SubElement(inertial, "inertia")
    for tag, moment in _moments(model).items():
        _text(inertia, tag, moment)
    for name, shape in _named(model, shapes, visuals):
        part = etree.SubElement(link, "visual" if shape in visuals else "collision", name=name)
        if isinstance(shape, MeshFile):
            if shape.shift.any():
                _text(part, "pose", f"{numbers(shape.shift)} 0 0 0")
            mesh = etree.SubElement(etree.SubElement(part, "geometry"), "mesh")
            _text(mesh, "uri", f"{folder}/{shape.name}")
            if shape not in visuals:  # else Gazebo and Drake take the mesh for a surface, with far poorer contacts
                mesh.set("optimization", "convex_hull")
                etree.SubElement(mesh, f"{{{DRAKE}}}declare_convex")
            continue
        _pose(part, shape.centre, shape.quaternion)
        primitive = etree.SubElement(etree.SubElement(part, "geometry"), shape.kind)
        for tag, text in _sizes(shape).items():
            _text(primitive, tag, text)
    return _written(root)


def _named(model: RigidBody, shapes: list[Shape], visuals: list[MeshFile] = []) -> list[tuple[str, Shape]]:  # noqa: B006
    seen: list[tuple[str, Shape]] = [(f"{model.name}_visual", visual) for visual in visuals]
    return seen + [(f"{model.name}_{index:03d}", shape) for index, shape in enumerate(shapes)]


def _moments(model: RigidBody) -> dict[str, str]:
    return {name: numbers([model.mass.inertia_abs[at]]) for name, at in _MOMENTS.items()}


def _sizes(shape: Primitive) -> dict[str, str]:
    """The sizes of a primitive by the names that URDF and SDF share."""
    if shape.kind == "box":
        return {"size": numbers(shape.size)}
    return dict(zip(("radius", "length"), map(numbers, ([size] for size in shape.size)), strict=False))


def _pose(parent: Any, centre: Any, quaternion: Any) -> None:
    w, x, y, z = quaternion
    pose = etree.SubElement(parent, "pose", rotation_format="quat_xyzw")
    pose.text = f"{numbers(centre)} {numbers([x, y, z, w])}"


def _text(parent: Any, tag: str, text: str) -> None:
    etree.SubElement(parent, tag).text = text


def _written(root: Any) -> bytes:
    etree.indent(root)
    return bytes(etree.tostring(root, encoding="utf-8", xml_declaration=True)) + b"\n"
