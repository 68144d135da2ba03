// Edge-connected pieces of a mesh: see bodies.hpp for input, output and algorithm.
#include "cut/bodies.hpp"

#include <algorithm>
#include <cmath>
#include <numeric>

namespace rlacd {

namespace {

struct Halfedge {
  std::int32_t high, apex, face;  // the larger of its vertices, and the third corner of its face
  bool ascends;                   // runs towards `high`
};

// Sorts the halfedges between two vertices by angle, such that the solid lies between an ascending one and the one
// before it. False if ascending and descending halfedges do not alternate.
bool sort_around(const Mesh& mesh, std::int32_t low, std::vector<Halfedge>::iterator begin,
                 std::vector<Halfedge>::iterator end) {
  const Vec3 origin = mesh.vertices[low], along = normalized(mesh.vertices[begin->high] - origin);
  const Vec3 u = normalized(cross(along, mesh.vertices[begin->apex] - origin)), v = cross(along, u);
  const auto angle = [&](const Halfedge& h) {
    const Vec3 a = mesh.vertices[h.apex] - origin;
    return std::atan2(dot(v, a), dot(u, a));
  };
  std::sort(begin, end, [&](const Halfedge& h, const Halfedge& g) { return angle(h) < angle(g); });
  for (auto h = begin; h != end; ++h)
    if (h->ascends == (h + 1 == end ? begin : h + 1)->ascends) return false;
  return true;
}

}  // namespace

std::vector<Mesh> bodies(const Mesh& mesh) {
  std::vector<std::int32_t> parent(mesh.faces.size());
  std::iota(parent.begin(), parent.end(), 0);
  const auto root = [&parent](std::int32_t f) {
    while (parent[f] != f) f = parent[f] = parent[parent[f]];
    return f;
  };
  const auto join = [&](std::int32_t f, std::int32_t g) {
    const std::int32_t a = root(f), b = root(g);
    parent[std::max(a, b)] = std::min(a, b);
  };
  std::vector<std::size_t> first(mesh.vertices.size() + 1, 0);  // halfedges, bucketed by the smaller of their vertices
  for (const Triangle& f : mesh.faces)
    for (int e = 0; e < 3; ++e) ++first[std::min(f[e], f[(e + 1) % 3]) + 1];
  for (std::size_t v = 0; v < mesh.vertices.size(); ++v) first[v + 1] += first[v];
  std::vector<Halfedge> halfedges(3 * mesh.faces.size());
  std::vector<std::size_t> next(first.begin(), first.end() - 1);
  for (std::size_t f = 0; f < mesh.faces.size(); ++f)
    for (int e = 0; e < 3; ++e) {
      const std::int32_t a = mesh.faces[f][e], b = mesh.faces[f][(e + 1) % 3], apex = mesh.faces[f][(e + 2) % 3];
      halfedges[next[std::min(a, b)]++] = {std::max(a, b), apex, static_cast<std::int32_t>(f), a < b};
    }
  for (std::size_t v = 0; v < mesh.vertices.size(); ++v) {
    const auto begin = halfedges.begin() + static_cast<std::ptrdiff_t>(first[v]);
    const auto end = halfedges.begin() + static_cast<std::ptrdiff_t>(first[v + 1]);
    std::sort(begin, end, [](const Halfedge& h, const Halfedge& g) { return h.high < g.high; });
    for (auto h = begin, after = h; h != end; h = after) {
      after = std::find_if(h, end, [h](const Halfedge& g) { return g.high != h->high; });
      if (after - h > 2 && sort_around(mesh, static_cast<std::int32_t>(v), h, after)) {
        for (auto g = h; g != after; ++g)
          if (g->ascends) join(g->face, (g == h ? after - 1 : g - 1)->face);
      } else {
        for (auto g = h + 1; g != after; ++g) join(g->face, (g - 1)->face);
      }
    }
  }
  std::vector<std::int32_t> body(mesh.faces.size(), -1);
  std::vector<Mesh> found;
  std::vector<std::vector<std::int32_t>> members;
  for (std::int32_t f = 0; f < static_cast<std::int32_t>(mesh.faces.size()); ++f) {
    const std::int32_t r = root(f);
    if (body[r] < 0) body[r] = static_cast<std::int32_t>(members.size()), members.emplace_back();
    members[body[r]].push_back(f);
  }
  std::vector<std::int32_t> number(mesh.vertices.size()), owner(mesh.vertices.size(), -1);
  for (std::size_t b = 0; b < members.size(); ++b) {
    Mesh one;
    for (const std::int32_t f : members[b]) {
      Triangle face = mesh.faces[f];
      for (std::int32_t& corner : face) {
        if (owner[corner] != static_cast<std::int32_t>(b)) {
          owner[corner] = static_cast<std::int32_t>(b);
          number[corner] = static_cast<std::int32_t>(one.vertices.size());
          one.vertices.push_back(mesh.vertices[corner]);
        }
        corner = number[corner];
      }
      one.faces.push_back(face);
    }
    found.push_back(std::move(one));
  }
  return found;
}

}  // namespace rlacd
