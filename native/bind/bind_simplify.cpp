// Python binding of hull simplification.

#include "base/arrays.hpp"
#include "hull/simplify_hull.hpp"

namespace rlacd {

void bind_simplify(nb::module_& m) {
  m.def(
      "simplify_hull",
      [](const PointsIn& vertices, const FacesIn& faces, std::size_t max_vertices, std::size_t max_faces,
         double tolerance) {
        Mesh hull = to_finite_mesh(vertices, faces);
        if (!(tolerance >= 0)) throw std::invalid_argument("the tolerance must not be negative");
        if (hull.vertices.empty()) throw std::invalid_argument("the hull has no vertices");
        hull = simplify_hull(hull, max_vertices, max_faces, tolerance);
        return out(std::move(hull));
      },
      Released(), nb::arg("vertices"), nb::arg("faces"), nb::arg("max_vertices"), nb::arg("max_faces"),
      nb::arg("tolerance") = 1e-6,
      "A convex hull (vertices [V, 3], faces [F, 3]) around a convex hull with at most max_vertices corners and\n"
      "max_faces triangles and little added volume; corners that cost no more than `tolerance` of distance go anyway.");
}

}  // namespace rlacd
