// Lays a grid over every face of a mesh such that no point of it is farther than `spacing` from a grid point.
#pragma once

#include <cstdint>
#include <vector>

#include "base/geometry.hpp"

namespace rlacd {

struct SpreadPoints {
  std::vector<Vec3> points;         // corners included
  std::vector<std::int32_t> faces;  // [N], the face each lies on, ascending
};
// The spacing is positive. Grids have at most 768 rows and columns.
SpreadPoints spread_points(const Mesh& mesh, double spacing);

}  // namespace rlacd
