#include "distance/concavity.hpp"

#include <stdexcept>

#include "distance/surface_field.hpp"
#include "hull/convex_planes.hpp"

namespace rlacd {
namespace {

constexpr double kUndecided = 1e-3;
constexpr std::size_t kProbes = 64;

// Distance from points inside a hull to its surface; the witnesses are its planes.
class DepthField {
 public:
  explicit DepthField(const ConvexPlanes& planes) : planes_(planes) {}

  Sample at(Vec3 p, std::int32_t, double) const {
    const ConvexPlanes::Nearest nearest = planes_.nearest(p);
    return {std::max(nearest.depth, 0.0), nearest.plane};
  }
  double from(std::int32_t plane, Vec3 p) const { return std::max(planes_.depth(plane, p), 0.0); }

 private:
  const ConvexPlanes& planes_;
};

void check(const Mesh& part, const Mesh& hull) {
  if (part.faces.empty()) throw std::invalid_argument("the part has no faces");
  if (hull.faces.empty()) throw std::invalid_argument("the hull has no faces");
}

// Newton's method: std::cbrt has other last bits in every C library, and the search compares these numbers.
double cube_root(double x) {
  if (!(x > 0) || std::isinf(x)) return x;
  int exponent = 0;
  double mantissa = std::frexp(x, &exponent);
  while (exponent % 3 != 0) {
    mantissa *= 2;
    --exponent;
  }
  double root = 1;
  for (int i = 0; i < 8; ++i) root -= (root * root * root - mantissa) / (3 * root * root);
  return std::ldexp(root, exponent / 3);
}

}  // namespace

double volume_radius(double part_volume, double hull_volume) {
  return cube_root(std::max(0.0, 3 * (hull_volume - part_volume) / (4 * kPi)));
}

Concavity concavity(const Mesh& part, const Mesh& hull, double part_volume, double hull_volume, double tolerance,
                    double floor, const TreeCache& tree) {
  check(part, hull);
  const ConvexPlanes planes(hull);
  const DepthField depth(planes);
  const SurfaceField distance(tree.of(part));
  Concavity result;
  result.volume_radius = volume_radius(part_volume, hull_volume);
  Goal goal;
  goal.tolerance = tolerance;
  goal.pass = std::max(floor, kVolumeWeight * result.volume_radius + tolerance);
  result.part_to_hull = maximize(depth, part, goal);
  goal.pass = std::max(goal.pass, result.part_to_hull.lower + tolerance);
  result.hull_to_part = maximize(distance, hull, goal);
  return result;
}

bool meets_concavity(const Mesh& part, const Mesh& hull, double part_volume, double hull_volume, double threshold,
                     const TreeCache& tree) {
  check(part, hull);
  if (!(kVolumeWeight * volume_radius(part_volume, hull_volume) <= threshold)) return false;
  const ConvexPlanes planes(hull);

  // A few corners spread over the part reject most failures before any triangle is examined.
  const std::size_t stride = std::max<std::size_t>(1, part.faces.size() / kProbes);
  for (std::size_t f = 0; f < part.faces.size(); f += stride)
    if (planes.nearest(part.vertices[part.faces[f][0]]).depth > threshold) return false;

  Goal goal;
  goal.tolerance = kUndecided * threshold;
  goal.pass = threshold;
  goal.fail = threshold;
  const DepthField depth(planes);
  if (!(maximize(depth, part, goal).upper <= threshold)) return false;
  const SurfaceField distance(tree.of(part));
  return maximize(distance, hull, goal).upper <= threshold;
}

}  // namespace rlacd
