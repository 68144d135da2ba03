// A convex polytope, with what is asked about it: made when it is first needed, and kept.
//
// In:  a closed convex triangle mesh, whose flat sides may be cut into many triangles.
// Out: signed distances, negative inside, exact up to rounding; facet planes; flat sides; a few corners.
// How: inside, the nearest facet plane gives the distance. Outside, the farthest plane is a lower bound that settles
//      most queries; the rest go to a tree of boxes over the facets.
#pragma once

#include "convex/convex_planes.hpp"
#include "convex/polygon.hpp"
#include "core/lazy.hpp"
#include "surface/bvh.hpp"

namespace rlacd {

class ConvexBody {
 public:
  explicit ConvexBody(Mesh mesh);

  const Mesh& mesh() const { return mesh_; }
  const Box& box() const { return box_; }
  const ConvexPlanes& planes() const {
    return planes_.get([this]() -> const Mesh& { return mesh_; });
  }
  const Bvh& bvh() const {
    return bvh_.get([this]() -> const Mesh& { return mesh_; });
  }

  // Signed distance of p; once the distance is known to be at least `enough`, any number between the two may be
  // returned.
  double distance(Vec3 p, double enough = kInfinity) const;

  // Triangles of equal normals, up to rounding.
  struct Side {
    Plane plane;
    Polygon polygon;
  };
  const std::vector<Side>& sides() const;

  // All corners, or a few that span most of it if it has many.
  const std::vector<Vec3>& few_corners() const;

 private:
  Mesh mesh_;
  Box box_;
  Lazy<ConvexPlanes> planes_;
  Lazy<Bvh> bvh_;
  Lazy<std::vector<Side>> sides_;
  Lazy<std::vector<Vec3>> few_corners_;
};

// Whether a ball fits into a convex hull whose longest side may have any length: a linear program in the three
// coordinates of its centre.
bool holds_ball(const Mesh& hull, double radius);

}  // namespace rlacd
