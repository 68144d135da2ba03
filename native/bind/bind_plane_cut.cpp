// Python bindings of plane cuts and of the pieces they leave.
#include <nanobind/stl/vector.h>

#include "base/arrays.hpp"
#include "cut/pieces.hpp"
#include "cut/reunite.hpp"

namespace rlacd {

namespace {

nb::object as_object(std::optional<Piece>&& piece) {
  if (!piece) return nb::none();
  return nb::make_tuple(to_array<double>(std::move(piece->mesh.vertices)),
                        to_array<std::int32_t>(std::move(piece->mesh.faces)), piece->volume,
                        to_array<double>(std::move(piece->hull.vertices)),
                        to_array<std::int32_t>(std::move(piece->hull.faces)), piece->hull_volume);
}

}  // namespace

void bind_plane_cut(nb::module_& m) {
  m.def(
      "cut",
      [](const PointsIn& vertices, const FacesIn& faces, double x, double y, double z, double offset, double least) {
        std::array<std::optional<Piece>, 2> sides;
        {
          nb::gil_scoped_release release;
          sides = cut(to_finite_mesh(vertices, faces), {x, y, z}, offset, least);
        }
        return nb::make_tuple(as_object(std::move(sides[0])), as_object(std::move(sides[1])));
      },
      nb::arg("vertices"), nb::arg("faces"), nb::arg("x"), nb::arg("y"), nb::arg("z"), nb::arg("offset"),
      nb::arg("least"),
      "The closed sides below and above a plane of a closed mesh: for each its vertices [V, 3], faces [F, 3] and\n"
      "volume, and those of its hull; None for a side of no more than the least volume, or without a hull.");
  m.def(
      "connected_pieces",
      [](const PointsIn& vertices, const FacesIn& faces, double least) -> nb::object {
        std::optional<std::vector<Piece>> pieces;
        {
          nb::gil_scoped_release release;
          pieces = connected_pieces(to_finite_mesh(vertices, faces), least);
        }
        if (!pieces) return nb::none();
        nb::list all;
        for (Piece& piece : *pieces) all.append(as_object(std::move(piece)));
        return all;
      },
      nb::arg("vertices"), nb::arg("faces"), nb::arg("least"),
      "The pieces of a closed mesh that edges connect, with their cavities, as `cut` returns its sides, without those "
      "of no more\n"
      "than the least volume; None if all is one piece.");
  m.def(
      "reunite",
      [](const std::vector<PointsIn>& vertices, const std::vector<FacesIn>& faces, double least) {
        if (vertices.size() != faces.size()) throw std::invalid_argument("one array of faces a solid");
        std::optional<Piece> whole;
        {
          nb::gil_scoped_release release;
          std::vector<Mesh> solids;
          for (std::size_t i = 0; i < vertices.size(); ++i) solids.push_back(to_finite_mesh(vertices[i], faces[i]));
          if (std::optional<Mesh> united = reunited(solids)) whole = piece_of(std::move(*united), least);
        }
        return as_object(std::move(whole));
      },
      nb::arg("vertices"), nb::arg("faces"), nb::arg("least"),
      "Solids with disjoint interiors that touch face to face as one, as `cut` returns its sides; None if rounding\n"
      "leaves it open.");
}

}  // namespace rlacd
