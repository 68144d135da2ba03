// Distances between a union of convex hulls and a surface, certified.
//
// In:  convex hulls (closed, convex, outward oriented), which may touch and overlap; a triangle surface.
// Out: over:  the greatest distance from the surface *of the union* to the given surface: what the hulls add;
//      under: the greatest distance from the given surface to the union as a solid, 0 inside any hull: what they miss;
//      each as an interval that meets a goal, and a place where its lower end is reached.
// How: the triangles are clipped exactly against the hulls, which leaves a set of small convex polygons, and
//      branch_and_bound.hpp finds the maximum over those. Over: a facet of a hull loses the regions inside other hulls
//      and those that touch another hull's facet from the opposite side; of two facets that coincide facing the same
//      way, both stay. Under: a triangle of the surface loses the regions inside any hull; on the rest, distance to the
//      union is the least of the distances to the hulls, which are convex. Triangles are independent and waves
//      deterministic: the same bits for any number of threads.
#pragma once

#include <memory>
#include <vector>

#include "convex/convex_body.hpp"
#include "core/geometry.hpp"
#include "surface/branch_and_bound.hpp"
#include "surface/bvh.hpp"

namespace rlacd {

class HullUnion {
 public:
  HullUnion(std::vector<std::shared_ptr<ConvexBody>> hulls, int threads);

  // The surface of the union as triangles. Cracks between hulls narrower than `gap` count as closed; next to inner
  // corners of the surface, strips narrower than about `gap` are lost. A facet inside so many hulls that cutting it was
  // abandoned is recorded in `unresolved`: parts of it are hidden.
  struct Exposed {
    Mesh exposed, unresolved;
  };
  Exposed exposed(double gap, int threads) const;

  Greatest over(const Bvh& surface, const Goal& goal, double gap, int threads) const;
  Greatest under(const Mesh& surface, const Goal& goal, int threads) const;

  // From p to the solid, 0 inside.
  double distance(Vec3 p) const;

 private:
  friend class HullField;

  std::vector<std::shared_ptr<ConvexBody>> members_;
};

}  // namespace rlacd
