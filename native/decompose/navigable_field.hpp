// The two fields whose level sets bound where a ball can be around a solid.
//
// In:  the surface of a closed solid, its convex hull, closed half-spaces; the ball's radius r and the tolerance t.
// Out: clearance(x): the radius of the largest ball around x that touches neither the surface nor a closed half-space.
//                    A ball may stand at x where clearance >= r.
//      room(x):      at least r + t exactly if, in addition, the surface is t farther away than necessary, and x is at
//                    most r from the hull: the navigable space, apart from sides and entrances.
// Both are minima of distances, hence 1-Lipschitz, and each value comes with the direction in which it grows. Neither
// knows on which side of the surface x lies: a path along which the clearance stays positive does not change sides.
#pragma once

#include <vector>

#include "convex/convex_body.hpp"
#include "surface/bvh.hpp"

namespace rlacd {

class NavigableField {
 public:
  // Balls keep out of the closed half-spaces, whose normals have length 1.
  NavigableField(const Bvh& surface, const ConvexBody& hull, std::vector<HalfSpace> closed, double radius,
                 double tolerance)
      : surface_(surface), hull_(hull), closed_(std::move(closed)), radius_(radius), tolerance_(tolerance) {}

  double radius() const { return radius_; }
  double tolerance() const { return tolerance_; }
  double level() const { return radius_ + tolerance_; }  // of the room, on the boundary of the space
  const Bvh& surface() const { return surface_; }
  const ConvexBody& hull() const { return hull_; }

  enum class Limit { kSurface, kGround, kHull };
  struct Value {
    double value = 0;
    Vec3 uphill;             // unit, but zero on the surface itself
    std::int32_t slot = -1;  // of the nearest triangle
    Limit by = Limit::kSurface;
  };
  Value clearance(Vec3 x, std::int32_t hint = -1) const { return by_surface_and_ground(x, hint, 0); }
  // The room without the hull's term.
  Value room_near(Vec3 x, std::int32_t hint = -1) const { return by_surface_and_ground(x, hint, tolerance_); }

  // Distance to the nearest closed half-space, negative inside it.
  double above_ground(Vec3 x) const {
    double least = kInfinity;
    for (const HalfSpace& closed : closed_) least = std::min(least, dot(closed.normal, x) - closed.offset);
    return least;
  }
  // The room's term of the hull at distance `away`: the room ends at r from the hull.
  double room_by_hull(double away) const { return level() + radius_ - away; }

 private:
  Value by_surface_and_ground(Vec3 x, std::int32_t hint, double margin) const {
    const Bvh::Hit hit = surface_.closest(x, hint);
    Value value = {std::sqrt(hit.distance2), normalized(x - hit.point), hit.slot, Limit::kSurface};
    for (const HalfSpace& closed : closed_) {
      const double above = dot(closed.normal, x) - closed.offset + margin;
      if (above < value.value) value.value = above, value.uphill = closed.normal, value.by = Limit::kGround;
    }
    return value;
  }

  const Bvh& surface_;
  const ConvexBody& hull_;
  std::vector<HalfSpace> closed_;
  double radius_, tolerance_;
};

}  // namespace rlacd
