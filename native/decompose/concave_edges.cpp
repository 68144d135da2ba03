#include "decompose/concave_edges.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <numeric>

#include "core/elementary.hpp"
#include "core/mesh_measures.hpp"
#include "core/stop.hpp"
#include "surface/edges.hpp"

namespace rlacd {

namespace {

constexpr double kReflex = 10 * kPi / 180;  // flatter edges tessellate curves
constexpr double kFold =
    0.1 * kPi / 180;  // two faces this close in angle enclose a slit or a film: rounding decides which
constexpr std::size_t kMostAtVertex = 4;  // more reflex edges at a vertex mean a rough surface, not a crease
constexpr std::size_t kContenders = 256;  // edges that are compared with each other; scans have thousands
// In single precision, corners this close to a face's plane are on it, and normals of thinner faces are meaningless.
constexpr double kSinglePrecision = 1e-6;
constexpr double kSameDirection = 3e-7;  // a normal this close to a coordinate axis is replaced by it
constexpr double kSamePlane = 1e-4;      // between coordinates of planes

struct ReflexEdge {
  std::int32_t end[2];   // vertices, ascending
  std::int32_t face[2];  // the first one runs from the first end to the second
  Vec3 normal[2];        // outward unit normals of the faces
  double angle;          // dihedral angle minus pi, in (0, pi)
};

// Edges whose dihedral angle inside the solid exceeds pi, by ascending vertices, which exactly two faces use, in
// opposite directions. Folds, which rounding may turn inside out, and needle-thin faces are left out.
std::vector<ReflexEdge> reflex_edges(const Mesh& mesh) {
  std::vector<Vec3> normals;
  std::vector<double> doubled_area;
  normals.reserve(mesh.faces.size());
  doubled_area.reserve(mesh.faces.size());
  for (const Triangle& f : mesh.faces) {
    const Vec3 scaled = long_normal(mesh, f);
    doubled_area.push_back(norm(scaled));
    normals.push_back(scaled / std::max(doubled_area.back(), std::numeric_limits<double>::min()));
  }

  std::vector<ReflexEdge> found;
  const auto add_if_reflex = [&](std::int32_t low, std::int32_t high, std::int32_t f, std::int32_t g) {
    // Seen along the edge, outward normals turn to the left over a ridge and to the right in a valley.
    const Vec3 along = mesh.vertices[high] - mesh.vertices[low];
    const double turn = dot(cross(normals[g], normals[f]), along);
    if (!(turn > 0)) return;
    const double length = norm(along);
    const double angle = angle_of(turn, length * dot(normals[f], normals[g]));
    if (angle > kReflex && angle < kPi - kFold &&
        std::min(doubled_area[f], doubled_area[g]) > kSinglePrecision * length)
      found.push_back({{low, high}, {f, g}, {normals[f], normals[g]}, angle});
  };

  Buckets<Run> runs = sorted_halfedges(mesh.faces, mesh.vertices.size());
  for (std::size_t v = 0; v < mesh.vertices.size(); ++v) {
    poll_stop();
    const auto [begin, end] = runs.range(v);
    for (const Run *r = begin, *next; r != end; r = next) {
      next = std::find_if(r, static_cast<const Run*>(end), [r](const Run& other) { return other.high != r->high; });
      if (next - r != 2 || r->high == static_cast<std::int32_t>(v)) continue;
      const auto face_of = [](const Run& run) { return static_cast<std::int32_t>(run.halfedge / 3); };
      const bool is_first = ascends(mesh.faces, v, r[0]);
      if (is_first == ascends(mesh.faces, v, r[1])) continue;
      const Run &up = is_first ? r[0] : r[1], &down = is_first ? r[1] : r[0];
      add_if_reflex(static_cast<std::int32_t>(v), r->high, face_of(up), face_of(down));
    }
  }
  return found;
}

Vec3 middle(const Mesh& mesh, const ReflexEdge& edge) {
  return 0.5 * (mesh.vertices[edge.end[0]] + mesh.vertices[edge.end[1]]);
}

// Length of the whole crease that each edge belongs to, capped at `most`.
std::vector<double> crease_lengths(const Mesh& mesh, const std::vector<ReflexEdge>& edges, double most) {
  struct End {
    std::int32_t vertex, edge;
    Vec3 outgoing;
  };
  std::vector<double> length;
  std::vector<End> ends;
  for (const ReflexEdge& edge : edges) length.push_back(norm(mesh.vertices[edge.end[1]] - mesh.vertices[edge.end[0]]));
  for (const int side : {0, 1})
    for (std::size_t i = 0; i < edges.size(); ++i) {
      const Vec3 along = mesh.vertices[edges[i].end[1 - side]] - mesh.vertices[edges[i].end[side]];
      ends.push_back({edges[i].end[side], static_cast<std::int32_t>(i), along / length[i]});
    }
  std::stable_sort(ends.begin(), ends.end(), [](const End& a, const End& b) { return a.vertex < b.vertex; });

  Groups creases(edges.size());
  for (std::size_t i = 0; i < ends.size(); ++i)  // edges that turn by less than 30 degrees continue each other
    for (std::size_t j = i + 1; j < std::min(i + kMostAtVertex, ends.size()) && ends[j].vertex == ends[i].vertex; ++j)
      if (dot(ends[i].outgoing, ends[j].outgoing) < -kHalfRootOfThree) creases.join(ends[j].edge, ends[i].edge);
  const auto [count, crease] = creases.labels();
  std::vector<double> total(static_cast<std::size_t>(count), 0), result;
  for (std::size_t i = 0; i < edges.size(); ++i) total[crease[i]] += length[i];
  for (std::size_t i = 0; i < edges.size(); ++i) result.push_back(std::min(total[crease[i]], most));
  return result;
}

Vec3 snapped(Vec3 n) {
  const double largest = max_abs(n);
  Vec3 nearest;
  for (int axis = 0; axis < 3; ++axis)
    if (std::fabs(n[axis]) == largest) nearest[axis] = n[axis] > 0 ? 1 : -1;
  return (norm(n - nearest) < kSameDirection ? nearest : n) + Vec3{};  // no -0.0
}

// The three planes that contain an edge: the bisector of the reflex angle, and the planes of its two faces, normals
// pointing outwards.
using EdgePlanes = std::array<Plane, 3>;

EdgePlanes planes_of(const Mesh& mesh, const ReflexEdge& edge) {
  const Vec3 across = edge.normal[0] - edge.normal[1];  // at least 0.17 long
  const Vec3 centre = middle(mesh, edge);
  EdgePlanes planes;
  for (int k = 0; k < 3; ++k) {
    const Vec3 normal = snapped(k == 0 ? across / norm(across) : edge.normal[k - 1]);
    planes[k] = {normal, dot(normal, centre)};
  }
  return planes;
}

// Coordinates that tell planes apart regardless of the normal's sign: the unit normal, and the height above the centre
// of a box in units of its radius.
class PlaneSpace {
 public:
  explicit PlaneSpace(const Box& box)
      : centre_(0.5 * (box.lower + box.upper)), radius_(norm(box.upper - box.lower) / 2) {}

