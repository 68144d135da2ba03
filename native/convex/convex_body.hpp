// How far a point is from a convex polytope, outside and inside.
//
// In:  a closed convex triangle mesh.
// Out: signed distances, negative inside; exact up to rounding.
// How: inside, the nearest facet plane gives the distance. Outside, the farthest plane is a lower bound that settles
//      most queries; the rest go to a tree of boxes over the facets, built when first needed.
#pragma once

#include <memory>
#include <mutex>

#include "convex/convex_planes.hpp"
#include "surface/bvh.hpp"

namespace rlacd {

class ConvexBody {
 public:
  explicit ConvexBody(Mesh mesh);
  ConvexBody(const ConvexBody&) = delete;
  ConvexBody& operator=(const ConvexBody&) = delete;

  // Signed distance of p; once the distance is known to be at least `enough`, any number between the two may be
  // returned.
  double distance(Vec3 p, double enough = std::numeric_limits<double>::infinity()) const;

  // The closest point of the surface to a point outside.
  Vec3 closest(Vec3 p) const { return bvh().closest(p).point; }

  const Mesh& mesh() const { return mesh_; }
  const ConvexPlanes& planes() const { return planes_; }
  const Box& box() const { return box_; }

 private:
  const Bvh& bvh() const {
    std::call_once(bvh_made_, [this] { bvh_ = std::make_unique<Bvh>(mesh_); });
    return *bvh_;
  }

  Mesh mesh_;
  ConvexPlanes planes_;
  Box box_;
  mutable std::once_flag bvh_made_;
  mutable std::unique_ptr<Bvh> bvh_;
};

// Whether a ball fits into a convex hull whose longest side may have any length: a linear program in the three
// coordinates of its centre.
bool holds_ball(const Mesh& hull, double radius);

}  // namespace rlacd
