// Vertices that a surface does not need: in the middle of a flat part, or of a straight crease between two.
//
// Input:  a closed triangle mesh, and the vertices that may go.
// Output: the same surface without them, to about 1e-9, and without unused vertices.
// Algorithm: a vertex moves onto a neighbour in the planes of all its faces, if no face turns over or vanishes and the
// two have no more neighbours in common than the faces between them.
#pragma once

#include <vector>

#include "base/geometry.hpp"

namespace rlacd {

void collapse_flat(Mesh& mesh, const std::vector<std::int32_t>& vertices);

}  // namespace rlacd
