"""Approximate convex decomposition: any mesh in, few tight convex hulls out."""

from importlib import import_module

from rlacd._version import __version__

# Where each public name lives; `__init__.pyi` says the same to editors and type checkers. Its module is imported when
# the name is first used (PEP 562), so that `rlacd --help` and programs that might not decompose do not wait for trimesh
# and numpy. No module may be called like a public name: importing it would hide that.
_NAMES = {
    "decompose_mesh": "decompose",
    "decomposition": "Decomposition",
    "errors": "RlacdError MeshError MeshFileError MeshDataError EmptyMeshError OptionError OutputError "
    "MissingExtraError DecompositionWarning ImplausibleBodyWarning",
    "extras.primitive": "Primitive",
    "io.robots": "RewrittenRobot rewrite_robot",
    "options.navigable": "NavigableSpace",
    "options.presets": "PRESETS Preset",
    "planes.sweep": "Sweep SweepCache",
    "policies": "Policy",
    "report": "Report",
    "run": "Progress",
    "solid.component": "Component Plane",
    "thresholds": "Tradeoff TradeoffRow tradeoff",
    "view_file": "view",
}
_HOME = {name: module for module, names in _NAMES.items() for name in names.split()}
__all__ = ["__version__", *_HOME]


def __getattr__(name: str) -> object:
    if name not in _HOME:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    value = getattr(import_module(f"{__name__}.{_HOME[name]}"), name)
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    return sorted(__all__)
