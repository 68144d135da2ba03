// How much the surfaces of several bodies cross each other, known before a boolean of them is begun.
//
// In:  a triangle mesh and the body that each of its faces belongs to.
// Out: the number of pairs of faces of different bodies that touch, and a bound on the corners of their arrangement.
// How: a tree of boxes over all faces; pairs of triangles that no plane separates (the axes of Gottschalk et al.,
//      "OBBTree", 1996) touch. On a face that d others touch lie d segments, which meet in at most d (d - 1) / 2
//      points, each of them on three faces.
#pragma once

#include <cstdint>
#include <vector>

#include "core/geometry.hpp"
#include "surface/bvh.hpp"

namespace rlacd {

struct Crossings {
  std::int64_t pairs = 0;
  std::int64_t corners = 0;
};

// Stops to count once there are more than `most` pairs; both are too low then.
Crossings crossings(const Mesh& mesh, const std::vector<std::int64_t>& body, std::int64_t most);

// The faces of a mesh that cross a surface: along every axis that could separate two triangles they overlap by more
// than `slack`.
std::vector<std::int32_t> crossing(const Bvh& surface, const Mesh& mesh, double slack);

}  // namespace rlacd
