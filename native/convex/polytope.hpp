// A convex polytope in general position, with its corners and edges by the facets that make them.
//
// In:  a convex hull whose facets may be coplanar, or meet in a corner by more than three.
// Out: the polytope of its facet planes, each moved out by one to two times a tiny distance, all by different amounts:
//      three facets meet in every corner, and no plane passes through a point that lay on the hull.
#pragma once

#include <optional>
#include <vector>

#include "convex/convex_body.hpp"

namespace rlacd {

struct Polytope {
  struct Edge {
    std::int32_t left, right;  // facets, left < right
    std::int32_t from, to;     // corners, counter-clockwise around the left facet
  };
  std::vector<HalfSpace> facets;
  std::vector<Vec3> corners;
  std::vector<Edge> edges;  // by their facets, ascending

  std::int32_t edge_between(std::int32_t left, std::int32_t right) const;  // its number, or -1
};

// Nothing if rounding leaves no such polytope.
std::optional<Polytope> in_general_position(const ConvexBody& hull, double nudge);

}  // namespace rlacd
