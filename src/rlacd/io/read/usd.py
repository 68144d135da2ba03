"""USD files (usd, usda, usdc, usdz), read by OpenUSD in a process of its own, which a damaged file may crash."""

from __future__ import annotations

from pathlib import Path

from rlacd.io.read.apart import read_apart
from rlacd.io.read.contents import Contents

SERVER = "rlacd.io.read.usd_stage:read_stage"


def read_usd(path: Path, _: bytes) -> Contents:
    """Read a stage: a node for each mesh.

    Invisible prims, guides and proxies are left out with a warning, faces that are holes without one. Subdivision
    surfaces are read as their cages. A mesh has the colours and the surface of its material, without pictures.

    Raises
    ------
    MeshFileError
        It is damaged, refers to a file outside its folder or to none, or holds too much.
    MissingExtraError
        The extra ``usd`` is not installed.
    """
    return read_apart(SERVER, path, "USD", {})
