#include "solid/reunite.hpp"

#include <algorithm>
#include <cmath>
#include <map>
#include <numeric>
#include <unordered_map>

#include "core/mesh_measures.hpp"
#include "core/stop.hpp"
#include "solid/caps.hpp"
#include "solid/plane_cut.hpp"
#include "solid/triangulate.hpp"

namespace rlacd {

namespace {

constexpr double kCoincident = 1e-8;  // distance at which faces touch, and vertices are one or on an edge
constexpr int kDeepest = 8;           // times that an edge between stops may have stops: two, but for rounding

bool lies_in(const Plane& plane, const Corners& t) {
  return std::all_of(t.begin(), t.end(), [&](Vec3 p) { return std::fabs(plane.depth(p)) <= kCoincident; });
}

struct Facet {
  Corners corner;
  Box box;
  Plane plane;
  double height;  // twice the area over the longest edge

  explicit Facet(const Corners& t) : corner(t), box(Box::of(t)) {
    const Vec3 normal = long_normal(t);
    const double longest = norm(t[(longest_side(t) + 1) % 3] - t[longest_side(t)]);
    plane = {normalized(normal), dot(normalized(normal), t[0])};
    height = longest > 0 ? norm(normal) / longest : 0;
  }
  bool may_touch(const Facet& other) const {
    return dot(plane.normal, other.plane.normal) < 0 && box.meets(other.box, kCoincident) &&
           lies_in(plane, other.corner);
  }
};

std::vector<Facet> facets_within(const Mesh& mesh, const Box& box) {
  std::vector<Facet> found;
  for (const Triangle& face : mesh.faces) {
    const Facet facet(corners_of(mesh, face));
    if (facet.height > kCoincident && facet.box.meets(box, kCoincident)) found.push_back(facet);
  }
  return found;
}

// Adds the planes in which faces of two solids may lie on each other, unless they are known.
void add_touching_planes(std::vector<Plane>& planes, const Mesh& a, const Mesh& b) {
  const std::vector<Facet> others = facets_within(b, box_of_faces(a));
  std::vector<Facet> own = facets_within(a, box_of_faces(b));
  // Large faces first: their planes are the most exact.
  std::stable_sort(own.begin(), own.end(), [](const Facet& f, const Facet& g) { return f.height > g.height; });
  for (const Facet& facet : own) {
    poll_stop();
    if (std::any_of(planes.begin(), planes.end(), [&](const Plane& plane) { return lies_in(plane, facet.corner); }))
      continue;
    if (std::any_of(others.begin(), others.end(), [&](const Facet& other) { return facet.may_touch(other); }))
      planes.push_back(facet.plane);
  }
}

class Reunion {
 public:
  explicit Reunion(const std::vector<Mesh>& solids) {
    for (std::size_t i = 0; i < solids.size(); ++i)
      for (std::size_t j = i + 1; j < solids.size(); ++j) add_touching_planes(planes_, solids[i], solids[j]);
    for (const Mesh& solid : solids) append(mesh_, solid);
  }

  std::optional<Mesh> united() {
    weld();
    take_out();
    for (std::vector<Edge>& rim : rims_) rim = net(std::move(rim));
    meet();
    for (std::size_t plane = 0; plane < planes_.size(); ++plane) cross(plane);
    for (std::size_t plane = 0; plane < planes_.size(); ++plane)
      if (!close(plane)) return std::nullopt;
    split_faces();
    std::vector<Edge> edges;
    for (const Triangle& f : mesh_.faces)
      for (int e = 0; e < 3; ++e) edges.push_back({f[e], f[(e + 1) % 3]});
    if (!net(std::move(edges)).empty()) return std::nullopt;
    drop_unused();
    return std::move(mesh_);
  }

 private:
  void drop_unused() {
    std::vector<Vec3> used;
    Renumbered numbered(mesh_.vertices, used);
    for (Triangle& f : mesh_.faces) f = numbered(f);
    mesh_.vertices = std::move(used);
  }

  // Makes vertices in one place one.
  void weld() {
    std::vector<std::int32_t> order(mesh_.vertices.size()), same(mesh_.vertices.size());
    std::iota(order.begin(), order.end(), 0);
    std::iota(same.begin(), same.end(), 0);
    const auto at = [&](std::int32_t v) { return mesh_.vertices[v]; };
    std::sort(order.begin(), order.end(),
              [&](std::int32_t a, std::int32_t b) { return std::pair{at(a).x, a} < std::pair{at(b).x, b}; });
    for (auto v = order.begin(); v != order.end(); ++v) {
      if (same[*v] != *v) continue;
      for (auto w = v + 1; w != order.end() && at(*w).x <= at(*v).x + kCoincident; ++w)
        if (same[*w] == *w && max_abs(at(*w) - at(*v)) <= kCoincident) same[*w] = *v;
    }
    std::size_t kept = 0;
    for (const Triangle& f : mesh_.faces) {
      const Triangle own = {same[f[0]], same[f[1]], same[f[2]]};
      if (own[0] != own[1] && own[1] != own[2] && own[2] != own[0]) mesh_.faces[kept++] = own;
    }
    mesh_.faces.resize(kept);
  }

