// Orders along a space-filling curve (Morton's), of 2^10 cells along each axis of a box.
#pragma once

#include "core/geometry.hpp"

namespace rlacd {

// The same mesh with its vertices, and its faces by their middles, in this order: neighbours in space become neighbours
// in memory. All vertices must be used.
Mesh along_a_curve(const Mesh& mesh);

}  // namespace rlacd
