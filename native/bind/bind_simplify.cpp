// Python binding of hull simplification.

#include "base/arrays.hpp"
#include "hull/simplify_hull.hpp"

namespace rlacd {

void bind_simplify(nb::module_& m) {
  m.def(
      "simplify_hull",
      [](const PointsIn& vertices, const FacesIn& faces, std::size_t max_vertices, std::size_t max_faces,
         double tolerance, const PlanesIn& bounds) {
        const Mesh hull = to_finite_mesh(vertices, faces);
        if (!(tolerance >= 0)) throw std::invalid_argument("the tolerance must not be negative");
        if (hull.vertices.empty()) throw std::invalid_argument("the hull has no vertices");
        std::vector<Above> above;
        for (std::size_t i = 0; i < bounds.shape(0); ++i) {
          const double* row = bounds.data() + 4 * i;
          above.push_back({{-row[0], -row[1], -row[2]}, -row[3]});
          require_finite({above.back().normal});
        }
        return out(simplify_hull(hull, max_vertices, max_faces, tolerance, above));
      },
      Released(), nb::arg("vertices"), nb::arg("faces"), nb::arg("max_vertices"), nb::arg("max_faces"),
      nb::arg("tolerance"), nb::arg("bounds"),
      "A convex hull (vertices [V, 3], faces [F, 3]) around a convex hull with at most max_vertices corners and\n"
      "max_faces triangles and little added volume; corners that cost no more than `tolerance` of distance go anyway.\n"
      "It stays in the half-spaces n.x <= d of bounds [P, 4] (unit n, d), unless the limits leave no such hull.");
}

}  // namespace rlacd