  // Takes out the faces in the planes where solids touch, and keeps their edges.
  void take_out() {
    rims_.resize(planes_.size());
    std::size_t kept = 0;
    for (const Triangle& f : mesh_.faces) {
      const auto own = std::find_if(planes_.begin(), planes_.end(),
                                    [&](const Plane& plane) { return lies_in(plane, corners_of(mesh_, f)); });
      if (own == planes_.end()) {
        mesh_.faces[kept++] = f;
        continue;
      }
      for (int e = 0; e < 3; ++e)
        rims_[static_cast<std::size_t>(own - planes_.begin())].push_back({f[e], f[(e + 1) % 3]});
    }
    mesh_.faces.resize(kept);
  }

  // Notes the vertices of rims that lie on edges of rims.
  void meet() {
    for (const std::vector<Edge>& rim : rims_)
      for (const Edge& e : rim) met_.insert(met_.end(), e.begin(), e.end());
    std::sort(met_.begin(), met_.end());
    met_.erase(std::unique(met_.begin(), met_.end()), met_.end());
    std::vector<std::int32_t> by_x = met_;
    std::sort(by_x.begin(), by_x.end(),
              [&](std::int32_t a, std::int32_t b) { return mesh_.vertices[a].x < mesh_.vertices[b].x; });
    for (const std::vector<Edge>& rim : rims_)
      for (const Edge& e : rim) {
        poll_stop();
        const Vec3 a = mesh_.vertices[e[0]], along = mesh_.vertices[e[1]] - a;
        const double length2 = norm2(along), low = std::min(a.x, a.x + along.x), high = std::max(a.x, a.x + along.x);
        if (stops_.count(undirected(e[0], e[1])) > 0) continue;
        std::vector<std::pair<double, std::int32_t>> stops;
        for (auto v = std::lower_bound(by_x.begin(), by_x.end(), low - kCoincident,
                                       [&](std::int32_t i, double x) { return mesh_.vertices[i].x < x; });
             v != by_x.end() && mesh_.vertices[*v].x <= high + kCoincident; ++v) {
          const Vec3 to = mesh_.vertices[*v] - a;
          const double t = dot(to, along) / length2;
          if (*v != e[0] && *v != e[1] && t > 0 && t < 1 && norm2(to - t * along) <= kCoincident * kCoincident)
            stops.push_back({t, *v});
        }
        if (!stops.empty()) note(e, std::move(stops));
      }
  }

  // Notes new vertices where edges of the rims in a plane cross.
  void cross(std::size_t plane) {
    std::vector<Edge>& rim = rims_[plane];
    rim = expanded(rim);
    if (rim.empty()) return;
    const std::vector<PlanePoint> at = on_plane(points_of(rim), planes_[plane].normal);
    std::vector<std::size_t> by_left(rim.size());
    std::iota(by_left.begin(), by_left.end(), 0);
    const auto left = [&](std::size_t i) { return std::min(at[2 * i][0], at[2 * i + 1][0]); };
    std::sort(by_left.begin(), by_left.end(), [&](std::size_t i, std::size_t j) { return left(i) < left(j); });
    std::unordered_map<std::uint64_t, std::vector<std::pair<double, std::int32_t>>> found;
    for (auto i = by_left.begin(); i != by_left.end(); ++i)
      for (auto j = i + 1; j != by_left.end() && left(*j) <= std::max(at[2 * *i][0], at[2 * *i + 1][0]); ++j) {
        const Edge &e = rim[*i], &g = rim[*j];
        if (e[0] == g[0] || e[0] == g[1] || e[1] == g[0] || e[1] == g[1]) continue;
        std::array<double, 2> along;
        if (!do_cross(at[2 * *i], at[2 * *i + 1], at[2 * *j], at[2 * *j + 1], along)) continue;
        const auto vertex = static_cast<std::int32_t>(mesh_.vertices.size());
        const Vec3 from = mesh_.vertices[e[0]];
        mesh_.vertices.push_back(from + along[0] * (mesh_.vertices[e[1]] - from));
        met_.push_back(vertex);
        found[undirected(e[0], e[1])].push_back({e[0] < e[1] ? along[0] : 1 - along[0], vertex});
        found[undirected(g[0], g[1])].push_back({g[0] < g[1] ? along[1] : 1 - along[1], vertex});
      }
    for (auto& [key, stops] : found)
      note({static_cast<std::int32_t>(key >> 32), static_cast<std::int32_t>(key & 0xffffffffu)}, std::move(stops));
  }

