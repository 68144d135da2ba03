"""Meshes from files: maintained parsers behind checks of what a file declares."""
