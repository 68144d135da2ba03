// Pairs of boxes that are near each other.
//
// Input:  boxes, which of them are new, and a distance.
// Output: pairs of a new box and any other, ascending: those within reach of each other, or of a common third box.
// Algorithm: boxes are sorted along the axis on which they overlap least.
#pragma once

#include <array>
#include <vector>

#include "base/geometry.hpp"

namespace rlacd {

std::vector<std::array<std::int32_t, 2>> near_pairs(const std::vector<Box>& boxes, const std::vector<char>& is_new,
                                                    double reach, bool across);

}  // namespace rlacd
