"""Criteria that only options ask for: added volume, navigable space, meshes to avoid."""
