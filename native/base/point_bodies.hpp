// Which corners of a mesh hang together by faces, whatever its quality: those in one place do, too.
#pragma once

#include <vector>

#include "base/geometry.hpp"

namespace rlacd {

// The body of each vertex, -1 for those of no face; bodies are numbered by their first faces.
std::vector<std::int32_t> point_bodies(const Mesh& mesh);

}  // namespace rlacd
