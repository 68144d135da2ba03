// Orders along a space-filling curve (Morton's), of 2^10 cells along each axis of a box.
#pragma once

#include <cstdint>
#include <vector>

#include "core/geometry.hpp"

namespace rlacd {

// The order of the middles of faces, in the box of all vertices.
std::vector<std::int32_t> order_of_faces(const Mesh& mesh);

// The same mesh with its vertices and its faces in these orders: neighbours in space become neighbours in memory. All
// vertices must be used.
Mesh along_a_curve(const Mesh& mesh);

}  // namespace rlacd
