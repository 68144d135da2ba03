#include "convex/simplify_hull.hpp"

#include <array>
#include <stdexcept>
#include <utility>

#include "convex/convex_collapse.hpp"
#include "convex/even_out.hpp"
#include "convex/hull.hpp"
#include "core/mesh_measures.hpp"
#include "core/stop.hpp"
#include "surface/edges.hpp"

namespace rlacd {
namespace {

// With more corners than this, edge collapse beat a plain cover on every hull tested.
constexpr std::size_t kFewCorners = 10;

// Collapses leave room between the hulls, and their cost only shows once that room is used up: on the last stretch,
// from this multiple of the target number of corners, collapses and relaxation alternate.
constexpr double kLastStretch = 1.5, kStep = 1.1;
constexpr int kSweepsOnTheWay = 3, kSweepsAtTheEnd = 30;

// The affine map to a frame where the hull is about 2 wide in three perpendicular directions and around the origin. The
// directions come from extreme points (the longest line, the point farthest from it), not from second moments, whose
// cancellation would lose a plate's thickness below 1e-8 of its width.
class Whitening {
 public:
  explicit Whitening(const std::vector<Vec3>& points) {
    centre_ = middle_of(points);
    const auto farthest = [&](const auto& distance) {
      return *std::max_element(points.begin(), points.end(), [&](Vec3 p, Vec3 q) { return distance(p) < distance(q); });
    };
    const Vec3 a = farthest([&](Vec3 p) { return norm2(p - centre_); });
    const Vec3 b = farthest([&](Vec3 p) { return norm2(p - a); });
    axes_[0] = normalized(b - a);
    const Vec3 c = farthest([&](Vec3 p) { return norm2(cross(axes_[0], p - a)); });
    axes_[2] = normalized(cross(axes_[0], c - a));
    axes_[1] = cross(axes_[2], axes_[0]);
    for (int i = 0; i < 3; ++i) {
      for (const Vec3 p : points) scale_[i] = std::max(scale_[i], std::fabs(dot(axes_[i], p - centre_)));
      if (!(norm2(axes_[i]) > 0.5 && scale_[i] > 0) || !std::isfinite(1 / scale_[i]))
        throw std::invalid_argument("the hull is flat");
    }
  }
  Vec3 to(Vec3 p) const {
    const Vec3 d = p - centre_;
    return {dot(axes_[0], d) / scale_[0], dot(axes_[1], d) / scale_[1], dot(axes_[2], d) / scale_[2]};
  }
  Above to(const Above& plane) const {
    Vec3 normal;
    for (int i = 0; i < 3; ++i) normal[i] = scale_[i] * dot(axes_[i], plane.normal);
    const double length = norm(normal);
    return {1 / length * normal, (plane.offset - dot(plane.normal, centre_)) / length};
  }
  Vec3 from(Vec3 p) const {
    return centre_ + scale_[0] * p.x * axes_[0] + scale_[1] * p.y * axes_[1] + scale_[2] * p.z * axes_[2];
  }
  // The points, moved to both sides along every axis in which they are thinner than `share` of their length, so that
  // they reach it; empty if there is no such axis.
  std::vector<Vec3> thickened(const std::vector<Vec3>& points, double share) const {
    const double enough = share * std::max({scale_[0], scale_[1], scale_[2]}), by = 2 * enough;
    std::vector<Vec3> moved = points;
    bool thin = false;
    for (int i = 0; i < 3; ++i) {
      if (scale_[i] >= enough) continue;
      thin = true;
      std::vector<Vec3> both;
      for (const Vec3 p : moved) both.push_back(p - by * axes_[i]), both.push_back(p + by * axes_[i]);
      moved = std::move(both);
    }
    return thin ? moved : std::vector<Vec3>();
  }

