"""MJCF: a free body for MuJoCo, with its hulls in class ``collision`` and the visible mesh in class ``visual``."""

from __future__ import annotations

import numpy as np
from lxml import etree

from rlacd.io.write.model import TO_Z_UP, MeshFile, Model, Shape, numbers
from rlacd.io.write.palette import hull_colors
from rlacd.solid.primitive import Primitive

LEAST_INERTIA = 1e-14
"""MuJoCo refuses moving bodies with less than 1e-15 of mass or inertia; those are rounded up."""


def encode_mjcf(model: Model, shapes: list[Shape], visual: MeshFile | None, folder: str) -> bytes:
    """Describe the body; mesh files are in `folder`, relative to the model.

    Groups follow the convention of the MuJoCo Menagerie: 2 is visible, 3 collides and is hidden by default.
    """
    root = etree.Element("mujoco", model=model.name)
    compiler = etree.SubElement(root, "compiler", angle="radian")
    if min(model.mass.volume_abs, *np.linalg.eigvalsh(model.mass.inertia_abs)) < LEAST_INERTIA:
        compiler.set("boundmass", repr(LEAST_INERTIA))
        compiler.set("boundinertia", repr(LEAST_INERTIA))
    default = etree.SubElement(root, "default")
    looks = etree.SubElement(default, "default", {"class": "visual"})
    etree.SubElement(looks, "geom", type="mesh", contype="0", conaffinity="0", group="2")
    collides = etree.SubElement(default, "default", {"class": "collision"})
    etree.SubElement(collides, "geom", type="mesh", contype="1", conaffinity="1", group="3")

    asset = etree.SubElement(root, "asset")
    world = etree.SubElement(root, "worldbody")
    if model.is_scene:
        _add_stage(asset, world)
    body = etree.SubElement(world, "body", name=model.name)
    if model.is_scene:
        body.set("pos", numbers([0.0, 0.0, _lift(model)]))
    if model.up != "z":
        body.set("quat", numbers(TO_Z_UP[model.up]))
    etree.SubElement(body, "freejoint", name=model.name)
    mass, inertia = model.mass, model.mass.inertia_abs
    etree.SubElement(
        body,
        "inertial",
        pos=numbers(mass.centre_abs),
        mass=numbers([mass.volume_abs]),
        fullinertia=numbers([*np.diag(inertia), inertia[0, 1], inertia[0, 2], inertia[1, 2]]),
    )

    def add(kind: str, name: str, file: MeshFile, **extra: str) -> None:
        # The body's mass is given above, so the volume of a mesh does not matter; "shell" accepts open and flat ones
        # too.
        etree.SubElement(asset, "mesh", name=name, file=f"{folder}/{file.name}", inertia="shell")
        geom = etree.SubElement(body, "geom", {"name": name, "class": kind, "mesh": name, **extra})
        if file.shift.any():
            geom.set("pos", numbers(file.shift))

    if visual is not None:
        add("visual", f"{model.name}_visual", visual)
    for index, (shape, color) in enumerate(zip(shapes, hull_colors(len(shapes)), strict=True)):
        name, rgba = f"{model.name}_{index:03d}", numbers([*np.round(color / 255, 3), 1.0])
        if isinstance(shape, MeshFile):
            add("collision", name, shape, rgba=rgba)
        else:
            etree.SubElement(body, "geom", {"name": name, "class": "collision", **_primitive(shape), "rgba": rgba})
    etree.indent(root)
    return bytes(etree.tostring(root, encoding="utf-8", xml_declaration=True)) + b"\n"


def _add_stage(asset: etree._Element, world: etree._Element) -> None:
    """A checkered floor and a light."""
    grid = {"builtin": "checker", "rgb1": "0.8 0.82 0.85", "rgb2": "0.7 0.72 0.75", "width": "300", "height": "300"}
    etree.SubElement(asset, "texture", {"name": "floor", "type": "2d", **grid})
    etree.SubElement(asset, "material", name="floor", texture="floor", texuniform="true", texrepeat="5 5")
    etree.SubElement(world, "light", pos="0 0 10", dir="0.3 0.2 -1", directional="true")
    etree.SubElement(world, "geom", name="floor", type="plane", size="0 0 0.05", material="floor")


def _lift(model: Model) -> float:
    """How high the body has to stand for its lowest point to be a twentieth of its height above the floor."""
    axis = "xyz".index(model.up)
    bounds = np.array([hull.bounds[:, axis] for hull in model.hulls])
    lowest, highest = float(bounds[:, 0].min()), float(bounds[:, 1].max())
    return (highest - lowest) / 20 - lowest


def _primitive(shape: Primitive) -> dict[str, str]:
    """The attributes of a geom; MJCF has half lengths."""
    radius, *length = shape.size
    size = [extent / 2 for extent in shape.size] if shape.kind == "box" else [radius, *(each / 2 for each in length)]
    return {
        "type": shape.kind,
        "size": numbers(size),
        "pos": numbers(shape.centre),
        "quat": numbers(shape.quaternion),
    }
