"""Decomposing a simpler copy of a dense solid, and transferring the parts to the solid itself."""
