"""From parts to hulls in the input's unit: overlaps, primitives, simple hulls, limits; then the report."""
