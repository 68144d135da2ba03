#include "solid/pieces.hpp"

#include <algorithm>
#include <cmath>
#include <numeric>

#include "convex/hull.hpp"
#include "core/elementary.hpp"
#include "core/mesh_measures.hpp"
#include "core/stop.hpp"
#include "solid/caps.hpp"
#include "surface/edges.hpp"
#include "surface/surface.hpp"

namespace rlacd {

namespace {

// Sorts the halfedges between two vertices by angle, such that the solid lies between an ascending one and the one
// before it. False if ascending and descending halfedges do not alternate.
bool sort_around(const Mesh& mesh, std::size_t low, Run* begin, Run* end) {
  const Vec3 origin = mesh.vertices[low], along = normalized(mesh.vertices[begin->high] - origin);
  const auto apex = [&](const Run& run) {
    return mesh.vertices[mesh.faces[run.halfedge / 3][(run.halfedge + 2) % 3]] - origin;
  };
  const Vec3 u = normalized(cross(along, apex(*begin))), v = cross(along, u);
  const auto angle = [&](const Run& run) { return angle_of(dot(v, apex(run)), dot(u, apex(run))); };
  std::sort(begin, end, [&](const Run& a, const Run& b) { return angle(a) < angle(b); });
  for (const Run* r = begin; r != end; ++r)
    if (ascends(mesh.faces, low, *r) == ascends(mesh.faces, low, r + 1 == end ? *begin : r[1])) return false;
  return true;
}

// The pieces of a mesh that edges connect, in the order of their first faces, each without unused vertices: union-find
// over the faces on both sides of each edge. If more than two faces meet at an edge, they are sorted around it, and two
// neighbours are connected if the solid lies between them.
std::vector<Mesh> bodies(const Mesh& mesh) {
  Groups groups(mesh.faces.size());
  const auto join = [&groups](const Run& a, const Run& b) { groups.join(a.halfedge / 3, b.halfedge / 3); };
  Buckets<Run> runs = sorted_halfedges(mesh.faces, mesh.vertices.size());
  for (std::size_t v = 0; v < mesh.vertices.size(); ++v) {
    const auto [begin, end] = runs.range(v);
    for (Run *first = begin, *after; first != end; first = after) {
      after = std::find_if(first, end, [first](const Run& run) { return run.high != first->high; });
      if (after - first > 2 && sort_around(mesh, v, first, after)) {
        for (const Run* r = first; r != after; ++r)
          if (ascends(mesh.faces, v, *r)) join(*r, r == first ? after[-1] : r[-1]);
      } else {
        for (const Run* r = first + 1; r != after; ++r) join(*r, r[-1]);
      }
    }
  }
  const auto [count, body] = groups.labels();
  std::vector<std::vector<std::int32_t>> members(static_cast<std::size_t>(count));
  for (std::size_t f = 0; f < mesh.faces.size(); ++f) members[body[f]].push_back(static_cast<std::int32_t>(f));
  std::vector<Mesh> found;
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

double growth(const Mesh& hull, const std::vector<Vec3>& corners) {
  HullBuilder joint;
  joint.add(joined(hull.vertices, corners));
  return joint.volume() - mesh_volume(hull);
}

// No hull grows by less: pyramids over the facets that one of the corners sees.
double least_growth(const Mesh& hull, const std::vector<Vec3>& corners) {
  std::vector<double> added(corners.size());
  for (const Triangle& face : hull.faces) {
    const Corners t = corners_of(hull, face);
    const Vec3 normal = long_normal(t);
    for (std::size_t i = 0; i < corners.size(); ++i) added[i] += std::max(0.0, dot(normal, corners[i] - t[0]));
  }
  return 0.999 / 6 * *std::max_element(added.begin(), added.end());  // rounding must not make it more
}

}  // namespace

std::optional<Piece> piece_of(Mesh mesh, double least) {
  if (mesh.faces.empty()) return std::nullopt;
  Piece piece;
  piece.volume = mesh_volume(mesh);
  if (!(piece.volume > least)) return std::nullopt;
  piece.hull = hull_mesh(mesh.vertices);
  if (piece.hull.faces.empty()) return std::nullopt;
  piece.hull_volume = mesh_volume(piece.hull);
  piece.mesh = std::move(mesh);
  return piece;
}

std::array<std::optional<Piece>, 2> cut(const Mesh& mesh, Vec3 normal, double offset, double least) {
  std::array<OpenSide, 2> sides = cut_by_plane(mesh, normal, offset);
  return {piece_of(capped(std::move(sides[0]), normal), least), piece_of(capped(std::move(sides[1]), -normal), least)};
}

std::optional<std::vector<Piece>> connected_pieces(const Mesh& mesh, double least) {
  std::vector<Mesh> all = bodies(mesh);
  if (all.size() == 1) return std::nullopt;
  std::vector<Piece> pieces;
  std::vector<double> volumes;
  for (const Mesh& one : all) volumes.push_back(mesh_volume(one));
  std::vector<std::size_t> shells(all.size());
  std::iota(shells.begin(), shells.end(), 0);
  shells.erase(std::remove_if(shells.begin(), shells.end(), [&](std::size_t i) { return !(volumes[i] > 0); }),
               shells.end());
  std::vector<std::size_t> by_volume = shells;
  std::stable_sort(by_volume.begin(), by_volume.end(),
                   [&](std::size_t a, std::size_t b) { return volumes[a] < volumes[b]; });
  std::vector<std::unique_ptr<Surface>> surfaces(all.size());
  std::vector<std::vector<std::size_t>> cavities(all.size());
  for (std::size_t i = 0; i < all.size(); ++i) {
    if (!(volumes[i] < 0)) continue;
    for (const std::size_t shell : by_volume) {
      if (!surfaces[shell]) surfaces[shell] = std::make_unique<Surface>(all[shell]);
      if (!surfaces[shell]->holds(all[i].vertices[0])) continue;
      cavities[shell].push_back(i);
      break;
    }
  }
  for (const std::size_t shell : shells) {
    Mesh own = std::move(all[shell]);
    for (const std::size_t i : cavities[shell]) append(own, all[i]);
    if (std::optional<Piece> piece = piece_of(std::move(own), least)) pieces.push_back(std::move(*piece));
  }
  return pieces;
}

std::vector<Vec3> between(const ConvexBody& hull, const std::vector<const ConvexBody*>& around) {
  const std::vector<Vec3>& corners = hull.mesh().vertices;
  if (around.size() < 2 || corners.empty()) return {};  // what one cannot take, it cannot take in halves
  using Growth = std::pair<double, std::size_t>;
  std::vector<Growth> least, by_growth;
  for (std::size_t i = 0; i < around.size(); ++i) least.emplace_back(least_growth(around[i]->mesh(), corners), i);
  std::sort(least.begin(), least.end());
  for (const auto& [bound, i] : least) {
    poll_stop();
    if (by_growth.size() == 2 && bound > by_growth[1].first) break;
    by_growth.emplace_back(growth(around[i]->mesh(), corners), i);
    std::sort(by_growth.begin(), by_growth.end());
    by_growth.resize(std::min<std::size_t>(by_growth.size(), 2));
  }
  const Vec3 along =
      middle_of(around[by_growth[1].second]->mesh().vertices) - middle_of(around[by_growth[0].second]->mesh().vertices);
  const double length = norm(along);
  if (length == 0) return {};
  return {along / length};
}

std::vector<Piece> halve(const Mesh& piece, const ConvexBody& hull, const std::vector<Vec3>& directions, double share,
                         double least) {
  double longest = 0, offset = 0;
  Vec3 along;
  for (const Vec3 direction : directions) {
    double from = HUGE_VAL, to = -HUGE_VAL;
    for (const Vec3 p : hull.mesh().vertices)
      from = std::min(from, dot(p, direction)), to = std::max(to, dot(p, direction));
    if (to - from > longest) longest = to - from, offset = from + share * longest, along = direction;
  }
  std::vector<Piece> halves;
  if (longest == 0) return halves;
  auto [below, above] = cut(piece, along, offset, least);
  if (!below || !above) return halves;
  if (above->volume < below->volume) std::swap(below, above);
  halves.push_back(std::move(*below));
  halves.push_back(std::move(*above));
  return halves;
}

}  // namespace rlacd
