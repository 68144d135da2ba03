"""Meshes from files: parsers of well-kept libraries behind checks of what a file promises."""