  // Closes what the rims in a plane bound; returns whether they do bound something.
  bool close(std::size_t plane) {
    const std::vector<Edge> rim = net(expanded(rims_[plane]));
    if (rim.empty()) return true;
    const Vec3 normal = planes_[plane].normal;
    const std::vector<PlanePoint> at = on_plane(points_of(rim), normal);
    std::map<int, std::vector<Edge>> sides;  // of what is bounded so often, without the rest
    for (std::size_t i = 0; i < rim.size(); ++i) {
      poll_stop();
      const int left = winding_left_of(at, i);
      if (left > 0)
        sides[left].push_back(rim[i]);
      else
        sides[left - 1].push_back({rim[i][1], rim[i][0]});
    }
    for (const auto& [times, edges] : sides) {
      const std::optional<Loops> loops = loops_of(edges);
      if (!loops) return false;
      add_caps(caps_, mesh_.vertices, *loops, normal, times > 0 ? 1 : -1);
    }
    return true;
  }

  // Gives faces beside the rims the vertices of the rims, and adds the caps.
  void split_faces() {
    std::vector<Triangle> faces;
    for (const Triangle& f : mesh_.faces) {
      std::vector<Edge> sides;
      for (int e = 0; e < 3; ++e) expand({f[e], f[(e + 1) % 3]}, sides);
      if (sides.size() == 3) {
        faces.push_back(f);
        continue;
      }
      std::vector<std::int32_t> loop;
      std::vector<Vec3> points;
      for (const Edge& e : sides) loop.push_back(e[0]), points.push_back(mesh_.vertices[e[0]]);
      for (const Triangle& t : triangulate({on_plane(points, long_normal(mesh_, f))}, loop))
        faces.push_back({loop[t[0]], loop[t[1]], loop[t[2]]});
    }
    faces.insert(faces.end(), caps_.begin(), caps_.end());
    mesh_.faces = std::move(faces);
  }

  // Stops along an edge from its first vertex, or from its smaller one if that is how they were found.
  void note(const Edge& e, std::vector<std::pair<double, std::int32_t>> stops) {
    std::sort(stops.begin(), stops.end());
    std::vector<std::int32_t>& own = stops_[undirected(e[0], e[1])];
    for (const auto& [along, vertex] : stops) own.push_back(vertex);
    if (e[0] > e[1]) std::reverse(own.begin(), own.end());
  }

  // The edges between the stops on an edge, and on those edges in turn.
  void expand(const Edge& e, std::vector<Edge>& out, int depth = 0) const {
    const auto found = stops_.find(undirected(e[0], e[1]));
    if (found == stops_.end() || depth > kDeepest) {
      out.push_back(e);
      return;
    }
    std::vector<std::int32_t> chain = found->second;
    if (e[0] > e[1]) std::reverse(chain.begin(), chain.end());
    chain.push_back(e[1]);
    std::int32_t from = e[0];
    for (const std::int32_t to : chain) {
      expand({from, to}, out, depth + 1);
      from = to;
    }
  }
  std::vector<Edge> expanded(const std::vector<Edge>& edges) const {
    std::vector<Edge> out;
    for (const Edge& e : edges) expand(e, out);
    return out;
  }

  std::vector<Vec3> points_of(const std::vector<Edge>& edges) const {
    std::vector<Vec3> points;
    for (const Edge& e : edges)
      for (const std::int32_t v : e) points.push_back(mesh_.vertices[v]);
    return points;
  }

  Mesh mesh_;
  std::vector<Plane> planes_;
  std::vector<std::vector<Edge>> rims_;                                 // in each plane
  std::vector<std::int32_t> met_;                                       // the vertices of rims
  std::unordered_map<std::uint64_t, std::vector<std::int32_t>> stops_;  // on an edge, from its smaller vertex
  std::vector<Triangle> caps_;
};

}  // namespace

std::optional<Mesh> reunited(const std::vector<Mesh>& solids) {
  std::optional<Mesh> united = Reunion(solids).united();
  if (!united) return std::nullopt;
  double volume = 0, area = 0;
  for (const Mesh& solid : solids) {
    volume += mesh_volume(solid);
    area += mesh_area(solid);
  }
  // A film over the solids of this thickness is the most by which the union's volume may differ.
  if (std::fabs(mesh_volume(*united) - volume) > kHair * area) return std::nullopt;
  return united;
}

}  // namespace rlacd
