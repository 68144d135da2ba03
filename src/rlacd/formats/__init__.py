"""Writing decompositions to files."""
