// Whether a ball of a given radius fits into a convex polytope: a linear program in the three coordinates of its
// centre.
#pragma once

#include "base/geometry.hpp"

namespace rlacd {

// The hull must be closed, convex and outward oriented; its longest side may have any length.
bool holds_ball(const Mesh& hull, double radius);

}  // namespace rlacd
