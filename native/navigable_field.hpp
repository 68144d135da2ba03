// The two fields whose level sets bound what a ball can do around a solid.
//
// In:  the surface of a closed solid, its convex hull, closed half-spaces; the ball's radius r and the tolerance t.
// Out: clearance(x): the radius of the largest ball around x that touches neither the surface nor a closed half-space.
//                    A ball may stand at x where clearance >= r.
//      room(x):      at least r + t exactly where, besides, the surface is t farther away than it has to be, and x is
//                    no farther than r from the hull: the navigable space, but for sides and ways in.
// Both are minima of distances, so they change no faster than x moves, and each value comes with the direction in which
// it grows. Which side of the surface x is on neither of them knows: a path along which the clearance stays positive
// does not change sides.
#pragma once

#include <vector>

#include "bvh.hpp"
#include "convex_body.hpp"

namespace rlacd {

// Balls keep out of normal . x < offset; the normal has length 1.
struct HalfSpace {
  Vec3 normal;
  double offset;
};

class NavigableField {
 public:
  NavigableField(const Bvh& surface, const ConvexBody& hull, std::vector<HalfSpace> closed, double radius,
                 double tolerance)
      : surface_(surface), hull_(hull), closed_(std::move(closed)), radius_(radius), tolerance_(tolerance) {}

  double radius() const { return radius_; }
  double tolerance() const { return tolerance_; }
  double level() const { return radius_ + tolerance_; }  // of the room, on the boundary of the space
  const Bvh& surface() const { return surface_; }
  const ConvexBody& hull() const { return hull_; }

  struct Value {
    double value;
    Vec3 uphill;  // unit, but zero on the surface itself
    std::int32_t slot = -1;
  };
  Value clearance(Vec3 x, std::int32_t hint = -1) const;
  Value room(Vec3 x, std::int32_t hint = -1) const;

  // Distance to the nearest closed half-space, negative in it.
  double above_ground(Vec3 x) const;
  // What the room is where the hull is `away`: it ends at r from the hull.
  double room_by_hull(double away) const { return level() + radius_ - away; }

 private:
  void lower_by_ground(Vec3 x, double margin, Value& value) const;

  const Bvh& surface_;
  const ConvexBody& hull_;
  std::vector<HalfSpace> closed_;
  double radius_, tolerance_;
};

// Moves x to a place where the field is `level`, up to `slack`, or, from below, at least that; false where it finds
// none. Downhill one step is exact. Uphill, x is pushed away from what is nearest until nothing is too near: in a
// narrow place from one side to the other, which ends on the crease between them. `visit(x, value)` sees every value on
// the way.
template <class Field, class Visit>
bool settle(const Field& field, double level, double slack, int steps, Vec3& x, NavigableField::Value& value,
            const Visit& visit) {
  std::int32_t hint = value.slot;
  for (int step = 0; step < steps; ++step) {
    value = field(x, hint);
    hint = value.slot;
    visit(x, value);
    if (std::fabs(value.value - level) <= slack) return true;
    if (value.value > level && step > 0) return true;
    x = x + (level - value.value) * value.uphill;
  }
  return false;
}

}  // namespace rlacd
