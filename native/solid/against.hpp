// A closed solid that convex hulls of its parts are held against.
//
// In:  a closed solid, a convex hull, a distance t.
// Out: a strict verdict: no point of the solid's surface lies deeper than t inside the hull, and no point of the hull's
//      surface lies farther than t from the solid. Or how deep and how far at most, as certified intervals.
// How: depth: faces of the solid are clipped to the points deeper than t, which decides exactly; what is deepest is
//      bounded over the faces clipped to the hull (branch_and_bound.hpp). Distance: bounded over the hull's facets; the
//      witnesses are triangles of the surface, and balls inside the solid.
//      Pairs of hulls are rejected by a few corners, or a limited number of looks at the facets that are new.
#pragma once

#include "convex/convex_body.hpp"
#include "surface/branch_and_bound.hpp"
#include "surface/surface.hpp"

namespace rlacd {

class Against {
 public:
  explicit Against(const Mesh& solid, int threads = 1) : solid_(solid), surface_(solid, threads) {}

  const Surface& surface() const { return surface_; }

  // False only if no point of the hull's surface certainly leads farther from the solid than the threshold. True if one
  // does, or if that is within 1e-3 of the threshold and undecided.
  bool leads_farther(const ConvexBody& hull, double threshold) const;
  // Whether the solid's surface comes deeper than the threshold inside a hull, as it then does in every larger hull.
  bool comes_deeper(const ConvexBody& hull, double threshold) const;

  // The greatest depth of the solid's surface inside the hull, and the greatest distance of the hull's surface from the
  // solid. The interval of the larger is at most `tolerance` wide, unless it ends below `floor`.
  struct Fit {
    Interval depth, reach;
  };
  Fit measure(const ConvexBody& hull, double tolerance, double floor) const;

  // The volume of the joint hull of two hulls that meet the threshold; infinite if that hull certainly does not.
  double feasible_volume(const ConvexBody& first, const ConvexBody& second, double threshold) const;

  // How much of a convex hull the solid fills (filled.cpp).
  double filled(const ConvexBody& hull) const;
  // What it fills, closed by caps: cut by one plane of the hull after the other. Empty if the solid crosses itself so
  // often that cuts multiply its faces.
  Mesh inside(const ConvexBody& hull) const;

  // Half-spaces that hold a hull that has grown to where the solid's surface stops it (grow.cpp).
  std::vector<HalfSpace> grown(const ConvexBody& hull, double depth) const;

  // The points that each hull has to take in, so that together they cover the solid (uncovered.cpp). Hulls grow by at
  // most `grain` more than they must. One whose box is farther from a triangle than `reach` takes it only if all are.
  std::vector<std::vector<Vec3>> uncovered(const std::vector<const ConvexBody*>& hulls, double reach, double grain,
                                           int threads) const;

 private:
  // Examines at most this many looks besides the facets themselves.
  bool is_missed(const Mesh& hull, const std::vector<Triangle>& facets, double threshold, int most) const;
  // The solid's faces clipped to a hull.
  Mesh faces_inside(const ConvexBody& hull) const;

  Mesh solid_;
  Surface surface_;
};

}  // namespace rlacd
