#include "solid/caps.hpp"

#include <algorithm>
#include <cmath>
#include <map>
#include <optional>
#include <unordered_map>
#include <unordered_set>

#include "core/invariant.hpp"
#include "core/random.hpp"
#include "core/stop.hpp"
#include "solid/triangulate.hpp"

namespace rlacd {

namespace {

using Outlines = std::vector<std::vector<PlanePoint>>;

Outlines outlines_of(const std::vector<Vec3>& vertices, const Loops& rims, Vec3 outward) {
  Outlines outlines;
  for (const std::vector<std::int32_t>& rim : rims) {
    std::vector<Vec3> points;
    points.reserve(rim.size());
    for (const std::int32_t i : rim) points.push_back(vertices[i]);
    outlines.push_back(on_plane(points, outward));
  }
  return outlines;
}

// What there is at the corners of all loops: their vertices, or points of the plane.
template <class Item>
std::vector<Item> joined(const std::vector<std::vector<Item>>& loops) {
  std::vector<Item> all;
  for (const std::vector<Item>& loop : loops) all.insert(all.end(), loop.begin(), loop.end());
  return all;
}

CapArea append(std::vector<Triangle>& faces, const Loops& rims, const Outlines& outlines, int times) {
  const std::vector<std::int32_t> vertex = joined(rims);
  const std::vector<PlanePoint> point = joined(outlines);
  CapArea area;
  for (const Triangle& t : triangulate(outlines, vertex)) {
    const double doubled = doubled_area(point[t[0]], point[t[1]], point[t[2]]);
    area.all += std::fabs(doubled);
    if (doubled < 0) area.folded -= doubled;
    for (int i = 0; i < std::abs(times); ++i)
      faces.push_back(times > 0 ? Triangle{vertex[t[0]], vertex[t[1]], vertex[t[2]]}
                                : Triangle{vertex[t[0]], vertex[t[2]], vertex[t[1]]});
  }
  return area;
}

// Rims of a cut that cross each other, taken apart into loops that do not.
//
// Where a solid overlaps itself, the rims of a plane cut cross, and no triangulation of them as they are closes the cut
// without leading out of the solid.
//
// Input:  one side of a cut (see plane_cut.hpp) and its rims as points of the plane.
// Output: the same side with a vertex at every crossing, closed. To the left of loops that cross nowhere are the
//         regions around which the rims run w times: each is closed w times, or -w times upside down where the solid
//         is inside out (w < 0).
// Algorithm: at a crossing, each rim continues along the other (Seifert's smoothing), which leaves simple loops. A ray
// from each gives the winding number beside it. Rims are moved by noise far below any tolerance first, so that they
// cross at single points or not at all; rims that share vertices do not cross there (see plane_cut.hpp).

constexpr double kNoise = 1e-10;  // of the greatest coordinate
// For each corner: more come from surfaces that lie on each other in many layers, and would multiply from cut to cut.
constexpr std::size_t kMostCrossings = 4;

// The edges of the rims, edge i from corner i of the rims to the next, and what becomes of them.
//
// Nodes are the corners and after them each crossing twice: node n + 2k is crossing k on the first of its edges, node
// n + 2k + 1 on the second.
class Tangle {
 public:
  Tangle(OpenSide side, const Outlines& outlines) : mesh_(std::move(side.mesh)) {
    for (std::size_t r = 0; r < side.rims.size(); ++r) {
      const std::size_t first = vertex_.size(), size = side.rims[r].size();
      for (std::size_t k = 0; k < size; ++k) {
        vertex_.push_back(side.rims[r][k]);
        point_.push_back(outlines[r][k]);
        next_.push_back(first + (k + 1) % size);
      }
    }
    corners_ = point_.size();
    double greatest = 0;
    for (const PlanePoint p : point_) greatest = std::max({greatest, std::fabs(p[0]), std::fabs(p[1])});
    for (std::size_t i = 0; i < corners_; ++i)
      for (const int c : {0, 1}) point_[i][c] += kNoise * greatest * (2 * uniform(0, 2 * vertex_[i] + c) - 1);
  }

  // Nothing if there are too many crossings. Outlines are those of the side's rims, by `on_plane`.
  std::optional<Mesh> closed() {
    if (!find_crossings()) return std::nullopt;
    insert_crossings();
    split_faces();
    std::vector<PlanePoint> ends;
    for (std::size_t node = 0; node < point_.size(); ++node)
      ends.insert(ends.end(), {point_[node], point_[follower_[node]]});
    for (std::vector<std::size_t>& loop : loops()) {
      const int left = left_of(loop, ends);
      add(loop, left);
      std::reverse(loop.begin(), loop.end());
      add(loop, left - 1);
    }
    for (const auto& [winding, region] : regions_)
      if (winding != 0) append(mesh_.faces, region.rims, region.outlines, winding);
    return std::move(mesh_);
  }

