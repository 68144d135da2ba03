// The bodies of a mesh: pieces that edges connect.
//
// Input:  a closed oriented triangle mesh.
// Output: its pieces, in the order of their first faces; vertices that no face of a piece uses are left out.
// Algorithm: union-find over the faces on both sides of each edge. Where more than two faces meet at an edge, they are
// sorted around it, and those are connected that have the solid between them.
#pragma once

#include <vector>

#include "base/geometry.hpp"

namespace rlacd {

std::vector<Mesh> bodies(const Mesh& mesh);

}  // namespace rlacd
