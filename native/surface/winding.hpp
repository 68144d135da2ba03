// Generalised winding number: how often a surface, closed or not, goes around a point.
//
// In:  a tree of boxes over triangles.
// Out: about 1 inside, about 0 outside a closed outward-oriented surface (2 where two bodies overlap); in between near
//      the holes of an open one.
// How: Jacobson, Kavan, Sorkine-Hornung, "Robust Inside-Outside Segmentation using Generalized Winding Numbers" (2013):
//      the sum of the solid angles of the triangles / 4 pi. Far groups of triangles are replaced by the first two terms
//      of their multipole expansion: Barill et al., "Fast Winding Numbers for Soups and Clouds" (2018). Around a closed
//      surface it is a whole number: how often a ray leaves it less how often the ray enters.
#pragma once

#include <vector>

#include "surface/bvh.hpp"

namespace rlacd {

class Winding {
 public:
  explicit Winding(const Bvh& bvh);

  // A group is expanded when p is farther from its centre than `accuracy` times its radius; infinity sums every
  // triangle exactly.
  double at(Vec3 p, double accuracy) const;

  // The same for a closed surface. Long thin triangles, which are never far, cost it no more than others.
  double of_closed(Vec3 p) const;

 private:
  struct Moments {
    Vec3 centre;  // area-weighted
    double area = 0;
    double radius = 0;  // of a ball around the centre that holds the triangles
    Vec3 normal;        // sum of area * unit normal
    Vec3 first[3];      // sum of area * (triangle's centre - centre) outer unit normal, by row
  };
  Moments of_leaf(std::int32_t first_slot, std::int32_t count, const Box& box) const;
  static Moments joined(const Moments& a, const Moments& b, const Box& box);

  const Bvh& bvh_;
  std::vector<Moments> moments_;  // of child `side` of node n, at 2 n + side
};

}  // namespace rlacd
