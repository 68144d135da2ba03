// Grids of cubic cells [X, Y, Z], the last axis fastest.
#pragma once

#include <array>
#include <cstdint>
#include <vector>

namespace rlacd {

using Cell = std::array<std::int64_t, 3>;

// Labels the connected sets of marked cells, which share sides, from 1 on by their first cells; the others get 0.
std::vector<std::int64_t> label_cells(const bool* marks, Cell shape);

// The label of the nearest labelled cell at most `reach` cells away from each cell, which must lie in the grid; else 0.
// Of several that are equally near, the one with the first offset counts.
std::vector<std::int64_t> nearest_labels(const std::int64_t* labels, Cell shape, const std::vector<Cell>& cells,
                                         double reach);

}  // namespace rlacd
