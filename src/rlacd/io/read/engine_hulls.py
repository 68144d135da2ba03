"""Hulls for an engine that a scene holds already, put there by an earlier run or by hand: no shapes to decompose.

Input and output: an `InputMesh`. Nodes are told by the names that engines go by, and that `--keep-input` gives.
"""

from __future__ import annotations

import re
from collections.abc import Collection
from dataclasses import replace

import numpy as np

from rlacd.solid.input_mesh import InputMesh

_ENGINE = re.compile(r"(?:UCX|UBX|USP|UCP)_.+|.+-(?:convcolonly|colonly)(?:\.\d+)?", re.DOTALL)
"""Unreal's prefixes and Godot's endings; Blender numbers names that are not unique."""

_KEPT = re.compile(r"(.+)_hull_\d{3,}", re.DOTALL)


def without_engine_hulls(mesh: InputMesh) -> InputMesh:
    """Leave out the nodes that are hulls for an engine, with a warning.

    A mesh of hulls and nothing else stays as it is: then they are what was meant.
    """
    names = {node.name for node in mesh.nodes}
    hulls = np.array([_is_hull(node.name, names) for node in mesh.nodes], dtype=bool)
    if mesh.node_of is None or not hulls.any() or hulls.all():
        return mesh
    gone = hulls[mesh.node_of]
    unused = np.zeros(len(mesh.vertices), dtype=bool)
    unused[mesh.faces[gone]] = True
    unused[mesh.faces[~gone]] = False
    left_out = tuple(node for node, hull in zip(mesh.nodes, hulls, strict=True) if hull)
    said = f"hulls of an engine ({left_out[0].name:.60}{', ...' if len(left_out) > 1 else ''}) were left out"
    return replace(
        mesh,
        vertices=np.ascontiguousarray(mesh.vertices[~unused]),
        faces=np.ascontiguousarray((np.cumsum(~unused) - 1)[mesh.faces[~gone]]),
        warnings=(*mesh.warnings, f"{len(left_out)} of {len(mesh.nodes)} nodes, {said}"),
        nodes=tuple(node for node, hull in zip(mesh.nodes, hulls, strict=True) if not hull),
        node_of=(np.cumsum(~hulls) - 1)[mesh.node_of[~gone]],
        left_out=left_out,
    )


def _is_hull(name: str, names: Collection[str]) -> bool:
    if _ENGINE.fullmatch(name):
        return True
    kept = _KEPT.fullmatch(name)
    return kept is not None and kept[1] in names
