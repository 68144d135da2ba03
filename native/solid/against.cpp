#include "solid/against.hpp"

#include <algorithm>
#include <queue>
#include <tuple>

#include "convex/hull.hpp"
#include "convex/lying.hpp"
#include "convex/polygon.hpp"
#include "core/mesh_measures.hpp"
#include "core/stop.hpp"
#include "solid/caps.hpp"

namespace rlacd {
namespace {

// Facet planes are moved out by this before they cut the solid, so that faces on them stay whole.
constexpr double kApart = 1e-10;

// Where a solid crosses itself, each cut may multiply its crossings: one that doubles its faces, and adds so many, is
// given up.
constexpr std::size_t kManyNewFaces = 1000;

// Where a verdict is undecided, as a share of the threshold.
constexpr double kUndecided = 1e-3;

// Limits on the looks at the joint hull of a pair: this many besides the facets, down to this share of the threshold.
// Most pairs are never united.
constexpr int kMostLooks = 64;
constexpr double kSmall = 0.2;

// Points of a cell may be farther out than its middle by its radius, but hardly ever are by more than this share of it.
constexpr double kFarther = 0.25;

// Clips a polygon to the points deeper than t under all planes; returns a plane under which none is, or -1.
std::int32_t clip_deeper(Polygon& polygon, const ConvexPlanes& planes, double t) {
  for (std::int32_t i = 0; i < static_cast<std::int32_t>(planes.size()); ++i)
    if (!keep_below(polygon, [&](Vec3 p) { return t - planes.depth(i, p); })) return i;
  return -1;
}

// The region deeper than t under all planes. Most objects are outside it, and mostly because of the same plane as those
// before them.
class Depths {
 public:
  Depths(const ConvexPlanes& planes, double t) : planes_(planes), t_(t) {}

  bool holds(Vec3 p) {
    if (planes_.depth(last_, p) <= t_) return false;
    const std::int32_t plane = planes_.first_within(p, t_);
    if (plane >= 0) last_ = plane;
    return plane < 0;
  }

  // Whether a box certainly has no point in the region.
  bool misses(const Box& box) {
    const Vec3 middle = 0.5 * (box.lower + box.upper), half = 0.5 * (box.upper - box.lower);
    const auto is_off = [&](std::int32_t plane) {
      return planes_.depth(plane, middle) + reach_along(planes_.normal(plane), half) <= t_;
    };
    if (is_off(last_)) return true;
    const std::int32_t plane = planes_.nearest(middle).plane;
    if (!is_off(plane)) return false;
    last_ = plane;
    return true;
  }

  // Whether some point of a triangle is in the region.
  bool meets(Vec3 a, Vec3 b, Vec3 c) {
    if (std::max({planes_.depth(last_, a), planes_.depth(last_, b), planes_.depth(last_, c)}) <= t_) return false;
    polygon_.assign({a, b, c});
    const std::int32_t plane = clip_deeper(polygon_, planes_, t_);
    if (plane >= 0) last_ = plane;
    return plane < 0 && planes_.nearest(middle_of(polygon_)).depth > t_;
  }

 private:
  const ConvexPlanes& planes_;
  const double t_;
  std::int32_t last_ = 0;  // the plane that excluded the last object
  Polygon polygon_;
};

// A piece of a facet.
struct Look {
  Corners corner;
  Vec3 middle;
  double radius;
  std::int32_t hint;        // the slot of a nearby face of the solid
  double most = kInfinity;  // how far a point of the cell outside the solid may well be

  Look(const Corners& t, std::int32_t near) : corner(t), middle((1.0 / 3) * (t[0] + t[1] + t[2])), hint(near) {
    radius = std::sqrt(std::max({norm2(t[0] - middle), norm2(t[1] - middle), norm2(t[2] - middle)}));
  }
  bool operator<(const Look& other) const { return most < other.most; }
};

// Depth of points under the planes of a hull, 0 outside; the witnesses are the planes.
class DepthField {
 public:
  explicit DepthField(const ConvexBody& hull) : planes_(hull.planes()) {}

  Sample at(Vec3 p, std::int32_t hint, double enough) const {
    if (hint >= 0)
      if (const double depth = from(hint, p); depth <= enough) return {depth, hint};
    const ConvexPlanes::Nearest nearest = planes_.nearest(p);
    return {std::max(nearest.depth, 0.0), nearest.plane};
  }
  double from(std::int32_t plane, Vec3 p) const { return std::max(planes_.depth(plane, p), 0.0); }
  double lying(const Corners&) const { return kInfinity; }  // what lies in the hull's facets has one witness

