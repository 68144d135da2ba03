"""After the cuts: merging parts, limits on vertices and faces, slivers."""
