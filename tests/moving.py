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


@dataclass(frozen=True)
class Robot:
    """Links in one frame, at rest."""

    name: str
    links: dict[str, Mesh]
    joints: tuple[Joint, ...]

    def write(self, folder: Path) -> Path:
        """Write it as URDF with an STL file a link."""
        lines = [f'<robot name="{self.name}">']
        origins = {joint.child: np.array(joint.at) for joint in self.joints}
        for name, mesh in self.links.items():
            own = mesh.copy()
            own.apply_translation(-origins.get(name, np.zeros(3)))
            own.export(folder / f"{name}.stl")
            lines += [
                f'  <link name="{name}">',
                '    <inertial><mass value="1"/>'
                '<inertia ixx="0.01" iyy="0.01" izz="0.01" ixy="0" ixz="0" iyz="0"/></inertial>',
                f'    <collision><geometry><mesh filename="{name}.stl"/></geometry></collision>',
                "  </link>",
            ]
        for joint in self.joints:
            at = np.array(joint.at) - origins.get(joint.parent, np.zeros(3))
            lines += [
                f'  <joint name="{joint.child}_joint" type="{joint.kind}">',
                f'    <parent link="{joint.parent}"/><child link="{joint.child}"/>',
                f'    <origin xyz="{at[0]} {at[1]} {at[2]}"/>',
                f'    <axis xyz="{joint.axis[0]} {joint.axis[1]} {joint.axis[2]}"/>',
                f'    <limit lower="{joint.limits[0]}" upper="{joint.limits[1]}" effort="10" velocity="1"/>',
                "  </joint>",
            ]
        path = folder / f"{self.name}.urdf"
        path.write_text("\n".join([*lines, "</robot>", ""]))
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


def oven(play: float = 0.002) -> Robot:
    """An oven with a door that turns down about its lower edge, into a recess, `play` apart."""
    shell = block((-0.3, -0.25, 0), (0.3, 0.3, 0.6))
    hollow = block((-0.26, -0.4, 0.1), (0.26, 0.26, 0.56))
    recess = block((-0.28, -0.3, 0.06), (0.28, -0.22, 0.58))
    body = trimesh.boolean.difference([shell, hollow, recess])
    door = block((-0.28 + play, -0.25, 0.06 + play), (0.28 - play, -0.22 - play, 0.58 - play))
    glass = block((-0.2, -0.3, 0.15), (0.2, -0.235, 0.5))
    handle = [block((x - 0.01, -0.29, 0.53), (x + 0.01, -0.24, 0.55)) for x in (-0.2, 0.2)]
    bar = block((-0.21, -0.29, 0.53), (0.21, -0.275, 0.55))
    leaf = trimesh.boolean.union([trimesh.boolean.difference([door, glass]), *handle, bar])
    hinge = Joint("revolute", "oven", "door", (1, 0, 0), (0, -0.25, 0.06 + play), (0.0, 1.5))
    return Robot("oven", {"oven": body, "door": leaf}, (hinge,))


def gripper(left: float = 0.0005) -> Robot:
    """Two fingers that close on a plate of 5 mm until `left` is between; a ridge of it stands in their grooves."""
    palm = block((-0.06, -0.02, -0.03), (0.06, 0.02, 0))
    plate = block((-0.0025, -0.03, 0.05), (0.0025, 0.03, 0.12))
    stem = block((-0.0025, -0.005, -0.001), (0.0025, 0.005, 0.06))
    ridge = block((-0.0035, -0.03, 0.072), (0.0035, 0.03, 0.076))
    links, joints = {"palm": trimesh.boolean.union([palm, plate, stem, ridge])}, []
    for side, name in ((-1.0, "left"), (1.0, "right")):
        near = 0.0025 + left
        tip = block((side * near, -0.01, 0.06), (side * (near + 0.01), 0.01, 0.09))
        groove = block((side * (near - 0.001), -0.02, 0.07), (side * (near + 0.001 + left), 0.02, 0.078))
        bar = block((side * (near + 0.02), -0.01, 0.002), (side * (near + 0.03), 0.01, 0.09))
        across = block((side * (near + 0.005), -0.01, 0.08), (side * (near + 0.03), 0.01, 0.09))
        links[name] = trimesh.boolean.union([trimesh.boolean.difference([tip, groove]), bar, across])
        joints.append(Joint("prismatic", "palm", name, (side, 0, 0), (0, 0, 0), (0.0, 0.02)))
    return Robot("gripper", links, tuple(joints))


ALL = (fork_and_lug, drawer, oven, gripper)
