"""Names that options take: of the policies that choose cuts, of primitives, of meshes."""

from __future__ import annotations

import os
from collections.abc import Mapping
from typing import Any, Literal, get_args

from rlacd.options.fields import one_of

PrimitiveKind = Literal["sphere", "capsule", "box", "cylinder"]

PRIMITIVE_KINDS: tuple[PrimitiveKind, ...] = get_args(PrimitiveKind)
"""Simplest first: in this order engines collide them fastest."""

EDGES = "+edges"
"""Ends the name of a policy that also cuts at reflex edges."""

SCORES = ("hull-sum", "max-excess", "excess-norm")
"""Scores by which a greedy policy orders planes."""

AS_PUBLISHED = (*(f"greedy-{score}" for score in SCORES), *(f"greedy-{score}{EDGES}" for score in SCORES), "navacd")
"""Policies of published methods, for comparison: one pass is cuts and merging, and nothing else."""

CONTROLS = (f"random-10{EDGES}", f"random-1{EDGES}", "random-10")
"""The paper's deployment with random planes in place of the network's best: what a learned policy has to beat."""

LEARNED = ("learned", "rl-acd")
"""Networks in the package."""

POLICIES = ("greedy", *LEARNED, *AS_PUBLISHED, *CONTROLS)

UNITS = {"mm": 1e-3, "cm": 1e-2, "m": 1.0, "in": 0.0254}
"""Metres of each unit that a mesh may be said to be in."""

WEIGHTS_ENDING = ".npz"
"""A policy's name that ends so is the path of a network."""


def read_policy(given: Any) -> Any:
    """Take the name of a policy, or any object with a method `choose`.

    Raises
    ------
    TypeError, ValueError
        It is neither.
    """
    if isinstance(given, str):
        if not is_policy(given):
            raise ValueError
        return str.__str__(given)
    if isinstance(given, type) or not callable(given.choose):
        raise TypeError
    return given


def policy_name(policy: object) -> str:
    """Get a policy's name: that of its class where it is an object."""
    return policy if isinstance(policy, str) else type(policy).__qualname__


def is_policy(name: object) -> bool:
    """Tell whether this is the name of a policy, or may be the path of one."""
    if not isinstance(name, str) or name in POLICIES:
        return isinstance(name, str)
    try:
        return name.endswith(WEIGHTS_ENDING) and b"\0" not in os.fsencode(name)
    except UnicodeError:
        return False


def read_primitives(given: Any) -> tuple[PrimitiveKind, ...]:
    """Read True or ``"all"``, a list of names, or a string of names with commas between them.

    Raises
    ------
    TypeError, ValueError
        It is none of these.
    """
    if isinstance(given, str):
        given = given == "all" or [word.strip() for word in given.split(",")]
    if isinstance(given, bool):
        return PRIMITIVE_KINDS if given else ()
    if not isinstance(given, (list, tuple)):
        raise TypeError
    names = {one_of(PRIMITIVE_KINDS).read(word) for word in given}
    return tuple(kind for kind in PRIMITIVE_KINDS if kind in names)


def read_meshes(given: Any) -> tuple[Any, ...]:
    """Read a list of meshes: paths, objects with vertices or a scene's geometry, or (vertices, faces).

    Raises
    ------
    TypeError
        It is no such list.
    """
    if not isinstance(given, (list, tuple)):
        raise TypeError
    for mesh in given:
        is_pair = isinstance(mesh, tuple) and len(mesh) == 2
        is_path = isinstance(mesh, (str, os.PathLike))
        if not (is_pair or is_path or hasattr(mesh, "vertices") or hasattr(mesh, "geometry")):
            raise TypeError
    return tuple(given)


def mesh_name(mesh: Any, unnamed: str = "a mesh") -> str:
    """Get a name for a mesh: its file's, or its own."""
    return file_name(mesh) or str(getattr(mesh, "name", unnamed))


def file_name(mesh: Any) -> str:
    """Get the name of the file that a mesh is, or that trimesh read it from; empty if there is none."""
    if isinstance(mesh, (str, os.PathLike)):
        return os.path.basename(os.fspath(mesh))
    metadata, source = getattr(mesh, "metadata", None), getattr(mesh, "source", None)
    known = metadata.get("file_name") if isinstance(metadata, Mapping) else None
    return os.path.basename(str(known or getattr(source, "file_path", None) or ""))
