"""Limits on what a mesh file may expand to. Files that declare more are refused before they reach a parser."""

from __future__ import annotations

MOST_TRIANGLES = 20_000_000
"""Of a mesh, counting every instance of a geometry. They take about 4 GB."""

MOST_PLACES = 100_000
"""Nodes of a scene, and instances of its geometries; parsers take about a kilobyte for each."""

LONGEST_NAME = 1000
"""Instances of one part. Each gets a unique name by a counting suffix."""

DEEPEST_PART = 20
"""Depth of nested instances: the cost of an instance grows with the cube of its depth."""


def most_in_memory(given: int) -> int:
    """Bytes of arrays that a file of this size may need: an index byte becomes eight, some are used repeatedly."""
    return 2**29 + 16 * given
