#include "solid/plane_cut.hpp"

#include <algorithm>
#include <cmath>
#include <unordered_map>
#include <utility>

#include "core/invariant.hpp"
#include "core/stop.hpp"

namespace rlacd {

namespace {

class Cutter {
 public:
  Cutter(const Mesh& mesh, Vec3 normal, double offset)
      : mesh_(mesh), normal_(normal), offset_(offset), axis_(longest_axis(normal)), points_(mesh.vertices) {
    for (const Vec3 p : points_) farthest_ = std::max(farthest_, max_abs(p));
    heights_.reserve(points_.size());
    sides_.reserve(points_.size());
    for (const Vec3 p : points_) {
      const double height = dot(normal, p) - offset;
      heights_.push_back(height);
      sides_.push_back(std::fabs(height) <= kRounding * farthest_ ? 0 : height < 0 ? -1 : 1);
    }
  }

  OpenSide side(int which) {
    std::vector<Triangle> faces;
    std::vector<Edge> in_plane;
    for (const Triangle& f : mesh_.faces) {
      poll_stop();
      const int s[3] = {which * sides_[f[0]], which * sides_[f[1]], which * sides_[f[2]]};
      if (std::max({s[0], s[1], s[2]}) <= 0 && (std::min({s[0], s[1], s[2]}) < 0 || !bounds(f, which))) continue;
      std::int32_t polygon[4];
      int count = 0;
      for (int e = 0; e < 3; ++e) {
        const std::int32_t a = f[e], b = f[(e + 1) % 3];
        if (s[e] >= 0) polygon[count++] = a;
        if (s[e] * s[(e + 1) % 3] < 0) polygon[count++] = crossing(a, b);
      }
      RLACD_ASSERT(count == 3 || count == 4);
      for (int k = 0; k < count; ++k)
        if (const std::int32_t a = polygon[k], b = polygon[(k + 1) % count]; is_on_plane(a) && is_on_plane(b))
          in_plane.push_back({a, b});
      if (count == 3) {
        faces.push_back({polygon[0], polygon[1], polygon[2]});
      } else {  // a quadrilateral: across its shorter diagonal
        const int k =
            norm2(points_[polygon[2]] - points_[polygon[0]]) <= norm2(points_[polygon[3]] - points_[polygon[1]]) ? 0
                                                                                                                 : 1;
        faces.push_back({polygon[k], polygon[k + 1], polygon[k + 2]});
        faces.push_back({polygon[k], polygon[k + 2], polygon[(k + 3) % 4]});
      }
    }
    // Loops against the boundary's edges. Without loops the surface was not closed: its side stays open, with all its
    // points.
    std::vector<Edge> boundary = net(std::move(in_plane));
    for (Edge& e : boundary) std::swap(e[0], e[1]);
    Loops loops = loops_of(std::move(boundary)).value_or(Loops());
    straighten(faces, loops);
    return compacted(faces, loops);
  }

 private:
  bool is_on_plane(std::int32_t point) const {
    return static_cast<std::size_t>(point) >= sides_.size() || sides_[point] == 0;
  }

  Vec3 normal_of(const Triangle& f) const { return long_normal({points_[f[0]], points_[f[1]], points_[f[2]]}); }

  // Whether a triangle in the plane bounds the side from outside.
  bool bounds(const Triangle& f, int which) const {
    const double up = dot(normal_, normal_of(f));
    return which < 0 ? up > 0 : up <= 0;
  }

  // The point where an edge crosses the plane: exactly on it where possible.
  std::int32_t crossing(std::int32_t a, std::int32_t b) {
    if (a > b) std::swap(a, b);
    const auto [known, is_new] = crossings_.try_emplace(directed(a, b), static_cast<std::int32_t>(points_.size()));
    if (is_new) {
      const double t = heights_[a] / (heights_[a] - heights_[b]);
      RLACD_ASSERT(sides_[a] * sides_[b] < 0 && t > 0 && t < 1);
      Vec3 p = points_[a] + t * (points_[b] - points_[a]);
      if (std::fabs(normal_[axis_]) == 1) p[axis_] = offset_ * normal_[axis_];
      points_.push_back(p);
    }
    return known->second;
  }

