#include "solid/concavity.hpp"

#include <stdexcept>

#include "core/elementary.hpp"
#include "surface/surface_field.hpp"

namespace rlacd {
namespace {

constexpr double kUndecided = 1e-3;

// Distance from points inside a hull to its surface; the witnesses are its planes.
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

 private:
  const ConvexPlanes& planes_;
};

// The maximum, bounded also by the witness of every triangle's centre alone: exact for a convex part, whose triangles
// lie on those they are measured to.
template <class Field>
Interval measured(const Field& field, const Mesh& mesh, const Goal& goal) {
  Interval found = maximize(field, mesh, goal, 1);
  double most = found.lower;
  for (std::size_t f = 0; f < mesh.faces.size() && most < found.upper; ++f) {
    const Corners corner = corners_of(mesh, mesh.faces[f]);
    const std::int32_t witness = field.at((1.0 / 3.0) * (corner[0] + corner[1] + corner[2]), -1, 0).witness;
    for (const Vec3& point : corner) most = std::max(most, field.from(witness, point));
  }
  found.upper = std::min(found.upper, most);
  return found;
}

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
  Concavity result;
  result.volume_radius = volume_radius(part_volume, hull_volume);
  Goal goal;
  goal.tolerance = tolerance;
  goal.pass = goal.rough = std::max(floor, kVolumeWeight * result.volume_radius + tolerance);
  result.part_to_hull = measured(DepthField(hull), part, goal);
  goal.pass = goal.rough = std::max(goal.pass, result.part_to_hull.lower + tolerance);
  result.hull_to_part = measured(SurfaceField(tree.of(part)), hull.mesh(), goal);
  return result;
}

bool meets_concavity(const Mesh& part, const ConvexBody& hull, double part_volume, double hull_volume, double threshold,
                     const TreeCache& tree) {
  check(part, hull);
  if (!(kVolumeWeight * volume_radius(part_volume, hull_volume) <= threshold)) return false;

  Goal goal;
  goal.tolerance = kUndecided * threshold;
  goal.pass = goal.rough = goal.fail = threshold;
  return maximize(DepthField(hull), part, goal, 1).upper <= threshold &&
         maximize(SurfaceField(tree.of(part)), hull.mesh(), goal, 1).upper <= threshold;
}

}  // namespace rlacd
