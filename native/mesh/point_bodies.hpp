// Connected components of a mesh of any quality: faces connect their corners, and equal corners are one.
#pragma once

#include <vector>

#include "base/geometry.hpp"

namespace rlacd {

// The body of each vertex, -1 for vertices that no face uses; bodies are numbered by their first faces.
std::vector<std::int32_t> point_bodies(const Mesh& mesh);

}  // namespace rlacd