 private:
  const ConvexPlanes& planes_;
};

// Distance to a solid, 0 inside. The witnesses are the triangles of its surface, by their slots, and balls inside it,
// by negative numbers: a point that is `radius` inside is at least so far from everything outside.
class SolidField {
 public:
  explicit SolidField(const Surface& surface) : surface_(surface) {}

  Sample at(Vec3 p, std::int32_t hint, double enough) const {
    std::int32_t near = hint;
    if (is_ball(hint)) {
      if (const double away = from(hint, p); away <= enough) return {away, hint};
      near = ball(hint).near;
    }
    const Bvh::Hit hit = surface_.bvh().closest(p, near, enough);
    const double distance = std::sqrt(hit.distance2);
    // On the surface, up to rounding, there is no ball.
    if (distance <= std::max(enough, kHair) || !surface_.holds(p)) return {distance, hit.slot};
    balls_.push_back({p, distance, hit.slot});
    return {0, kFirstBall - static_cast<std::int32_t>(balls_.size() - 1)};
  }
  double from(std::int32_t witness, Vec3 p) const {
    if (!is_ball(witness)) return surface_.bvh().distance(witness, p);
    return std::max(0.0, norm(p - ball(witness).middle) - ball(witness).radius);
  }
  double lying(const Corners& t) const { return lying_inside(t, surface_); }

 private:
  struct InnerBall {
    Vec3 middle;
    double radius;
    std::int32_t near;  // the slot of a triangle that it touches
  };
  static constexpr std::int32_t kFirstBall = -2;
  static bool is_ball(std::int32_t witness) { return witness <= kFirstBall; }
  const InnerBall& ball(std::int32_t witness) const { return balls_[static_cast<std::size_t>(kFirstBall - witness)]; }

