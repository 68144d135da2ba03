"""Decomposing a simpler copy of a dense solid, and carrying the parts back to the solid itself."""
