"""Other tools' functions with rlacd behind them, for programs that call CoACD, V-HACD or trimesh today.

Each module is named after what it stands in for, and imports nothing of it: ``rlacd.compat.coacd``,
``rlacd.compat.vhacd`` (the package vhacdx) and ``rlacd.compat.trimesh``.
"""