  // Removes corners of the rims that lie on a straight line in a flat part of the surface, where its triangles met.
  // They would otherwise accumulate from cut to cut.
  void straighten(std::vector<Triangle>& faces, Loops& loops) const {
    std::vector<std::int32_t> times(points_.size(), 0);  // number of times a point is on a rim
    for (const std::vector<std::int32_t>& loop : loops)
      for (const std::int32_t v : loop) ++times[v];
    std::unordered_map<std::int32_t, std::vector<std::size_t>> around;  // faces at points on a rim
    for (std::size_t f = 0; f < faces.size(); ++f)
      for (const std::int32_t corner : faces[f])
        if (times[corner] > 0) around[corner].push_back(f);
    std::vector<char> is_gone(faces.size(), 0);
    for (std::vector<std::int32_t>& loop : loops) {
      RLACD_ASSERT(loop.size() >= 3);
      std::vector<std::int32_t> kept;
      for (std::size_t i = 0; i < loop.size(); ++i) {
        const std::int32_t v = loop[i], before = kept.empty() ? loop.back() : kept.back();
        const std::int32_t after = i + 1 < loop.size() ? loop[i + 1] : kept.front();
        const std::size_t left = kept.size() + loop.size() - i;
        if (left > 3 && times[v] == 1 && is_between(before, v, after) &&
            (moves_to(v, before, faces, around, is_gone) || moves_to(v, after, faces, around, is_gone)))
          continue;
        kept.push_back(v);
      }
      RLACD_ASSERT(kept.size() >= 3);
      loop = std::move(kept);
    }
    std::size_t kept = 0;
    for (std::size_t f = 0; f < faces.size(); ++f)
      if (!is_gone[f]) faces[kept++] = faces[f];
    faces.resize(kept);
  }

  bool is_between(std::int32_t before, std::int32_t v, std::int32_t after) const {
    const Vec3 a = points_[v] - points_[before], b = points_[after] - points_[v], c = points_[after] - points_[before];
    return dot(a, b) > 0 && norm(cross(a, b)) <= kRounding * farthest_ * norm(c);
  }

  // Moves a point onto its neighbour on the rim, if the faces around it lie in a plane and none flips.
  bool moves_to(std::int32_t v, std::int32_t to, std::vector<Triangle>& faces,
                std::unordered_map<std::int32_t, std::vector<std::size_t>>& around, std::vector<char>& is_gone) const {
    std::vector<std::size_t>& own = around[v];
    Vec3 normal;
    for (const std::size_t f : own)
      if (!is_gone[f])
        if (const Vec3 n = normal_of(faces[f]); norm2(n) > norm2(normal)) normal = n;
    normal = normalized(normal);
    int shared = 0;
    for (const std::size_t f : own) {
      if (is_gone[f]) continue;
      RLACD_ASSERT(std::find(faces[f].begin(), faces[f].end(), v) != faces[f].end());
      for (const std::int32_t corner : faces[f])
        if (std::fabs(dot(normal, points_[corner] - points_[v])) > kRounding * farthest_) return false;
      Triangle moved = faces[f];
      bool has_both = false;
      for (std::int32_t& corner : moved) {
        has_both = has_both || corner == to;
        if (corner == v) corner = to;
      }
      if (has_both)
        ++shared;
      else if (!(dot(normal, normal_of(moved)) > 0))
        return false;
    }
    if (shared != 1) return false;
    for (const std::size_t f : own) {
      if (is_gone[f]) continue;
      if (std::find(faces[f].begin(), faces[f].end(), to) != faces[f].end()) {
        is_gone[f] = 1;
        continue;
      }
      std::replace(faces[f].begin(), faces[f].end(), v, to);
      around[to].push_back(f);
    }
    return true;
  }

