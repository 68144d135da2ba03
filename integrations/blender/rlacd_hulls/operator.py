"""The operator and its options."""

import sys

import bpy
from bpy.props import BoolProperty, EnumProperty, FloatProperty, IntProperty

from . import hulls


class Options:
    """What both the operator and the sidebar hold; the names are those of `rlacd.decompose`."""

    criterion: EnumProperty(
        name="Criterion",
        description="When a hull is tight enough",
        items=[
            ("concavity", "Concavity", "It lies within the threshold of the surface, everywhere"),
            (
                "navigable",
                "Navigable space",
                "It stays out of where a ball can go; space that no ball reaches costs nothing",
            ),
        ],
    )
    threshold: FloatProperty(
        name="Threshold",
        description="The concavity a hull may have, where the longest side of the mesh is 2. Smaller is tighter",
        default=0.05,
        min=0.001,
        max=2.0,
        soft_min=0.01,
        soft_max=0.5,
        precision=3,
        step=1,
    )
    radius: FloatProperty(
        name="Ball radius",
        description="Where the longest side of the mesh is 2",
        default=0.05,
        min=0.004,
        max=1.0,
        precision=3,
        step=1,
    )
    tolerance: FloatProperty(
        name="Tolerance",
        description="Space nearer to the surface than this may be filled; where the longest side is 2",
        default=0.1,
        min=0.002,
        max=1.0,
        precision=3,
        step=1,
    )
    quality: EnumProperty(
        name="Quality",
        description="How long to search for fewer hulls",
        items=[
            ("fast", "Fast", "One pass of cuts"),
            ("balanced", "Balanced", "About a second"),
            ("best", "Best", "Five seconds"),
        ],
        default="balanced",
    )
    max_hulls: IntProperty(name="Most hulls", description="0 for any number", default=0, min=0, soft_max=64)
    max_vertices: IntProperty(
        name="Most vertices",
        description="Of each hull; 0 for any number, 64 for PhysX on a GPU",
        default=0,
        min=0,
        soft_max=255,
    )
    modifiers: BoolProperty(name="Apply modifiers", description="Take the mesh as its modifiers make it", default=True)
    timeout: FloatProperty(
        name="Stop after",
        description="Seconds after which what is reached is taken; 0 never stops",
        default=60.0,
        min=0.0,
        subtype="TIME_ABSOLUTE",
    )


OPTIONS = tuple(Options.__annotations__)


class Settings(bpy.types.PropertyGroup, Options):
    """The options as the sidebar remembers them, in the scene."""

    __annotations__ = dict(Options.__annotations__)


class ConvexHulls(bpy.types.Operator, Options):
    """Make convex hulls for collision of the selected meshes."""

    bl_idname = "object.rlacd_convex_hulls"
    bl_label = "Convex hulls (rlacd)"
    bl_options = {"REGISTER", "UNDO"}  # noqa: RUF012
    __annotations__ = dict(Options.__annotations__)

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        """Whether there is something to do."""
        return context.mode == "OBJECT" and any(hulls.is_input(thing) for thing in context.selected_objects)

    def execute(self, context: bpy.types.Context) -> set[str]:
        """Decompose every selected mesh; hulls of an earlier run are replaced."""
        try:
            from rlacd.errors import RlacdError
        except ImportError as error:
            self.report({"ERROR"}, f"{_how_to_install()} ({error})")
            return {"CANCELLED"}
        chosen = [thing for thing in context.selected_objects if hulls.is_input(thing)]
        window = context.window_manager
        window.progress_begin(0, len(chosen))
        made = 0
        try:
            for index, thing in enumerate(chosen):
                window.progress_update(index)
                result = hulls.decompose(thing, context, self.modifiers, self.wishes())
                made += len(hulls.replace(thing, result))
                for warning in result.report.warnings:
                    self.report({"WARNING"}, f"{thing.name}: {warning}")
        except RlacdError as error:
            self.report({"ERROR"}, f"{thing.name}: {error}")
            return {"FINISHED" if made else "CANCELLED"}
        finally:
            window.progress_end()
        self.report({"INFO"}, f"{made} hull{'s' * (made != 1)} made")
        return {"FINISHED"}

    def draw(self, context: bpy.types.Context) -> None:
        """Show the options after the run."""
        draw_options(self.layout, self)

    def wishes(self) -> dict[str, object]:
        """Get the options of `rlacd.decompose`."""
        from rlacd import NavigableSpace

        goal: dict[str, object] = {"threshold": self.threshold}
        if self.criterion == "navigable":
            goal = {"criterion": NavigableSpace(radius=self.radius, tolerance=self.tolerance)}
        limits = {"max_hulls": self.max_hulls, "max_vertices": self.max_vertices, "timeout": self.timeout}
        return {**goal, "quality": self.quality, **{name: limit for name, limit in limits.items() if limit}}


def draw_options(layout: bpy.types.UILayout, options: Options) -> None:
    """Lay out the options, those of the criterion chosen only."""
    layout.use_property_split = True
    layout.use_property_decorate = False
    unused = {"radius", "tolerance"} if options.criterion == "concavity" else {"threshold"}
    for name in OPTIONS:
        if name not in unused:
            layout.prop(options, name)


def _how_to_install() -> str:
    return f"rlacd is missing in Blender's Python: run  {sys.executable} -m pip install rlacd  and start Blender again."
