"""Blender add-on: the selected meshes as convex hulls, by the operator "Convex hulls (rlacd)".

It is in the menu Object and in the sidebar of the 3-D view (N), tab rlacd. Its options can be changed after it has run,
in the panel "Adjust Last Operation".
"""

import bpy

from . import operator, panel


def register() -> None:
    """Called by Blender when the add-on is turned on."""
    for kind in (operator.Settings, operator.ConvexHulls, panel.HullsPanel):
        bpy.utils.register_class(kind)
    bpy.types.Scene.rlacd = bpy.props.PointerProperty(type=operator.Settings)
    bpy.types.VIEW3D_MT_object.append(panel.menu_entry)


def unregister() -> None:
    """Called by Blender when the add-on is turned off."""
    bpy.types.VIEW3D_MT_object.remove(panel.menu_entry)
    del bpy.types.Scene.rlacd
    for kind in (panel.HullsPanel, operator.ConvexHulls, operator.Settings):
        bpy.utils.unregister_class(kind)