  OpenSide compacted(const std::vector<Triangle>& faces, const Loops& rims) const {
    OpenSide out;
    Renumbered numbered(points_, out.mesh.vertices);
    out.mesh.faces.reserve(faces.size());
    for (const Triangle& f : faces) out.mesh.faces.push_back(numbered(f));
    for (const std::vector<std::int32_t>& rim : rims) {
      out.rims.emplace_back();
      for (const std::int32_t point : rim) out.rims.back().push_back(numbered(point));
    }
    return out;
  }

  const Mesh& mesh_;
  const Vec3 normal_;
  const double offset_;
  const int axis_;
  double farthest_ = 0;       // coordinate
  std::vector<Vec3> points_;  // the vertices and, after them, crossings
  std::vector<double> heights_;
  std::vector<signed char> sides_;  // of the vertices: -1 below, 0 on the plane, 1 above
  std::unordered_map<std::uint64_t, std::int32_t> crossings_;
};

}  // namespace

std::vector<Edge> net(std::vector<Edge> edges) {
  const auto key = [](const Edge& e) { return std::array{std::min(e[0], e[1]), std::max(e[0], e[1]), e[0]}; };
  std::sort(edges.begin(), edges.end(), [&](const Edge& a, const Edge& b) { return key(a) < key(b); });
  std::vector<Edge> left;
  for (const Edge& e : edges)
    if (!left.empty() && left.back() == Edge{e[1], e[0]})
      left.pop_back();
    else
      left.push_back(e);
  return left;
}

std::optional<Loops> loops_of(std::vector<Edge> edges) {
  std::sort(edges.begin(), edges.end());
  std::vector<char> is_used(edges.size(), 0);
  Loops loops;
  for (std::size_t first = 0; first < edges.size(); ++first) {
    std::vector<std::int32_t> loop;
    for (std::size_t edge = first; !is_used[edge];) {
      is_used[edge] = 1;
      loop.push_back(edges[edge][0]);
      const std::int32_t at = edges[edge][1];
      if (at == edges[first][0]) break;
      std::size_t next = edge;
      for (auto e = std::lower_bound(edges.begin(), edges.end(), Edge{at, -1});
           next == edge && e != edges.end() && (*e)[0] == at; ++e)
        if (const auto i = static_cast<std::size_t>(e - edges.begin()); !is_used[i]) next = i;
      if (next == edge) return std::nullopt;
      edge = next;
    }
    if (loop.size() > 2) loops.push_back(std::move(loop));
  }
  return loops;
}

int winding_left_of(const std::vector<PlanePoint>& at, std::size_t own) {
  const PlanePoint a = at[2 * own], b = at[2 * own + 1];
  const int v = std::fabs(b[1] - a[1]) >= std::fabs(b[0] - a[0]) ? 1 : 0, u = 1 - v;
  const int sign = v == 1 ? 1 : -1;  // swapping the axes mirrors the plane
  const double x = (a[u] + b[u]) / 2, y = (a[v] + b[v]) / 2;
  int winding = sign * (b[v] - a[v]) > 0 ? 1 : 0;
  for (std::size_t i = 0; 2 * i < at.size(); ++i) {
    const PlanePoint p = at[2 * i], q = at[2 * i + 1];
    if (i < own && p == a && q == b) ++winding;  // the same edge again: one after the other, from the right
    if (i == own || (p[v] > y) == (q[v] > y)) continue;
    if (p[u] + (y - p[v]) / (q[v] - p[v]) * (q[u] - p[u]) > x) winding += sign * (q[v] > p[v] ? 1 : -1);
  }
  return winding;
}

std::vector<PlanePoint> on_plane(const std::vector<Vec3>& points, Vec3 normal) {
  const int axis = longest_axis(normal);
  int u = (axis + 1) % 3, v = (axis + 2) % 3;
  if (normal[axis] < 0) std::swap(u, v);
  std::vector<PlanePoint> flat;
  flat.reserve(points.size());
  for (const Vec3 p : points) flat.push_back({p[u], p[v]});
  return flat;
}

std::array<OpenSide, 2> cut_by_plane(const Mesh& mesh, Vec3 normal, double offset) {
  Cutter cutter(mesh, normal, offset);
  OpenSide below = cutter.side(-1);
  return {std::move(below), cutter.side(1)};
}

}  // namespace rlacd
