// Python bindings of the plane sweep.
#include "arrays.hpp"
#include "sweep.hpp"

namespace rlacd {

void bind_sweep(nb::module_& m) {
  m.def(
      "sweep",
      [](const PointsIn& vertices, const FacesIn& faces, const PointsIn& directions,
         const nb::ndarray<const double, nb::ndim<2>, nb::c_contig, nb::device::cpu>& offsets, int threads) {
        if (offsets.shape(0) != directions.shape(0)) throw std::invalid_argument("one row of offsets a direction");
        const Mesh mesh = to_mesh(vertices, faces);
        const std::vector<Vec3> normals = to_points(directions);
        const std::vector<double> d(offsets.data(), offsets.data() + offsets.size());
        std::vector<PlaneScore> scores;
        {
          nb::gil_scoped_release release;
          scores = sweep(mesh, normals, d, threads);
        }
        return to_array<double>(std::move(scores));
      },
      nb::arg("vertices"), nb::arg("faces"), nb::arg("directions"), nb::arg("offsets"), nb::arg("threads") = 0,
      "Scores of the planes n.x = d for unit directions n [K, 3] and ascending offsets d [K, M]: float64 [K * M, "
      "10].\n\n"
      "Columns: hull volume below, above; solid volume below, above; section area, perimeter; thickness below, above;\n"
      "largest extent below, above. The mesh must be closed and outward oriented.");
}

}  // namespace rlacd
