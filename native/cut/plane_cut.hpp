// A closed surface cut by a plane.
//
// Input:  a closed oriented triangle mesh and a plane n.x = d.
// Output: the surface of each side but for the cap in the plane, and the rims of that cap: closed loops, counter-
//         clockwise around it as seen from outside. Any triangulation of the loops closes the side.
// Algorithm: triangles are clipped; an edge is crossed in one point for all triangles that have it. Corners within
// rounding of the plane are on it. A triangle in the plane belongs to the side that it bounds from outside. What is
// left of the edges in the plane, once those that run both ways are gone, is the boundary of the side so far, so that
// it can be walked around, loop after loop; where loops touch, the next edge is the one nearest inside.
#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "base/geometry.hpp"

namespace rlacd {

struct OpenSide {
  Mesh mesh;
  std::vector<std::vector<std::int32_t>> rims;  // loops of vertices
};

// Coordinates of points on a plane such that what is counter-clockwise seen against the normal is so in them.
std::vector<std::array<double, 2>> on_plane(const std::vector<Vec3>& points, Vec3 normal);

// What lies below and above.
std::array<OpenSide, 2> cut_by_plane(const Mesh& mesh, Vec3 normal, double offset);

}  // namespace rlacd
