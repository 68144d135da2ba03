// Whether what a solid fills of a convex hull has a chance to be close enough to it: quick noes before any boolean.
//
// In:  a closed solid, convex hulls of parts of it, a distance t.
// Out: a verdict on the Hausdorff distance between the surfaces of a hull and of the solid's share of it. It is larger
//      than t where a corner of the solid lies deeper than t inside the hull, as it then does in every larger hull; and
//      where a point of the hull's surface lies outside the solid and farther than t from it.
#pragma once

#include "surface.hpp"

namespace rlacd {

enum class Chance : std::int32_t {
  kSome = 0,
  kNone = 1,   // not this hull
  kNever = 2,  // nor any hull that holds it
};

class Filling {
 public:
  explicit Filling(const Mesh& solid) : corners_(solid.vertices), surface_(solid) {}

  Chance chance(const Mesh& hull, double threshold) const;

 private:
  std::vector<Vec3> corners_;
  Surface surface_;
};

}  // namespace rlacd
