#include "convex/even_out.hpp"

#include "convex/hull.hpp"
#include "core/mesh_measures.hpp"
#include "core/stop.hpp"

namespace rlacd {
namespace {

constexpr int kRounds = 4, kStepsARound = 50, kSteps = kRounds * kStepsARound;  // the power doubles with each round
constexpr int kSquares = 2;         // in the first round, the power is 2 to this
constexpr double kFirstMove = 0.5;  // of the farthest corner, as a share of its distance

// Where nearly little enough is reached, it is tried again from there: large moves lead to another arrangement.
constexpr int kTries = 4;
constexpr double kNearly = 1.2;

struct Cut {
  double depth;     // how far the inner hull reaches beyond the facet; negative if it does not
  double scale;     // of the outer hull, that would just hold it; infinite if none does
  double share[3];  // barycentric coordinates of the deepest point, at least 0
  Vec3 normal;
};

// How the inner hull reaches beyond a facet of the outer one; both are around the origin.
Cut cut_by(const Mesh& outer, const Triangle& face, const std::vector<Vec3>& inner) {
  const Vec3 a = outer.vertices[face[0]], b = outer.vertices[face[1]], c = outer.vertices[face[2]];
  const Vec3 product = cross(b - a, c - a);
  const double area = norm(product);
  Cut cut{0, 1, {0, 0, 0}, area > 0 ? (1 / area) * product : Vec3{}};
  const double offset = dot(cut.normal, a);
  double most = -1;
  Vec3 deepest;
  for (const Vec3 p : inner)
    if (const double height = dot(cut.normal, p); height > most) most = height, deepest = p;
  cut.depth = most - offset;
  cut.scale = offset > 0 ? most / offset : kInfinity;
  const Vec3 q = deepest - cut.depth * cut.normal;
  double sum = 0;
  for (int i = 0; i < 3; ++i) {
    const Vec3 from = outer.vertices[face[(i + 1) % 3]], to = outer.vertices[face[(i + 2) % 3]];
    sum += cut.share[i] = std::max(0.0, dot(cut.normal, cross(to - from, q - from)));
  }
  for (double& share : cut.share) share /= sum;
  return cut;
}

double power_of(double value, int squares) {
  for (int i = 0; i < squares; ++i) value *= value;
  return value;
}

struct Step {
  std::vector<Vec3> moved;
  double scale = 1;  // at which the corners hold the inner hull before they are moved
};

// The corners of the outer hull, moved; both hulls are around the origin, and the surface around `middle`.
Step step_from(const Mesh& outer, const std::vector<Vec3>& inner, Vec3 middle, const Bvh& surface, double share,
               int squares) {
  const std::size_t count = outer.vertices.size();
  std::vector<Vec3> in(count), out(count);
  std::vector<double> weight(count, 0.0);
  double farthest = 0;
  for (std::size_t i = 0; i < count; ++i) {
    in[i] = surface.closest(outer.vertices[i] + middle).point - middle - outer.vertices[i];
    farthest = std::max(farthest, norm(in[i]));
  }
  for (Vec3& way : in)
    if (const double far = norm(way); far > 0) way = share * power_of(far / farthest, squares) * (farthest / far) * way;
  Step step;
  for (const Triangle& face : outer.faces) {
    const Cut cut = cut_by(outer, face, inner);
    step.scale = std::max(step.scale, cut.scale);
    double depth = cut.depth, length2 = 0;
    for (int i = 0; i < 3; ++i) {
      depth -= cut.share[i] * dot(cut.normal, in[face[i]]);
      length2 += cut.share[i] * cut.share[i];
    }
    if (!(depth > 0) || !(length2 > 0)) continue;
    for (int i = 0; i < 3; ++i) {
      out[face[i]] = out[face[i]] + (depth * cut.share[i] / length2) * cut.normal;
      weight[face[i]] += cut.share[i];
    }
  }
  for (std::size_t i = 0; i < count; ++i)
    step.moved.push_back(outer.vertices[i] + in[i] + 1 / std::max(1.0, weight[i]) * out[i]);
  return step;
}

double farthest_out(const std::vector<Vec3>& corners, const Bvh& surface) {
  double farthest = 0;
  for (const Vec3 p : corners) farthest = std::max(farthest, surface.closest(p).distance2);
  return std::sqrt(farthest);
}

}  // namespace

Mesh evened_out(Mesh outer, const ConvexBody& body, double enough) {
  const Mesh& inner = body.mesh();
  const Bvh& surface = body.bvh();
  double least = farthest_out(outer.vertices, surface), least_volume = mesh_volume(outer);
  if (least <= enough) return outer;
  const Vec3 middle = middle_of(inner.vertices);
  std::vector<Vec3> inside, corners, best;
  for (const Vec3 p : inner.vertices) inside.push_back(p - middle);
  for (const Vec3 p : outer.vertices) corners.push_back(p - middle);
  for (int count = 0; count < kTries * kSteps; ++count) {
    const int number = count % kSteps;
    if (number == 0 && count > 0 && !(least > enough && least < kNearly * enough)) break;
    poll_stop();
    const Mesh now = hull_mesh(corners);
    if (now.faces.empty()) break;
    const double share = kFirstMove * (1 - static_cast<double>(number) / kSteps);
    const Step step = step_from(now, inside, middle, surface, share, kSquares + number / kStepsARound);
    corners = step.moved;
    if (!std::isfinite(step.scale)) continue;
    std::vector<Vec3> around;
    for (const Vec3 p : now.vertices) around.push_back(middle + step.scale * p);
    const double reached = std::max(farthest_out(around, surface), enough);
    const double volume = step.scale * step.scale * step.scale * mesh_volume(now);
    if (reached < least || (reached == least && volume < least_volume))
      least = reached, least_volume = volume, best = std::move(around);
  }
  return best.empty() ? outer : hull_mesh(best);
}

}  // namespace rlacd
