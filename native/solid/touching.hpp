// The planes in which two closed solids touch face to face.
#pragma once

#include <vector>

#include "core/geometry.hpp"

namespace rlacd {

constexpr double kCoincident = 1e-8;  // distance at which faces touch, and vertices are one or on an edge

// Adds the planes in which faces of two solids with disjoint interiors share an area, unless they are known.
void add_touching_planes(std::vector<Plane>& planes, const Mesh& a, const Mesh& b);

}  // namespace rlacd
