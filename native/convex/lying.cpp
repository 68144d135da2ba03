#include "convex/lying.hpp"

#include <utility>

#include "convex/polygon.hpp"

namespace rlacd {
namespace {

// A triangle that meets more others than this is halved, so often at most.
constexpr std::size_t kMostMet = 32;
constexpr int kMostHalvings = 64;

// What is nearer than this to the triangle's plane may lie in it; how far from it, is measured.
constexpr double kFlat = 1e-6;

// No piece is thinner: repaired coordinates are rounded to less, so that planes that should be one are so far apart.
constexpr double kThin = 1e-8;

Corners corners_of(const TriangleFrame& t) { return {t.a, t.a + t.ab, t.a + t.ac}; }

double height_above(const Plane& plane, Vec3 p) {
  const double h = -plane.depth(p);
  return std::fabs(h) <= kThin ? 0.0 : h;
}

Plane plane_through(Vec3 p, Vec3 normal) {
  const Vec3 unit = normalized(normal);
  return {unit, dot(unit, p)};
}

// How far the middle of a piece is above a plane that the piece does not cross; 0 if it does.
double clear_of(const Plane& plane, const Polygon& piece, Vec3 middle) {
  for (const Vec3 p : piece)
    if (height_above(plane, p) < 0) return 0;
  return height_above(plane, middle);
}

// A triangle of the surface that meets the triangle in question.
struct Met {
  std::int32_t slot;
  Box box;
  Plane planes[4];       // it lies below the first `count`: its sides, if it is flat; else both sides of its own plane
  int count;             // 0: rounding leaves no such planes
  bool is_flat = false;  // in the plane of the triangle in question

  Met(std::int32_t slot_, const Corners& t, Vec3 normal, bool flat) : slot(slot_), box(Box::of(t)), is_flat(flat) {
    const Vec3 own = long_normal(t);
    count = flat ? 3 : 2;
    for (int k = 0; flat && k < 3; ++k) {
      const Vec3 side = cross(t[(k + 1) % 3] - t[k], normal);
      planes[k] = plane_through(t[k], dot(own, normal) < 0 ? -side : side);
    }
    if (!flat) planes[0] = plane_through(t[0], own), planes[1] = {-planes[0].normal, -planes[0].offset};
    for (int k = 0; k < count; ++k)
      for (const Vec3 p : t)
        if (height_above(planes[k], p) > 0) count = 0;
  }
};

class Pieces {
 public:
  Pieces(const Corners& triangle, const Plane& plane, const Bvh& bvh)
      : bvh_(bvh), plane_(plane), box_(Box::of(triangle)) {
    pieces_ = {{triangle.begin(), triangle.end()}};
  }

  // Finds the triangles that it meets; false if they are too many.
  bool find() {
    const auto may_meet = [&](const Box& box) {
      const Vec3 middle = 0.5 * (box.lower + box.upper), half = 0.5 * (box.upper - box.lower);
      return box.meets(box_, kFlat) && std::fabs(plane_.depth(middle)) <= reach_along(plane_.normal, half) + kFlat;
    };
    return !bvh_.any_of(may_meet, [&](std::int32_t slot) {
      const Corners t = corners_of(bvh_.triangle(slot));
      const auto [low, high] = std::minmax({plane_.depth(t[0]), plane_.depth(t[1]), plane_.depth(t[2])});
      if (low > kFlat || high < -kFlat || !Box::of(t).meets(box_, kFlat)) return false;
      met_.emplace_back(slot, t, plane_.normal, low >= -kFlat && high <= kFlat);
      return met_.size() > kMostMet;
    });
  }

  double bound(const Surface* solid) {
    take_off_flat();
    if (solid != nullptr) split_rest();
    double most = most_;
    for (const Polygon& piece : pieces_) {
      double least = solid == nullptr ? kInfinity : inside(piece, *solid);
      if (least == kInfinity)
        for (const Met& met : met_) least = std::min(least, farthest(met, piece));
      most = std::max(most, least);
    }
    return most;
  }

 private:
  // Clips off what lies over triangles in its plane.
  void take_off_flat() {
    for (const Met& met : met_) {
      if (!met.is_flat || met.count == 0) continue;
      left_.clear();
      for (const Polygon& piece : pieces_) take_off(met, piece);
      pieces_.swap(left_);
    }
  }

