"""From any soup of triangles to one closed, oriented solid."""
