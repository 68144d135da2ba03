// Whether what a solid fills of a convex hull has a chance to be close enough to it: quick noes before any boolean.
//
// In:  a closed solid, convex hulls of parts of it, a distance t.
// Out: a verdict on the Hausdorff distance between the surfaces of a hull and of the solid's share of it. It is larger
//      than t where the solid's surface comes deeper than t inside the hull, as it then does in every larger hull; and
//      where a point of the hull's surface lies outside the solid and farther than t from it.
// How: faces of the solid are clipped to the points deeper than t. Facets of the hull are divided, those that could be
//      missed farthest first, until each is decided by the distance at its middle and its radius, is small, or there
//      were enough. Of two hulls, some corners are enough mostly to see that the solid comes too deep; and facets that
//      the joint hull has of one of them need not be looked at.
#pragma once

#include "distance/surface.hpp"
#include "hull/convex_planes.hpp"

namespace rlacd {

enum class Chance : std::int32_t {
  kSome = 0,
  kNone = 1,   // not this hull
  kNever = 2,  // nor any hull that holds it
};

// The corners of a hull, and few of them that span most of it.
struct HullCorners {
  explicit HullCorners(std::vector<Vec3> corners);

  std::vector<Vec3> all, some;
};

class Filling {
 public:
  explicit Filling(const Mesh& solid) : solid_(solid), surface_(solid) {}

  Chance chance(const Mesh& hull, double threshold) const;
  // The same for the convex hull of the corners of two hulls that are close enough to their own shares of the solid,
  // and its volume unless it is kNever.
  struct Joint {
    double volume;
    Chance chance;
  };
  Joint joint_chance(const HullCorners& first, const HullCorners& second, double threshold) const;
  // Whether it is kNever: much sooner known than which of the others it is.
  bool comes_deeper(const Mesh& hull, double threshold) const;

 private:
  // Looks at so many cells besides the facets themselves.
  bool is_missed(const Mesh& hull, const std::vector<Triangle>& facets, double threshold, int most) const;

  Mesh solid_;
  Surface surface_;
};

}  // namespace rlacd
