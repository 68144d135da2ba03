// Points spread over the faces of a mesh.
#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "core/geometry.hpp"

namespace rlacd {

struct SpreadPoints {
  std::vector<Vec3> points;
  std::vector<std::int32_t> faces;  // [N], the face each lies on, ascending
};

// A grid over every face, corners included, such that no point of it is farther than `spacing`, which is positive, from
// a grid point. Grids have at most 768 rows and columns.
SpreadPoints spread_points(const Mesh& mesh, double spacing);

using Cell = std::array<std::int64_t, 3>;

// A grid [X, Y, Z] of cells, the last axis fastest, of size `pitch`, the first of them around `origin`, with those
// marked that hold any of these points. `margin` cells around them are free.
struct MarkedCells {
  Vec3 origin;
  Cell shape = {0, 0, 0};
  std::vector<char> marks;
};
MarkedCells mark_cells(const Mesh& mesh, double spacing, double pitch, std::int64_t margin);

// Labels of the connected sets of marked cells of a grid [X, Y, Z], the last axis fastest, which share sides, ascending
// by their first cells; 0 for the others.
std::vector<std::int64_t> label_cells(const bool* marks, Cell shape);

// The label of the nearest labelled cell at most `reach` cells away from each cell, which must lie in the grid; else 0.
// Of several that are equally near, the one with the first offset counts.
std::vector<std::int64_t> nearest_labels(const std::int64_t* labels, Cell shape, const std::vector<Cell>& cells,
                                         double reach);

// Seeded points on a surface, spread evenly by area: each is uniform over the surface, together they are more even than
// independent draws: a region with a share s of the area gets s * count points, give or take about one. Point i lies at
// a random place in the i-th of `count` equal stretches of accumulated area (stratified), and at a place in its
// triangle taken from the two-dimensional additive recurrence of the plastic number, randomly shifted, so that
// neighbours in one triangle keep apart. The only generator is a counter put through SplitMix64, and the only
// operations are IEEE-exact: the same bits everywhere.
SpreadPoints sample_surface(const Mesh& mesh, std::size_t count, std::uint64_t seed);

}  // namespace rlacd