  // Splits the rest by the planes of the other triangles.
  void split_rest() {
    for (const Met& met : met_) {
      if (met.is_flat || met.count == 0) continue;
      left_.clear();
      for (Polygon& piece : pieces_) {
        const auto height = [&](Vec3 p) { return height_above(met.planes[0], p); };
        if (met.box.meets(Box::of(piece), kFlat) && split(piece, height, below_, above_) == Lies::kAcross)
          left_.push_back(below_), left_.push_back(above_);
        else
          left_.push_back(std::move(piece));
      }
      pieces_.swap(left_);
    }
  }

  void take_off(const Met& met, const Polygon& piece) {
    const std::size_t before = left_.size();
    rest_ = piece;
    for (int k = 0; k < met.count; ++k) {
      const Lies lies = split(rest_, [&](Vec3 p) { return height_above(met.planes[k], p); }, below_, above_);
      if (lies == Lies::kAbove) {
        left_.resize(before);
        left_.push_back(piece);
        return;
      }
      if (lies == Lies::kBelow) continue;
      left_.push_back(above_);
      rest_.swap(below_);
    }
    most_ = std::max(most_, farthest(met, rest_));
  }

  double farthest(const Met& met, const Polygon& piece) const {
    double most = 0;
    for (const Vec3 p : piece) most = std::max(most, bvh_.distance(met.slot, p));
    return most;
  }

  // A bound for a piece inside the solid; infinity for others. Its points that are more than thin above all planes
  // are, with its middle, in one region that no surface enters; others are near those on their way to the middle.
  double inside(const Polygon& piece, const Surface& solid) const {
    const Vec3 middle = middle_of(piece);
    const Box box = Box::of(piece);
    double clear = kInfinity, radius = 0;
    for (const Met& met : met_) {
      if (!met.box.meets(box, kFlat)) continue;
      double most = 0;
      for (int k = 0; k < met.count; ++k) most = std::max(most, clear_of(met.planes[k], piece, middle));
      clear = std::min(clear, most);
    }
    if (clear <= kThin || !solid.holds(middle)) return kInfinity;
    for (const Vec3 p : piece) radius = std::max(radius, norm(p - middle));
    return std::min(1.0, 4 * kThin / clear) * radius;
  }

  const Bvh& bvh_;
  Plane plane_;  // of the triangle, up to `kFlat`
  Box box_;
  std::vector<Met> met_;
  std::vector<Polygon> pieces_, left_;
  Polygon rest_, below_, above_;
  double most_ = 0;  // for what was clipped off
};

// A bound for a triangle; `solid` is null if only the surface counts, `halvings` how often it may still be halved.
double bound(const Corners& triangle, const Bvh& surface, const Surface* solid, int& halvings) {
  const Vec3 middle = (1.0 / 3) * (triangle[0] + triangle[1] + triangle[2]);
  const std::int32_t near = surface.closest(middle, -1, kHair, kFlat).slot;
  if (near < 0 && !(solid != nullptr && solid->holds(middle))) return kInfinity;
  Plane plane = plane_through(triangle[0], long_normal(triangle));
  if (near >= 0) {  // has the better plane if this one is a needle
    const Corners t = corners_of(surface.triangle(near));
    const Plane other = plane_through(t[0], long_normal(t));
    if (std::all_of(triangle.begin(), triangle.end(), [&](Vec3 p) { return std::fabs(other.depth(p)) <= kFlat; }))
      plane = other;
  }
  Pieces pieces(triangle, plane, surface);
  if (pieces.find()) return pieces.bound(solid);
  if (halvings-- == 0) return kInfinity;
  const auto [first, second] = halves(triangle);
  const double most = bound(first, surface, solid, halvings);
  return most == kInfinity ? most : std::max(most, bound(second, surface, solid, halvings));
}

}  // namespace

double lying_in(const Corners& triangle, const Bvh& surface) {
  int halvings = kMostHalvings;
  return bound(triangle, surface, nullptr, halvings);
}

double lying_inside(const Corners& triangle, const Surface& solid) {
  int halvings = kMostHalvings;
  return bound(triangle, solid.bvh(), &solid, halvings);
}

}  // namespace rlacd
