"""What is the same for all engines: a mesh becomes hulls in single precision."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from rlacd.decompose_mesh import decompose
from rlacd.decomposition import Decomposition
from rlacd.errors import OptionError
from rlacd.io.write.encode import hull_name
from rlacd.io.write.single_precision import Triangles, required_hull


def hulls_of(
    mesh: Any, options: Mapping[str, Any]
) -> tuple[Decomposition, list[tuple[Triangles, np.ndarray[Any, Any]]]]:
    """Decompose a mesh, unless it is a decomposition; each hull comes with how far it has to be moved."""
    if isinstance(mesh, Decomposition) and options:
        raise OptionError(f"this mesh is decomposed already: leave out {', '.join(options)}.")
    if options.get("primitives"):
        raise OptionError("hulls are added as meshes, also where they stand for primitives: leave primitives out.")
    result = mesh if isinstance(mesh, Decomposition) else decompose(mesh, **options)
    return result, [required_hull(hull, hull_name(i), "for a simulator") for i, hull in enumerate(result)]
