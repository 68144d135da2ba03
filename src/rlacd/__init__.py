"""Approximate convex decomposition: any mesh in, few tight convex hulls out."""

from importlib import import_module

from rlacd._version import __version__

__all__ = [
    "PRESETS",
    "Component",
    "Decomposition",
    "EmptyMeshError",
    "ImplausibleBodyWarning",
    "MeshDataError",
    "MeshError",
    "MeshFileError",
    "MissingExtraError",
    "NavigableSpace",
    "OptionError",
    "OutputError",
    "Plane",
    "Policy",
    "Preset",
    "Primitive",
    "Progress",
    "Rewritten",
    "RlacdError",
    "Sweep",
    "SweepCache",
    "__version__",
    "decompose",
    "rewrite_robot",
]

# Where each public name lives; `__init__.pyi` says the same to editors and type checkers. Its module is imported when
# the name is first used (PEP 562), so that `rlacd --help` and programs that might not decompose do not wait for trimesh
# and numpy. No module may be called like a public name: importing it would hide that.
_HOME = {
    "NavigableSpace": "options.navigable",
    "decompose": "decompose_mesh",
    "Decomposition": "decomposition",
    "PRESETS": "options.presets",
    "Preset": "options.presets",
    "Progress": "run",
    "Rewritten": "io.robots",
    "rewrite_robot": "io.robots",
    "Policy": "policies",
    "Component": "solid.component",
    "Plane": "solid.component",
    "Primitive": "solid.primitive",
    "Sweep": "planes.sweep",
    "SweepCache": "planes.sweep",
    **dict.fromkeys((name for name in __all__ if name.endswith(("Error", "Warning"))), "errors"),
}


def __getattr__(name: str) -> object:
    if name not in _HOME:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    value = getattr(import_module(f"{__name__}.{_HOME[name]}"), name)
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    return sorted({*globals(), *__all__})