 private:
  Vec3 centre_;
  Vec3 axes_[3];
  double scale_[3] = {0, 0, 0};
};

// The corners of the intersection of half-spaces n . x <= h that all contain the origin: facets of the hull of n / h.
std::vector<Vec3> corners_of_intersection(const std::vector<Above>& planes) {
  std::vector<Vec3> dual;
  for (const Above& plane : planes) dual.push_back(1 / plane.offset * plane.normal);
  const Mesh polar = hull_mesh(dual);
  std::vector<Vec3> corners;
  for (const Triangle& face : polar.faces) {
    const Vec3 normal = long_normal(polar, face);
    corners.push_back(1 / dot(normal, polar.vertices[face[0]]) * normal);
  }
  return corners;
}

// The normals of three large facets in different directions, divided by the hull's width along them: in these
// coordinates a parallelepiped is the unit cube.
std::array<Vec3, 3> main_directions(const Mesh& hull) {
  std::array<Vec3, 3> best;
  for (int i = 0; i < 3; ++i) {
    double most = 0;
    for (const Triangle& face : hull.faces) {
      const Vec3 normal = long_normal(hull, face);
      const double size = i == 0   ? norm(normal)
                          : i == 1 ? norm(cross(best[0], normal))
                                   : std::fabs(dot(cross(best[0], best[1]), normal));
      if (size > most) most = size, best[i] = normalized(normal);
    }
  }
  for (Vec3& normal : best) {
    double low = 0, high = 0;
    for (const Vec3 p : hull.vertices) low = std::min(low, dot(normal, p)), high = std::max(high, dot(normal, p));
    normal = 1 / (high - low) * normal;
  }
  return best;
}

// Polytopes with at most `most` corners from supporting planes in a few directions: tetrahedra, prisms, a box.
std::vector<Mesh> plain_covers(const Mesh& hull, std::size_t most) {
  const auto cover = [&](const std::vector<Vec3>& normals) {
    std::vector<Above> planes;
    for (const Vec3 direction : normals) {
      const Vec3 normal = normalized(direction);
      double offset = 0;
      for (const Vec3 p : hull.vertices) offset = std::max(offset, dot(normal, p));
      planes.push_back({normal, offset});
    }
    return hull_mesh(corners_of_intersection(planes));
  };
  const std::array<Vec3, 3> axes = main_directions(hull);
  const auto [x, y, z] = axes;
  std::vector<Mesh> covers = {cover({x + y + z, x - y - z, y - x - z, z - x - y})};
  for (int octant = 0; octant < 8 && most < 6; ++octant) {
    const Vec3 u = (octant & 1 ? -1.0 : 1.0) * x, v = (octant & 2 ? -1.0 : 1.0) * y, w = (octant & 4 ? -1.0 : 1.0) * z;
    covers.push_back(cover({u, v, w, -u - v - w}));
  }
  for (int axis = 0; axis < 3 && most >= 6; ++axis) {
    const Vec3 along = axes[axis], u = axes[(axis + 1) % 3], v = axes[(axis + 2) % 3];
    covers.push_back(cover({along, -along, u, std::sqrt(0.75) * v - 0.5 * u, -std::sqrt(0.75) * v - 0.5 * u}));
  }
  if (most >= 8) covers.push_back(cover({x, -x, y, -y, z, -z}));
  return covers;
}

// The least scaling about the origin, at least 1, with which `outer` contains every corner of `inner`.
double missing_scale(const Mesh& outer, const Mesh& inner) {
  const auto reach = [](const Mesh& mesh, Vec3 normal) {
    double farthest = 0;
    for (const Vec3 p : mesh.vertices) farthest = std::max(farthest, dot(normal, p));
    return farthest;
  };
  double scale = 1;
  for (const Triangle& face : outer.faces) {
    poll_stop();
    const Vec3 normal = normalized(long_normal(outer, face));
    const double own = reach(outer, normal);
    if (own > 0) scale = std::max(scale, reach(inner, normal) / own);
  }
  return scale;
}

// Maps back from the whitened frame, scaled up by the little that tolerances and rounding may have removed.
Mesh brought_back(Mesh outer, const Mesh& inner, const Whitening& whitening) {
  const double scale = missing_scale(outer, inner);
  for (Vec3& p : outer.vertices) p = whitening.from(scale * p);
  return hull_mesh(outer.vertices);
}

constexpr double kEnoughProgress = 2e-4;  // relative change of the volume in one sweep
constexpr double kFarthestMove = 100;

struct RingEdge {
  std::int32_t from, to, beyond;  // beyond: the corner across the edge
};

// The edges opposite to each corner in its facets, with what lies across them.
std::vector<std::vector<RingEdge>> rings(const Mesh& mesh) {
  const std::vector<std::uint32_t> mate = mates_of(mesh.faces, mesh.vertices.size());
  std::vector<std::vector<RingEdge>> around(mesh.vertices.size());
  for (std::size_t f = 0; f < mesh.faces.size(); ++f)
    for (std::size_t i = 0; i < 3; ++i) {
      const Triangle& face = mesh.faces[f];
      const std::uint32_t across = mate[3 * f + (i + 1) % 3];
      around[face[i]].push_back({face[(i + 1) % 3], face[(i + 2) % 3], mesh.faces[across / 3][(across + 2) % 3]});
    }
  return around;
}

// The plane through the edge a -> b, rotated down from the facet (a, b, w) until it touches the inner hull. In the
// frame (across the facet, along its normal) every inner point lies below; the plane first meets the one with the
// smallest angle below it.
Above touching_plane(Vec3 a, Vec3 b, Vec3 w, const Mesh& inner) {
  const Vec3 normal = normalized(cross(b - a, w - a)), across = normalized(cross(normal, b - a));
  double x = -1, y = 0;  // half a turn: no restriction
  for (const Vec3 p : inner.vertices) {
    const double px = dot(across, p - a), py = std::max(0.0, -dot(normal, p - a));
    if (px * y - py * x > 0 || (py == 0 && px > 0)) x = px, y = py;
  }
  const double length = std::sqrt(x * x + y * y);
  const Vec3 turned = (x / length) * normal + (y / length) * across;
  return {turned, dot(turned, a)};
}

// An outer hull around an inner one, tightened without adding corners; what was above the bounds stays there.
//
// One corner w at a time moves to where the volume is least while its neighbours stay. The facets around w turn
// about the edges of its ring, so the inner hull stays inside as long as w lies beyond the plane through each ring
// edge that touches the inner hull; the outer hull stays convex as long as w lies below the facets across the
// ring. Volume is linear in w: a linear program in three variables, with the present w feasible. After each sweep
// over all corners the hull is taken anew, which lets edges flip.
Mesh relax_around(Mesh outer, const Mesh& inner, const std::vector<Above>& bounds, int sweeps) {
  double volume = mesh_volume(outer);
  std::vector<Above> constraints;
  for (int sweep = 0; sweep < sweeps; ++sweep) {
    const std::vector<std::vector<RingEdge>> around = rings(outer);
    std::vector<Vec3>& v = outer.vertices;
    for (std::size_t w = 0; w < v.size(); ++w) {
      poll_stop();
      constraints = bounds;
      Vec3 objective;
      bool sound = true;
      for (const RingEdge& edge : around[w]) {
        const Vec3 a = v[edge.from], b = v[edge.to];
        objective = objective + cross(a - v[w], b - v[w]);
        const Vec3 beyond = normalized(cross(a - b, v[edge.beyond] - b));
        constraints.push_back(touching_plane(a, b, v[w], inner));
        constraints.push_back({-beyond, -std::max(dot(beyond, a), dot(beyond, v[w]))});
        sound = sound && norm2(beyond) > 0.5 && norm2(constraints[constraints.size() - 2].normal) > 0.5;
      }
      if (!sound || !(norm2(objective) > 0)) continue;
      objective = normalized(objective);
      const std::optional<Vec3> lowest = lowest_point(objective, constraints, kFarthestMove);
      if (lowest && dot(objective, *lowest) < dot(objective, v[w]) - kRounding) v[w] = *lowest;
    }
    Mesh next = hull_mesh(v);
    const double reached = mesh_volume(next);
    outer = std::move(next);
    if (!(reached < (1 - kEnoughProgress) * volume)) break;
    volume = reached;
  }
  return outer;
}

std::vector<std::size_t> stages(std::size_t corners, std::size_t most) {
  std::vector<std::size_t> sizes;
  for (double size = kLastStretch * static_cast<double>(most); size > static_cast<double>(most); size /= kStep)
    if (static_cast<std::size_t>(size) < (sizes.empty() ? corners : sizes.back()))
      sizes.push_back(static_cast<std::size_t>(size));
  if (sizes.empty() || sizes.back() != most) sizes.push_back(most);
  return sizes;
}

}  // namespace

Mesh simplify_hull(const ConvexBody& body, std::size_t max_vertices, std::size_t max_faces, double tolerance,
                   const std::vector<Above>& bounds, double enough) {
  if (max_vertices < 4 || max_faces < 4) throw std::invalid_argument("a hull has at least 4 vertices and 4 faces");
  // A triangulated convex polytope has twice as many triangles as corners, minus four.
  const std::size_t most = std::min(max_vertices, (max_faces + 4) / 2);
  const Mesh& hull = body.mesh();
  const Whitening whitening(hull.vertices);
  // Hulls thinner than a hair, if they are 1 long, are first thickened to it: rounding is 1e-4 of a thickness of 1e-12,
  // and where two facets meet at the tip of a needle that much of its length would be left outside.
  if (const std::vector<Vec3> thick = whitening.thickened(hull.vertices, kHair); !thick.empty())
    return hull.vertices.size() <= most
               ? hull
               : simplify_hull(ConvexBody(hull_mesh(thick)), max_vertices, max_faces, tolerance, {}, enough);
  std::vector<Vec3> whitened;
  for (const Vec3 p : hull.vertices) whitened.push_back(whitening.to(p));
  const Mesh inner = hull_mesh(whitened);
  if (inner.faces.empty()) throw std::invalid_argument("the hull is flat");

  std::vector<Above> within;
  for (const Above& plane : bounds) within.push_back(whitening.to(plane));

  const auto redundant = [&](Vec3 point) {
    const Vec3 p = whitening.from(point);
    return body.planes().nearest(p).depth >= -tolerance && body.bvh().closest(p).distance2 <= tolerance * tolerance;
  };
  if (inner.vertices.size() <= most) {
    ConvexCollapse collapse(inner, within, [&](Vec3 p) { return whitening.from(p); }, tolerance);
    collapse.reduce(most, redundant);
    const std::vector<Vec3> left = collapse.corners();
    return left.size() == hull.vertices.size() ? hull : brought_back(hull_mesh(left), inner, whitening);
  }
  Mesh best = inner;
  bool fits = true;
  for (const std::size_t stage : stages(best.vertices.size(), most)) {
    ConvexCollapse collapse(best, within);
    fits = collapse.reduce(stage, redundant);
    best = relax_around(hull_mesh(collapse.corners()), inner, within, stage > most ? kSweepsOnTheWay : kSweepsAtTheEnd);
    if (!fits) break;
  }
  if (!fits && !within.empty()) return simplify_hull(body, max_vertices, max_faces, tolerance, {}, enough);
  if (!fits || (most <= kFewCorners && within.empty()))
    for (Mesh& cover : plain_covers(inner, most)) {
      cover = relax_around(std::move(cover), inner, {}, kSweepsAtTheEnd);
      if (!fits || mesh_volume(cover) < mesh_volume(best)) best = std::move(cover), fits = true;
    }
  Mesh outer = brought_back(best, inner, whitening);
  return within.empty() && std::isfinite(enough) ? evened_out(std::move(outer), body, enough) : outer;
}

}  // namespace rlacd
