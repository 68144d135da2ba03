#include "solid/concavity.hpp"

#include <stdexcept>

#include "core/elementary.hpp"
#include "surface/surface_field.hpp"

namespace rlacd {
namespace {

constexpr double kUndecided = 1e-3;
constexpr std::size_t kProbes = 64;

// Distance from points inside a hull to its surface; the witnesses are its planes.
class DepthField {
 public:
  explicit DepthField(const ConvexBody& hull) : planes_(hull.planes()) {
    settled_.fill(-1);
    const Box& box = hull.box();
    centre_ = 0.5 * (box.lower + box.upper);
    const Vec3 half = 0.5 * (box.upper - box.lower);
    for (int axis = 0; axis < 3; ++axis) shrink_[axis] = half[axis] > 0 ? 1 / half[axis] : 0;
  }

  Sample at(Vec3 p, std::int32_t, double) const {
    const ConvexPlanes::Nearest nearest = planes_.nearest(p);
    return {std::max(nearest.depth, 0.0), nearest.plane};
  }
  double from(std::int32_t plane, Vec3 p) const { return std::max(planes_.depth(plane, p), 0.0); }

  // Triangles in the same direction from the hull's centre mostly lie below the same facet: the plane that settled the
  // last one is tried first, and all planes only if it fails.
  double quick_upper(const Corners& corner) const {
    const std::int32_t plane = settled_[direction_of(corner)];
    if (plane < 0) return std::numeric_limits<double>::infinity();
    return std::max({from(plane, corner[0]), from(plane, corner[1]), from(plane, corner[2])});
  }
  void settled(const Corners& corner, std::int32_t plane) { settled_[direction_of(corner)] = plane; }

 private:
  // Directions are binned by the face of a cube they leave through and an 8 x 8 grid on it.
  static constexpr int kGrid = 8;
  std::size_t direction_of(const Corners& corner) const {
    Vec3 d = (1.0 / 3.0) * (corner[0] + corner[1] + corner[2]) - centre_;
    for (int axis = 0; axis < 3; ++axis) d[axis] *= shrink_[axis];
    const int axis = longest_axis(d);
    const double longest = std::fabs(d[axis]);
    if (!(longest > 0)) return 0;
    const auto grid = [&](double t) {
      return std::clamp(static_cast<int>((t / longest + 1) * (kGrid / 2)), 0, kGrid - 1);
    };
    const int side = 2 * axis + (d[axis] > 0 ? 1 : 0);
    return static_cast<std::size_t>((side * kGrid + grid(d[(axis + 1) % 3])) * kGrid + grid(d[(axis + 2) % 3]));
  }

  const ConvexPlanes& planes_;
  Vec3 centre_, shrink_;
  std::array<std::int32_t, 6 * kGrid * kGrid> settled_;
};

void check(const Mesh& part, const ConvexBody& hull) {
  if (part.faces.empty()) throw std::invalid_argument("the part has no faces");
  if (hull.mesh().faces.empty()) throw std::invalid_argument("the hull has no faces");
}

}  // namespace

double volume_radius(double part_volume, double hull_volume) {
  return cube_root(std::max(0.0, 3 * (hull_volume - part_volume) / (4 * kPi)));
}

Concavity concavity(const Mesh& part, const ConvexBody& hull, double part_volume, double hull_volume, double tolerance,
                    double floor, const TreeCache& tree) {
  check(part, hull);
  DepthField depth(hull);
  SurfaceField distance(tree.of(part));
  Concavity result;
  result.volume_radius = volume_radius(part_volume, hull_volume);
  Goal goal;
  goal.tolerance = tolerance;
  goal.pass = std::max(floor, kVolumeWeight * result.volume_radius + tolerance);
  result.part_to_hull = maximize(depth, part, goal);
  goal.pass = std::max(goal.pass, result.part_to_hull.lower + tolerance);
  result.hull_to_part = maximize(distance, hull.mesh(), goal);
  return result;
}

bool meets_concavity(const Mesh& part, const ConvexBody& hull, double part_volume, double hull_volume, double threshold,
                     const TreeCache& tree) {
  check(part, hull);
  if (!(kVolumeWeight * volume_radius(part_volume, hull_volume) <= threshold)) return false;

  // A few corners spread over the part reject most failures before any triangle is examined.
  const std::size_t stride = std::max<std::size_t>(1, part.faces.size() / kProbes);
  for (std::size_t f = 0; f < part.faces.size(); f += stride)
    if (hull.planes().nearest(part.vertices[part.faces[f][0]]).depth > threshold) return false;

  Goal goal;
  goal.tolerance = kUndecided * threshold;
  goal.pass = threshold;
  goal.fail = threshold;
  DepthField depth(hull);
  if (!(maximize(depth, part, goal).upper <= threshold)) return false;
  SurfaceField distance(tree.of(part));
  return maximize(distance, hull.mesh(), goal).upper <= threshold;
}

}  // namespace rlacd
