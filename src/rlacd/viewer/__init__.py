"""The viewer: a page on this machine that shows a mesh and its hulls, and decomposes it again with other options."""
