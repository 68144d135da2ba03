// A closed surface cut by a plane.
//
// Input:  a closed oriented triangle mesh and a plane n.x = d.
// Output: the surface of each side without the cap in the plane, and the rims of that cap: closed loops, counter-
//         clockwise around it as seen from outside. Any triangulation of the loops closes the side.
// Algorithm: triangles are clipped; an edge is crossed at one point that all its triangles share. Corners within
// rounding of the plane are on it. A triangle in the plane belongs to the side that it bounds from outside. The edges
// in the plane, without those that run both ways, form the boundary of the open side, which is walked loop by loop.
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <vector>

#include "core/geometry.hpp"

namespace rlacd {

using Loops = std::vector<std::vector<std::int32_t>>;  // of vertices

struct OpenSide {
  Mesh mesh;
  Loops rims;
};

using Edge = std::array<std::int32_t, 2>;

// An edge as a key: directed, and the same for both directions.
inline std::uint64_t directed(std::int32_t from, std::int32_t to) {
  return static_cast<std::uint64_t>(from) << 32 | static_cast<std::uint32_t>(to);
}
inline std::uint64_t undirected(std::int32_t a, std::int32_t b) { return directed(std::min(a, b), std::max(a, b)); }

// The edges without those that also run the other way, by their ends.
std::vector<Edge> net(std::vector<Edge> edges);

// Joins edges to loops, which may run through each other where several meet; nothing if some are open.
std::optional<Loops> loops_of(std::vector<Edge> edges);

// Coordinates of points on a plane that preserve orientation as seen against the normal.
std::vector<PlanePoint> on_plane(const std::vector<Vec3>& points, Vec3 normal);

// How often edges run around the points to the left of one of them, by a ray across its longer side. Edge i goes from
// point 2 i to the next.
int winding_left_of(const std::vector<PlanePoint>& ends, std::size_t own);

// The sides below and above.
std::array<OpenSide, 2> cut_by_plane(const Mesh& mesh, Vec3 normal, double offset);

}  // namespace rlacd
