// Python bindings of plane cuts, of the pieces they leave, and of reuniting them.
#include <nanobind/stl/optional.h>
#include <nanobind/stl/pair.h>
#include <nanobind/stl/vector.h>

#include "base/arrays.hpp"
#include "base/mesh_measures.hpp"
#include "cut/halve.hpp"
#include "cut/pieces.hpp"
#include "cut/reunite.hpp"
#include "distance/filling.hpp"

namespace rlacd {

namespace {

using PieceOut = std::tuple<Rows<double, Vec3>, Rows<std::int32_t, Triangle>, double, Rows<double, Vec3>,
                            Rows<std::int32_t, Triangle>, double>;

PieceOut out(Piece&& piece) {
  return {
      rows<double>(std::move(piece.mesh.vertices)), rows<std::int32_t>(std::move(piece.mesh.faces)), piece.volume,
      rows<double>(std::move(piece.hull.vertices)), rows<std::int32_t>(std::move(piece.hull.faces)), piece.hull_volume};
}

std::optional<PieceOut> out(std::optional<Piece>&& piece) {
  return piece ? std::optional(out(std::move(*piece))) : std::nullopt;
}

std::pair<std::optional<PieceOut>, std::optional<PieceOut>> out(std::array<std::optional<Piece>, 2>&& sides) {
  return {out(std::move(sides[0])), out(std::move(sides[1]))};
}

}  // namespace

void bind_plane_cut(nb::module_& m) {
  m.def(
      "cut",
      [](const PointsIn& vertices, const FacesIn& faces, double x, double y, double z, double offset, double least) {
        return out(cut(to_finite_mesh(vertices, faces), {x, y, z}, offset, least));
      },
      Released(), nb::arg("vertices"), nb::arg("faces"), nb::arg("x"), nb::arg("y"), nb::arg("z"), nb::arg("offset"),
      nb::arg("least"),
      "The closed sides below and above a plane of a closed mesh: for each its vertices [V, 3], faces [F, 3] and\n"
      "volume, and those of its hull; None for a side of no more than the least volume, or without a hull.");
  m.def(
      "halve",
      [](const PointsIn& vertices, const FacesIn& faces, const HullCorners& corners,
         const std::vector<const HullCorners*>& around, const std::vector<double>& volumes, double share,
         double least) {
        if (around.size() != volumes.size()) throw std::invalid_argument("one volume a hull");
        std::vector<HullAround> hulls;
        for (std::size_t i = 0; i < around.size(); ++i) hulls.push_back({&around[i]->all, volumes[i]});
        return out(halve(to_finite_mesh(vertices, faces), corners.all, hulls, share, least));
      },
      Released(), nb::arg("vertices"), nb::arg("faces"), nb::arg("corners"), nb::arg("around"), nb::arg("volumes"),
      nb::arg("share"), nb::arg("least"),
      "The sides of a closed mesh, as `cut` returns them, of a plane at a share of its length, from the one to the\n"
      "other of the two hulls around whose volumes it would add the least to; None twice if there are no two.");
  m.def(
      "connected_pieces",
      [](const PointsIn& vertices, const FacesIn& faces, double least) {
        std::optional<std::vector<PieceOut>> all;
        if (std::optional<std::vector<Piece>> found = connected_pieces(to_finite_mesh(vertices, faces), least)) {
          all.emplace();
          for (Piece& piece : *found) all->push_back(out(std::move(piece)));
        }
        return all;
      },
      Released(), nb::arg("vertices"), nb::arg("faces"), nb::arg("least"),
      "The pieces of a closed mesh that edges connect, with their cavities, as `cut` returns its sides, without those\n"
      "of no more than the least volume; None if all is one piece.");
  m.def(
      "reunite",
      [](const std::vector<PointsIn>& vertices, const std::vector<FacesIn>& faces, double least) {
        std::optional<Mesh> united = reunited(to_finite_meshes(vertices, faces));
        return united ? out(piece_of(std::move(*united), least)) : std::nullopt;
      },
      Released(), nb::arg("vertices"), nb::arg("faces"), nb::arg("least"),
      "Solids with disjoint interiors that touch face to face as one, as `cut` returns its sides; None if rounding\n"
      "leaves it open.");
}

}  // namespace rlacd