  // By differences: a sum of squares minus a product would leave 1e-8 between equal planes, and that noise would decide
  // between equivalent edges.
  double difference(const Plane& p, const Plane& q) const {
    const double hp = height(p), hq = height(q);
    const double same_way = norm2(p.normal - q.normal) + (hp - hq) * (hp - hq);
    const double other_way = norm2(p.normal + q.normal) + (hp + hq) * (hp + hq);
    return std::sqrt(std::min(same_way, other_way));
  }

 private:
  double height(const Plane& p) const { return (p.offset - dot(p.normal, centre_)) / radius_; }

  Vec3 centre_;
  double radius_;
};

struct Contender {
  ReflexEdge edge;
  double weight;
  Vec3 centre;
  EdgePlanes planes;
  double distance = 1;                     // to the nearest chosen edge, once there is one
  std::array<double, 3> novelty{1, 1, 1};  // difference of each plane from the nearest chosen one

  double score() const {
    if (!(*std::max_element(novelty.begin(), novelty.end()) > kSamePlane)) return 0;
    return weight * distance * ((novelty[0] + novelty[1] + novelty[2]) / 3);
  }
};

std::vector<ReflexEdge> spread_out(std::vector<Contender>& contenders, const PlaneSpace& space, std::size_t count) {
  std::vector<ReflexEdge> chosen;
  std::vector<double> score(contenders.size());
  while (chosen.size() < count) {
    poll_stop();
    std::transform(contenders.begin(), contenders.end(), score.begin(), [](const Contender& c) { return c.score(); });
    // Of scores this close the first is taken, so that rounding does not decide.
    const double enough = (1 - kHair) * *std::max_element(score.begin(), score.end());
    const auto place = std::find_if(score.begin(), score.end(), [enough](double s) { return s >= enough; });
    if (!(*place > 0)) break;
    const Contender best = contenders[static_cast<std::size_t>(place - score.begin())];
    for (Contender& c : contenders) {
      const double away = norm(c.centre - best.centre);
      c.distance = chosen.empty() ? away : std::min(c.distance, away);
      for (int k = 0; k < 3; ++k)
        for (const Plane& taken : best.planes)
          c.novelty[k] = std::min(c.novelty[k], space.difference(c.planes[k], taken));
    }
    chosen.push_back(best.edge);
  }
  return chosen;
}

// The offset that puts a face, and everything coplanar with it, below its plane.
double above_face(const Mesh& mesh, const Triangle& face, Vec3 outward) {
  double top = -kInfinity;
  for (const std::int32_t corner : face) top = std::max(top, dot(mesh.vertices[corner], outward));
  double flat = top;
  for (const Vec3 p : mesh.vertices)
    if (const double height = dot(p, outward); height <= top + kSinglePrecision) flat = std::max(flat, height);
  return max_abs(outward) == 1 ? flat : flat + kHair;
}

// Of the two representations of a plane, the one whose normal has a positive largest coordinate.
Plane turned(const Plane& plane) {
  if (plane.normal[longest_axis(plane.normal)] > 0) return plane;
  return {Vec3{} - plane.normal, -plane.offset};
}

// Up to `count` of a mesh's reflex edges; edges that offer no new plane are never chosen.
std::vector<ReflexEdge> chosen_edges(const Mesh& mesh, const ConvexBody& hull, std::size_t count) {
  const std::vector<ReflexEdge> edges = reflex_edges(mesh);
  if (edges.empty() || count == 0) return {};
  const Box& box = hull.box();
  const std::vector<double> length = crease_lengths(mesh, edges, max_abs(box.upper - box.lower));
  std::vector<double> weight;
  for (std::size_t i = 0; i < edges.size(); ++i)
    weight.push_back(edges[i].angle * length[i] * std::max(hull.planes().nearest(middle(mesh, edges[i])).depth, 0.0));
  std::vector<std::size_t> kept(edges.size());
  std::iota(kept.begin(), kept.end(), std::size_t{0});
  if (kept.size() > kContenders) {
    std::stable_sort(kept.begin(), kept.end(), [&](std::size_t i, std::size_t j) { return weight[i] > weight[j]; });
    kept.resize(kContenders);
  }
  std::vector<Contender> contenders;
  for (const std::size_t i : kept)
    contenders.push_back({edges[i], weight[i], middle(mesh, edges[i]), planes_of(mesh, edges[i])});
  return spread_out(contenders, PlaneSpace(box), count);
}

}  // namespace

std::vector<Plane> concave_planes(const Mesh& mesh, const ConvexBody& hull, std::size_t count) {
  const PlaneSpace space(hull.box());
  std::vector<Plane> planes;
  for (const ReflexEdge& edge : chosen_edges(mesh, hull, count)) {
    EdgePlanes own = planes_of(mesh, edge);
    for (const int side : {0, 1})
      own[side + 1].offset = above_face(mesh, mesh.faces[edge.face[side]], own[side + 1].normal);
    for (const Plane& plane : own) {
      const Plane candidate = turned(plane);
      if (std::all_of(planes.begin(), planes.end(),
                      [&](const Plane& other) { return space.difference(candidate, other) > kSamePlane; }))
        planes.push_back(candidate);
    }
  }
  return planes;
}

std::vector<Plane> equidistant_planes(const Mesh& mesh, const ConvexBody& hull, int per_axis) {
  constexpr double kSameAxis = 1e-3;  // sine of an angle
  std::vector<Vec3> directions = {{1, 0, 0}, {0, 1, 0}, {0, 0, 1}};
  for (const Vec3 axis : principal_axes(mesh)) {
    const int nearest = longest_axis(axis);
    Vec3 rest = axis;
    rest[nearest] = 0;
    directions.push_back(norm(rest) < kSameAxis ? directions[static_cast<std::size_t>(nearest)] : axis);
  }
  std::vector<Plane> planes;
  for (const Vec3 direction : directions) {
    double low = kInfinity, high = -low;
    for (const Vec3 p : hull.mesh().vertices)
      low = std::min(low, dot(p, direction)), high = std::max(high, dot(p, direction));
    for (int i = 1; i <= per_axis; ++i)
      planes.push_back({direction, low + (high - low) * (static_cast<double>(i) / (per_axis + 1))});
  }
  return planes;
}

}  // namespace rlacd
