// Whether a solid's share of a convex hull can be close enough to the hull: quick rejections before any boolean.
//
// In:  a closed solid, convex hulls of parts of it, a distance t.
// Out: a verdict on the Hausdorff distance between the surfaces of a hull and of the solid's share of it. It exceeds t
//      if the solid's surface comes deeper than t inside the hull, as it then does in every larger hull; and if a point
//      of the hull's surface lies outside the solid and farther than t from it.
// How: faces of the solid are clipped to the points deeper than t. Facets of the hull are subdivided, those with the
//      largest probable miss first, until each is decided by the distance at its middle and a share of its radius, is
//      small, or the limit on cells is reached. For the joint hull of two hulls, a few corners mostly suffice to see
//      that the solid comes too deep, and facets it shares with one of them need not be examined.
#pragma once

#include "solid/convex_clip.hpp"
#include "surface/surface.hpp"

namespace rlacd {

// Hulls grow by at most `grain` more than they must. A hull whose box is farther from a triangle than `reach` takes it
// only if all are.
std::vector<std::vector<Vec3>> uncovered(const Mesh& mesh, const Bvh& bvh, const std::vector<const ConvexBody*>& hulls,
                                         double reach, double grain, int threads);

std::vector<HalfSpace> grow(const Mesh& solid, const Bvh& bvh, const ConvexBody& hull, double depth);

struct ClippedSolid {
  Mesh mesh;
  double volume = 0;
};

class Filling {
 public:
  explicit Filling(const Mesh& solid, int threads = 1) : solid_(solid), surface_(solid, threads) {}

  const Surface& surface() const { return surface_; }
  // Whether the surfaces of a hull and of the solid's share of it may be as near as the threshold.
  bool is_feasible(const ConvexBody& hull, double threshold) const;
  // The volume of the joint hull of two hulls that are close enough to their own shares of the solid; infinite if the
  // joint hull is not feasible.
  double feasible_volume(const ConvexBody& first, const ConvexBody& second, double threshold) const;
  // Whether the solid's surface comes deeper than the threshold inside a hull: then it is not feasible.
  bool comes_deeper(const ConvexBody& hull, double threshold) const;

  // All that the solid fills of a convex hull, closed by caps on its facets.
  ClippedSolid clipped(const ConvexBody& hull) const;
  std::vector<HalfSpace> grown(const ConvexBody& hull, double depth) const {
    return grow(solid_, surface_.bvh(), hull, depth);
  }
  std::vector<std::vector<Vec3>> uncovered(const std::vector<const ConvexBody*>& hulls, double reach, double grain,
                                           int threads) const {
    return rlacd::uncovered(solid_, surface_.bvh(), hulls, reach, grain, threads);
  }

 private:
  // Examines at most this many cells besides the facets themselves.
  bool is_missed(const Mesh& hull, const std::vector<Triangle>& facets, double threshold, int most) const;

  Mesh solid_;
  Surface surface_;
};

}  // namespace rlacd
