// Python bindings of candidate planes and of the plane sweep.
#include <nanobind/stl/vector.h>

#include "base/arrays.hpp"
#include "cut/concave_edges.hpp"
#include "cut/least_excess.hpp"
#include "cut/sweep.hpp"

namespace rlacd {

void bind_sweep(nb::module_& m) {
  m.def(
      "candidate_planes",
      [](const PointsIn& vertices, const FacesIn& faces, const PointsIn& hull_vertices, const FacesIn& hull_faces,
         int per_axis, std::size_t edges) {
        const Mesh mesh = to_mesh(vertices, faces), hull = to_mesh(hull_vertices, hull_faces);
        std::vector<CandidatePlane> planes;
        if (per_axis > 0) planes = equidistant_planes(mesh, hull, per_axis);
        for (const CandidatePlane& plane : concave_planes(mesh, hull, edges)) planes.push_back(plane);
        std::vector<Vec3> normals;
        std::vector<double> offsets;
        for (const CandidatePlane& plane : planes) {
          normals.push_back(plane.normal);
          offsets.push_back(plane.offset);
        }
        return std::tuple(rows<double>(std::move(normals)), rows<double>(std::move(offsets)));
      },
      Released(), nb::arg("vertices"), nb::arg("faces"), nb::arg("hull_vertices"), nb::arg("hull_faces"),
      nb::arg("per_axis"), nb::arg("edges"),
      "Unit normals [K, 3] and offsets [K] of planes: `per_axis` along each coordinate axis and principal axis,\n"
      "which divide the hull's extent into equal slabs, and at most three for each of the concave edges chosen.");
  m.def(
      "sweep",
      [](const PointsIn& vertices, const FacesIn& faces, const PointsIn& directions,
         const nb::ndarray<const double, nb::ndim<2>, nb::c_contig, nb::device::cpu>& offsets, int threads) {
        if (offsets.shape(0) != directions.shape(0)) throw std::invalid_argument("one row of offsets a direction");
        const Mesh mesh = to_mesh(vertices, faces);
        const std::vector<Vec3> normals = to_points(directions);
        const std::vector<double> d(offsets.data(), offsets.data() + offsets.size());
        return rows<double>(sweep(mesh, normals, d, threads));
      },
      Released(), nb::arg("vertices"), nb::arg("faces"), nb::arg("directions"), nb::arg("offsets"),
      nb::arg("threads") = 0,
      "Scores of the planes n.x = d for unit directions n [K, 3] and ascending offsets d [K, M]: float64 [K * M, "
      "10].\n\n"
      "Columns: hull volume below, above; solid volume below, above; section area, perimeter; thickness below, above;\n"
      "largest extent below, above. The mesh must be closed and outward oriented.");
  m.def(
      "find_least_excess",
      [](const PointsIn& vertices, const FacesIn& faces, const PointsIn& directions,
         const nb::ndarray<const double, nb::ndim<2>, nb::c_contig, nb::device::cpu>& offsets, double exponent,
         double tie, double least_solid, const std::vector<double>& slivers, int threads) {
        if (offsets.shape(0) != directions.shape(0)) throw std::invalid_argument("one row of offsets a direction");
        const Mesh mesh = to_finite_mesh(vertices, faces);
        const std::vector<Vec3> normals = to_points(directions);
        const std::vector<double> d(offsets.data(), offsets.data() + offsets.size());
        return static_cast<std::int64_t>(
            find_least_excess(mesh, normals, d, {exponent, tie, least_solid, slivers}, threads));
      },
      Released(), nb::arg("vertices"), nb::arg("faces"), nb::arg("directions"), nb::arg("offsets"), nb::arg("exponent"),
      nb::arg("tie"), nb::arg("least_solid"), nb::arg("slivers"), nb::arg("threads") = 0,
      "The first of the planes n.x = d, for unit directions n [K, 3] and ascending offsets d [K, M], whose sides'\n"
      "excesses (volume of the hull less that of the solid) have the least norm; -1 where no plane is valid.\n\n"
      "A plane is valid where both sides hold more than `least_solid` and are thicker than a share of their largest\n"
      "extent: the first of `slivers` by which there are valid planes. Costs, the norm's power `exponent` where that\n"
      "is finite, that differ by no more than `tie` are equal. The mesh must be closed and outward oriented.");
}

}  // namespace rlacd
