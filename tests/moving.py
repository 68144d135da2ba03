"""Small robots of exact shape whose links come near each other and never touch; lengths in metres."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
import trimesh

Mesh = trimesh.Trimesh


@dataclass(frozen=True)
class Joint:
    """From one link to the next: ``revolute`` or ``prismatic``, its axis through a point, and its limits."""

    kind: str
    parent: str
    child: str
    axis: tuple[float, float, float]
    at: tuple[float, float, float]
    limits: tuple[float, float]


LINK = """<link name="{0}">
<inertial><mass value="1"/><inertia ixx="0.01" iyy="0.01" izz="0.01" ixy="0" ixz="0" iyz="0"/></inertial>
<collision><geometry><mesh filename="{0}.stl"/></geometry></collision></link>"""
JOINT = """<joint name="{0}_joint" type="{1}"><parent link="{2}"/><child link="{0}"/><origin xyz="{3}"/>
<axis xyz="{4}"/><limit lower="{5}" upper="{6}" effort="10" velocity="1"/></joint>"""


@dataclass(frozen=True)
class Robot:
    """Links in one frame, at rest."""

    name: str
    links: dict[str, Mesh]
    joints: tuple[Joint, ...]

    def write(self, folder: Path) -> Path:
        """Write it as URDF with an STL file a link."""
        origins = {joint.child: np.array(joint.at) for joint in self.joints}
        for name, mesh in self.links.items():
            mesh.copy().apply_translation(-origins.get(name, np.zeros(3))).export(folder / f"{name}.stl")
        lines = [LINK.format(name) for name in self.links]
        for joint in self.joints:
            at = np.array(joint.at) - origins.get(joint.parent, np.zeros(3))
            places = [" ".join(map(str, place)) for place in (at, joint.axis)]
            lines.append(JOINT.format(joint.child, joint.kind, joint.parent, *places, *joint.limits))
        path = folder / f"{self.name}.urdf"
        path.write_text("\n".join([f'<robot name="{self.name}">', *lines, "</robot>"]))
        return path


def block(lower: tuple[float, float, float], upper: tuple[float, float, float]) -> Mesh:
    """A box between two opposite corners."""
    box = trimesh.creation.box(bounds=np.sort([lower, upper], axis=0))
    assert isinstance(box, Mesh)
    return box


def rod(radius: float, half: float, sections: int = 48) -> Mesh:
    """A cylinder along y around the origin."""
    turned = trimesh.transformations.rotation_matrix(np.pi / 2, [1, 0, 0])
    return trimesh.creation.cylinder(radius, 2 * half, sections=sections, transform=turned)


def fork_and_lug(play: float = 0.002) -> Robot:
    """A fork with a pin across it, and a lug that turns on the pin, 300 mm together; they are `play` apart."""
    half, wall, eye = 0.015, 0.012, 0.03
    cheeks = [block((-0.05, side * half, -eye), (0, side * (half + wall), eye)) for side in (-1, 1)]
    ends = [rod(eye, wall / 2).apply_translation((0, side * (half + wall / 2), 0)) for side in (-1, 1)]
    bar = block((-0.15, -half - wall, -eye), (-0.05, half + wall, eye))
    fork = trimesh.boolean.union([*cheeks, *ends, bar, rod(0.01, half + wall)])
    thick = half - play
    arm = block((0, -thick, -eye + play), (0.15, thick, eye - play))
    lug = trimesh.boolean.difference([trimesh.boolean.union([rod(eye, thick), arm]), rod(0.01 + play, 0.05)])
    return Robot(
        "fork", {"fork": fork, "lug": lug}, (Joint("revolute", "fork", "lug", (0, 1, 0), (0, 0, 0), (-0.9, 0.9)),)
    )


def drawer(play: float = 0.003) -> Robot:
    """A cabinet of 400 mm, and a drawer that slides out of it, `play` apart on all sides."""
    shell = block((-0.2, -0.2, 0), (0.2, 0.2, 0.3))
    hollow = block((-0.18, -0.25, 0.02), (0.18, 0.18, 0.28))
    cabinet = trimesh.boolean.difference([shell, hollow])
    outer = block((-0.18 + play, -0.2, 0.02 + play), (0.18 - play, 0.18 - play, 0.2))
    inner = block((-0.165, -0.185, 0.04), (0.165, 0.16, 0.25))
    front = block((-0.195, -0.215 - play, 0.005), (0.195, -0.2 - play, 0.21))
    neck = block((-0.17, -0.21, 0.03), (0.17, -0.19, 0.19))
    box = trimesh.boolean.union([trimesh.boolean.difference([outer, inner]), front, neck])
    slide = Joint("prismatic", "cabinet", "drawer", (0, -1, 0), (0, 0, 0), (0.0, 0.3))
    return Robot("cabinet", {"cabinet": cabinet, "drawer": box}, (slide,))


ALL = (fork_and_lug, drawer)
