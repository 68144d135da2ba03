"""How much a mesh file may make of itself. What promises more is refused before a parser believes it."""

from __future__ import annotations

MOST_TRIANGLES = 20_000_000
"""Of a mesh, every instance of a geometry counted. They take some 4 GB."""

MOST_PLACES = 100_000
"""Nodes of a scene, and instances of its geometries; parsers take about a kilobyte for each."""

MOST_ITEMS = 10_000
"""Places in a 3MF file, whose parser numbers them by trying all numbers."""

LONGEST_NAME = 1000
"""Of a part. Each place of a part gets a name of its own, with a number behind that."""

DEEPEST = 20
"""Instances inside instances: the cost of a place grows with the third power of its depth."""

MOST_MEMBERS = 10_000
"""Files in an archive."""


def most_unpacked(packed: int) -> int:
    """Bytes that an archive of so many may unpack to: XML of meshes shrinks to a tenth, seldom to a thirtieth."""
    return min(2**24 + 50 * packed, 2**30)


def most_in_memory(given: int) -> int:
    """Bytes of arrays that a file of so many may ask for: a byte of indices becomes eight, some are used repeatedly."""
    return 2**29 + 16 * given
