// Python bindings of the convex hull and of mesh volume and area.
#include "arrays.hpp"
#include "hull.hpp"

namespace rlacd {

void bind_hull(nb::module_& m) {
  m.def(
      "convex_hull",
      [](const PointsIn& array) {
        const std::vector<Vec3> points = to_points(array);
        Hull hull;
        {
          nb::gil_scoped_release release;
          hull = convex_hull(points);
        }
        return nb::make_tuple(to_array<std::int32_t>(std::move(hull.indices)),
                              to_array<std::int32_t>(std::move(hull.faces)), hull.rank);
      },
      nb::arg("points"),
      "Convex hull of points [N, 3]: (indices [H] into points, faces [F, 3] into those H points, rank).\n\n"
      "Every index is an extreme point, the facets are exactly convex (no rounding in the decisions) and outward\n"
      "oriented. rank < 3 (all points coplanar): no indices, no faces.");
  m.def(
      "mesh_volume", [](const PointsIn& v, const FacesIn& f) { return mesh_volume(to_points(v), to_mesh(v, f).faces); },
      nb::arg("vertices"), nb::arg("faces"), "Signed volume of a closed triangle mesh.");
  m.def(
      "mesh_area", [](const PointsIn& v, const FacesIn& f) { return mesh_area(to_points(v), to_mesh(v, f).faces); },
      nb::arg("vertices"), nb::arg("faces"), "Area of a triangle mesh.");
}

}  // namespace rlacd
