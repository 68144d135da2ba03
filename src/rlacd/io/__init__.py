"""Files: meshes read, hulls and models written, robots rewritten."""
