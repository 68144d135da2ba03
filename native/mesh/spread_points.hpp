// Lays a grid over every face of a mesh such that no point of it is farther than `spacing` from a grid point.
#pragma once

#include <cstdint>
#include <vector>

#include "base/geometry.hpp"
#include "mesh/cells.hpp"

namespace rlacd {

struct SpreadPoints {
  std::vector<Vec3> points;         // corners included
  std::vector<std::int32_t> faces;  // [N], the face each lies on, ascending
};
// The spacing is positive. Grids have at most 768 rows and columns.
SpreadPoints spread_points(const Mesh& mesh, double spacing);

// A grid of cells of size `pitch`, the first of them around `origin`, with those marked that hold any of these points:
// of faces no larger than the spacing, the corners are enough. `margin` cells around them are free.
struct MarkedCells {
  Vec3 origin;
  Cell shape = {0, 0, 0};
  std::vector<char> marks;
};
MarkedCells mark_cells(const Mesh& mesh, double spacing, double pitch, std::int64_t margin);

}  // namespace rlacd
