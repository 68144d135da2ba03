"""Mesh files made to harm the program that opens them, and words of the sentence that refuses each."""

from tests.io.hostile import archives, counts, gltf, xml  # noqa: F401  # they fill the list
from tests.io.hostile.registry import HARMLESS, REFUSED

__all__ = ["HARMLESS", "REFUSED"]
