"""Drop-in replacements for other tools' functions, for programs that call CoACD, V-HACD or trimesh today.

Each module is named after the one it replaces, and imports nothing of it: ``rlacd.compat.coacd``,
``rlacd.compat.vhacd`` (the package vhacdx) and ``rlacd.compat.trimesh``.
"""