  const Surface& surface_;
  mutable std::vector<InnerBall> balls_;  // of one thread
};

template <class Field>
Interval measured(const Field& field, const Mesh& mesh, const Goal& goal) {
  const Interval found = maximize(field, mesh, goal, 1);
  return {found.lower, tightened(field, mesh, found)};
}

}  // namespace

bool Against::leads_farther(const ConvexBody& hull, double threshold) const {
  Goal goal;
  goal.tolerance = kUndecided * threshold;
  goal.pass = goal.rough = goal.fail = threshold;
  return !(maximize(SolidField(surface_), hull.mesh(), goal, 1).upper <= threshold);
}

Against::Fit Against::measure(const ConvexBody& hull, double tolerance, double floor) const {
  Fit fit;
  Goal goal;
  goal.tolerance = tolerance;
  goal.pass = goal.rough = std::max(floor, tolerance);
  fit.depth = measured(DepthField(hull), faces_inside(hull), goal);
  goal.pass = goal.rough = std::max(goal.pass, fit.depth.lower + tolerance);
  fit.reach = measured(SolidField(surface_), hull.mesh(), goal);
  return fit;
}

Mesh Against::faces_inside(const ConvexBody& hull) const {
  Mesh inside;
  Polygon polygon;
  const auto visit = [&](std::int32_t slot) {
    const Corners corners = corners_of(solid_, solid_.faces[surface_.bvh().face(slot)]);
    polygon.assign(corners.begin(), corners.end());
    if (clip_deeper(polygon, hull.planes(), 0) >= 0) return false;
    const auto first = static_cast<std::int32_t>(inside.vertices.size());
    inside.vertices.insert(inside.vertices.end(), polygon.begin(), polygon.end());
    for (std::size_t i = 2; i < polygon.size(); ++i) {
      const auto last = first + static_cast<std::int32_t>(i);
      inside.faces.push_back({first, last - 1, last});
    }
    return false;
  };
  surface_.bvh().any_of([&](const Box& box) { return poll_stop(), box.meets(hull.box()); }, visit);
  return inside;
}

Mesh Against::inside(const ConvexBody& hull) const {
  Mesh mesh = solid_;
  std::size_t fewest = mesh.faces.size();
  for (std::int32_t i = 0; i < static_cast<std::int32_t>(hull.planes().size()); ++i) {
    const Plane plane = {hull.planes().normal(i), hull.planes().offset(i) + kApart};
    if (std::none_of(mesh.vertices.begin(), mesh.vertices.end(), [&](Vec3 p) { return plane.depth(p) < 0; })) continue;
    mesh = capped(std::move(cut_by_plane(mesh, plane.normal, plane.offset)[0]), plane.normal);
    if (mesh.faces.size() > 2 * fewest + kManyNewFaces) return {};
    fewest = std::min(fewest, mesh.faces.size());
  }
  return mesh;
}

double Against::feasible_volume(const ConvexBody& first, const ConvexBody& second, double threshold) const {
  const std::vector<Vec3>&all_first = first.mesh().vertices, &all_second = second.mesh().vertices;
  const ConvexBody few(hull_mesh(joined(first.few_corners(), second.few_corners())));
  if (!few.mesh().faces.empty() && comes_deeper(few, threshold)) return kInfinity;
  const bool are_all = &first.few_corners() == &all_first && &second.few_corners() == &all_second;
  const ConvexBody body(are_all ? few.mesh() : hull_mesh(joined(all_first, all_second)));
  const Mesh& hull = body.mesh();
  std::vector<char> is_new(hull.faces.size(), 1);
  const auto before = [](Vec3 p, Vec3 q) { return std::tie(p.x, p.y, p.z) < std::tie(q.x, q.y, q.z); };
  for (const ConvexBody* one : {&first, &second}) {
    std::vector<Vec3> own = one->mesh().vertices;
    std::sort(own.begin(), own.end(), before);
    std::vector<char> is_own(hull.vertices.size());
    std::transform(hull.vertices.begin(), hull.vertices.end(), is_own.begin(),
                   [&](Vec3 p) { return std::binary_search(own.begin(), own.end(), p, before); });
    for (std::size_t f = 0; f < hull.faces.size(); ++f) {
      const auto [a, b, c] = hull.faces[f];
      if (is_own[a] && is_own[b] && is_own[c]) is_new[f] = 0;
    }
  }
  std::vector<Triangle> facets;
  for (std::size_t f = 0; f < hull.faces.size(); ++f)
    if (is_new[f]) facets.push_back(hull.faces[f]);
  if (!are_all && (is_missed(hull, facets, threshold, 0) || comes_deeper(body, threshold))) return kInfinity;
  return is_missed(hull, facets, threshold, kMostLooks) ? kInfinity : mesh_volume(hull);
}

bool Against::comes_deeper(const ConvexBody& hull, double threshold) const {
  Depths depths(hull.planes(), threshold);
  Box inner = hull.box();
  inner.lower = inner.lower + Vec3{threshold, threshold, threshold};
  inner.upper = inner.upper - Vec3{threshold, threshold, threshold};
  const auto may_come = [&](const Box& box) {
    poll_stop();
    return box.meets(inner) && !depths.misses(box);
  };
  return surface_.bvh().any_of(may_come, [&](std::int32_t slot) {
    const Corners t = corners_of(solid_, solid_.faces[surface_.bvh().face(slot)]);
    return std::any_of(t.begin(), t.end(), [&](Vec3 corner) { return inner.holds(corner) && depths.holds(corner); }) ||
           depths.meets(t[0], t[1], t[2]);
  });
}

bool Against::is_missed(const Mesh& hull, const std::vector<Triangle>& facets, double threshold, int most) const {
  std::priority_queue<Look> open;
  // Whether the middle of a cell is missed; the cell stays open if another point of it may well be.
  const auto look_at = [&](Look cell) {
    poll_stop();
    if (cell.radius < kSmall * threshold) return false;
    const double enough = std::max(kEnough * threshold, threshold - cell.radius), within = threshold + kHair;
    const Bvh::Hit hit = surface_.bvh().closest(cell.middle, cell.hint, enough, within);
    const double distance = std::sqrt(hit.distance2);  // `within` if nothing is nearer
    const bool is_far = distance > threshold;
    if (is_far && !surface_.holds(cell.middle)) return true;
    // On the way from a middle inside the solid to a point outside, the surface comes no sooner than its distance.
    cell.most = kFarther * cell.radius + (is_far ? -distance : distance);
    cell.hint = hit.slot;
    if (cell.most > threshold) open.push(cell);
    return false;
  };
  for (const Triangle& facet : facets)
    if (look_at(Look(corners_of(hull, facet), -1))) return true;
  for (int looked = 0; looked < most && !open.empty(); looked += 2) {
    const Look cell = open.top();
    open.pop();
    for (const Corners& half : halves(cell.corner))
      if (look_at(Look(half, cell.hint))) return true;
  }
  return false;
}

}  // namespace rlacd