 private:
  struct Region {
    Loops rims;  // of vertices
    Outlines outlines;
  };

  void add(const std::vector<std::size_t>& loop, int winding) {
    std::vector<std::int32_t>& rim = regions_[winding].rims.emplace_back();
    std::vector<PlanePoint>& outline = regions_[winding].outlines.emplace_back();
    for (const std::size_t node : loop) {
      rim.push_back(vertex_[node]);
      outline.push_back(point_[node]);
    }
  }

  struct Stop {
    double along;  // the edge, from 0 to 1
    std::size_t node;
  };

  // Returns whether there are few enough.
  bool find_crossings() {
    // Edges that run both ways, which straightened rims may have, bound nothing and have no faces to share a vertex.
    std::unordered_set<std::uint64_t> run;
    for (std::size_t i = 0; i < corners_; ++i) run.insert(directed(vertex_[i], vertex_[next_[i]]));
    std::vector<std::size_t> by_left, active;
    for (std::size_t i = 0; i < corners_; ++i)
      if (run.count(directed(vertex_[next_[i]], vertex_[i])) == 0) by_left.push_back(i);
    const auto left = [&](std::size_t i) { return std::min(point_[i][0], point_[next_[i]][0]); };
    const auto right = [&](std::size_t i) { return std::max(point_[i][0], point_[next_[i]][0]); };
    std::sort(by_left.begin(), by_left.end(),
              [&](std::size_t a, std::size_t b) { return std::make_pair(left(a), a) < std::make_pair(left(b), b); });
    for (const std::size_t i : by_left) {
      poll_stop();
      const double from = left(i);
      active.erase(std::remove_if(active.begin(), active.end(), [&](std::size_t j) { return right(j) < from; }),
                   active.end());
      for (const std::size_t j : active) cross(i, j);
      active.push_back(i);
      if (crossings_.size() > kMostCrossings * corners_) return false;
    }
    return true;
  }

  void cross(std::size_t i, std::size_t j) {
    for (const std::size_t end : {i, next_[i]})
      if (vertex_[end] == vertex_[j] || vertex_[end] == vertex_[next_[j]]) return;
    const PlanePoint a = point_[i], b = point_[next_[i]], c = point_[j], d = point_[next_[j]];
    if (std::max(a[1], b[1]) < std::min(c[1], d[1]) || std::max(c[1], d[1]) < std::min(a[1], b[1])) return;
    std::array<double, 2> along;
    if (do_cross(a, b, c, d, along)) crossings_.push_back({{i, j}, along});
  }

  // Gives every crossing a vertex and its two nodes, and lets each rim continue along the other.
  void insert_crossings() {
    for (std::size_t k = 0; k < crossings_.size(); ++k) {
      const auto [edges, along] = crossings_[k];
      const std::size_t i = edges[0];
      const PlanePoint a = point_[i], b = point_[next_[i]];
      const PlanePoint at = {a[0] + along[0] * (b[0] - a[0]), a[1] + along[0] * (b[1] - a[1])};
      const Vec3 from = mesh_.vertices[vertex_[i]], to = mesh_.vertices[vertex_[next_[i]]];
      const auto vertex = static_cast<std::int32_t>(mesh_.vertices.size());
      mesh_.vertices.push_back(from + along[0] * (to - from));
      for (const std::size_t which : {0, 1}) {
        stops_[edges[which]].push_back({along[which], point_.size()});
        vertex_.push_back(vertex);
        point_.push_back(at);
      }
    }
    follower_ = next_;
    follower_.resize(point_.size());
    for (auto& [edge, stops] : stops_) {
      std::sort(stops.begin(), stops.end(), [](const Stop& a, const Stop& b) {
        return std::make_pair(a.along, a.node) < std::make_pair(b.along, b.node);
      });
      std::size_t last = edge;
      for (const Stop& stop : stops) last = follower_[last] = stop.node;
      follower_[last] = next_[edge];
    }
    for (std::size_t node = corners_; node < point_.size(); node += 2) std::swap(follower_[node], follower_[node + 1]);
  }

