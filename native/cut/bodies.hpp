// The bodies of a mesh: pieces that edges connect.
//
// Input:  a closed oriented triangle mesh.
// Output: its pieces, in the order of their first faces, each without unused vertices.
// Algorithm: union-find over the faces on both sides of each edge. If more than two faces meet at an edge, they are
// sorted around it, and two neighbours are connected if the solid lies between them.
#pragma once

#include <vector>

#include "base/geometry.hpp"

namespace rlacd {

std::vector<Mesh> bodies(const Mesh& mesh);

}  // namespace rlacd
