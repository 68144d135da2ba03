"""Where the operator is found: the sidebar of the 3-D view, and the menu Object."""

import bpy

from .operator import OPTIONS, ConvexHulls, draw_options


class HullsPanel(bpy.types.Panel):
    """The options, and the button."""

    bl_label = "Convex hulls"
    bl_idname = "VIEW3D_PT_rlacd_hulls"
    bl_space_type = "VIEW_3D"
    bl_region_type = "UI"
    bl_category = "rlacd"

    def draw(self, context: bpy.types.Context) -> None:
        """Lay out the panel."""
        settings = context.scene.rlacd
        draw_options(self.layout, settings)
        button = self.layout.operator(ConvexHulls.bl_idname, icon="MESH_ICOSPHERE")
        for name in OPTIONS:
            setattr(button, name, getattr(settings, name))


def menu_entry(menu: bpy.types.Menu, context: bpy.types.Context) -> None:
    """Stand in the menu Object, with the options of the sidebar."""
    menu.layout.separator()
    entry = menu.layout.operator(ConvexHulls.bl_idname)
    for name in OPTIONS:
        setattr(entry, name, getattr(context.scene.rlacd, name))