  // Divides the faces beside edges with crossings, so that they share the new vertices.
  void split_faces() {
    std::unordered_map<std::uint64_t, std::vector<std::size_t>> faces_of;  // by their edge, against the rim's direction
    for (const auto& [edge, stops] : stops_) faces_of[directed(vertex_[next_[edge]], vertex_[edge])];
    const auto turned = [](const Triangle& f, int first) {
      return Triangle{f[first], f[(first + 1) % 3], f[(first + 2) % 3]};
    };
    for (std::size_t f = 0; f < mesh_.faces.size(); ++f)
      for (int first = 0; first < 3; ++first) {
        const Triangle face = turned(mesh_.faces[f], first);
        if (const auto found = faces_of.find(directed(face[0], face[1])); found != faces_of.end())
          found->second.push_back(f);
      }
    for (const auto& [edge, stops] : stops_) {
      const std::int32_t from = vertex_[next_[edge]], to = vertex_[edge];
      std::vector<std::size_t>& own = faces_of[directed(from, to)];
      RLACD_ASSERT(!own.empty());
      if (own.empty()) continue;
      const std::size_t f = own.back();
      own.pop_back();
      int first = 0;
      while (mesh_.faces[f][first] != from || mesh_.faces[f][(first + 1) % 3] != to) ++first;
      const std::int32_t apex = turned(mesh_.faces[f], first)[2];
      std::int32_t last = from;
      std::size_t place = f;  // the first of the new faces takes the old one's place, the others follow all
      for (auto stop = stops.rbegin(); stop != stops.rend(); ++stop) {
        const Triangle face = {last, vertex_[stop->node], apex};
        if (place == f)
          mesh_.faces[f] = face;
        else
          mesh_.faces.push_back(face);
        place = mesh_.faces.size();
        last = vertex_[stop->node];
      }
      mesh_.faces.push_back({last, to, apex});
      if (const auto found = faces_of.find(directed(to, apex)); found != faces_of.end())
        std::replace(found->second.begin(), found->second.end(), f, mesh_.faces.size() - 1);
    }
  }

  std::vector<std::vector<std::size_t>> loops() const {
    std::vector<std::vector<std::size_t>> found;
    std::vector<char> is_seen(point_.size(), 0);
    for (std::size_t start = 0; start < point_.size(); ++start) {
      if (is_seen[start]) continue;
      found.emplace_back();
      for (std::size_t node = start; !is_seen[node]; node = follower_[node]) {
        is_seen[node] = 1;
        found.back().push_back(node);
      }
    }
    return found;
  }

  // How often the rims run around the points to the left of a loop.
  int left_of(const std::vector<std::size_t>& loop, const std::vector<PlanePoint>& ends) const {
    poll_stop();
    const auto rise = [&](std::size_t node) { return std::fabs(ends[2 * node + 1][1] - ends[2 * node][1]); };
    const auto flatter = [&](std::size_t a, std::size_t b) { return rise(a) < rise(b); };
    return winding_left_of(ends, *std::max_element(loop.begin(), loop.end(), flatter));
  }

  struct Crossing {
    std::array<std::size_t, 2> edges;
    std::array<double, 2> along;
  };

  Mesh mesh_;
  std::map<int, Region> regions_;  // by how often the rims run around them
  std::size_t corners_ = 0;
  std::vector<std::int32_t> vertex_;  // of a node
  std::vector<PlanePoint> point_;     // of a node
  std::vector<std::size_t> next_;     // the end of an edge
  std::vector<Crossing> crossings_;
  std::map<std::size_t, std::vector<Stop>> stops_;  // the crossings on an edge, in its direction
  std::vector<std::size_t> follower_;               // of a node, along the loops
};

}  // namespace

CapArea add_caps(std::vector<Triangle>& faces, const std::vector<Vec3>& vertices, const Loops& rims, Vec3 outward,
                 int times) {
  return append(faces, rims, outlines_of(vertices, rims, outward), times);
}

Mesh capped(OpenSide side, Vec3 outward) {
  if (side.rims.empty()) return std::move(side.mesh);
  const Outlines outlines = outlines_of(side.mesh.vertices, side.rims, outward);
  const std::size_t open = side.mesh.faces.size();
  const CapArea area = append(side.mesh.faces, side.rims, outlines, 1);
  if (area.folded <= kFolded * area.all) return std::move(side.mesh);
  OpenSide again{side.mesh, side.rims};
  again.mesh.faces.resize(open);
  return Tangle(std::move(again), outlines).closed().value_or(std::move(side.mesh));
}

}  // namespace rlacd
