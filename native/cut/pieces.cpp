#include "cut/pieces.hpp"

#include <algorithm>
#include <numeric>

#include "base/mesh_measures.hpp"
#include "cut/bodies.hpp"
#include "cut/caps.hpp"
#include "distance/surface.hpp"
#include "hull/hull.hpp"

namespace rlacd {

namespace {

constexpr double kApart = 1e-10;  // facet planes are moved out by this, so that faces on them stay whole
constexpr double kHalf = 0.5;     // a winding number between inside and outside

// Where a solid crosses itself, each cut may multiply its crossings: one that doubles its faces, and adds so many, is
// given up.
constexpr std::size_t kManyNewFaces = 1000;

}  // namespace

std::optional<Piece> piece_of(Mesh mesh, double least) {
  if (mesh.faces.empty()) return std::nullopt;
  Piece piece;
  piece.volume = mesh_volume(mesh.vertices, mesh.faces);
  if (!(piece.volume > least)) return std::nullopt;
  piece.hull = hull_mesh(mesh.vertices);
  if (piece.hull.faces.empty()) return std::nullopt;
  piece.hull_volume = mesh_volume(piece.hull.vertices, piece.hull.faces);
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
  for (const Mesh& one : all) volumes.push_back(mesh_volume(one.vertices, one.faces));
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
      if (surfaces[shell]->winding().of_closed(all[i].vertices[0]) <= kHalf) continue;
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

Mesh inside_all(Mesh mesh, const Mesh& hull) {
  std::size_t fewest = mesh.faces.size();
  for (const Triangle& f : hull.faces) {
    const Vec3 normal = normalized(long_normal(hull, f));
    const double offset = dot(normal, hull.vertices[f[0]]) + kApart;
    if (std::none_of(mesh.vertices.begin(), mesh.vertices.end(), [&](Vec3 p) { return dot(normal, p) > offset; }))
      continue;
    mesh = capped(std::move(cut_by_plane(mesh, normal, offset)[0]), normal);
    if (mesh.faces.size() > 2 * fewest + kManyNewFaces) return {};
    fewest = std::min(fewest, mesh.faces.size());
  }
  return mesh;
}

}  // namespace rlacd
