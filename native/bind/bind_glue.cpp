// Python bindings of gluing.
#include <nanobind/stl/vector.h>

#include <algorithm>

#include "base/arrays.hpp"
#include "distance/glue.hpp"

namespace rlacd {

void bind_glue(nb::module_& m) {
  m.def(
      "glue",
      [](const PointsIn& va, const FacesIn& fa, const PointsIn& vb, const FacesIn& fb) {
        return out(glue(to_mesh(va, fa), to_mesh(vb, fb)));
      },
      Released(), nb::arg("vertices_a"), nb::arg("faces_a"), nb::arg("vertices_b"), nb::arg("faces_b"),
      "Surface (vertices [V, 3], faces [F, 3]) of the union of two closed solids with disjoint interiors: both "
      "surfaces\n"
      "without the regions where they touch face to face (within 1e-8). Not a closed mesh: for measuring only.");
  m.def(
      "do_touch",
      [](const std::vector<PointsIn>& va, const std::vector<FacesIn>& fa, const std::vector<PointsIn>& vb,
         const std::vector<FacesIn>& fb) {
        const std::vector<Mesh> first = to_finite_meshes(va, fa), second = to_finite_meshes(vb, fb);
        return std::any_of(first.begin(), first.end(), [&](const Mesh& a) {
          return std::any_of(second.begin(), second.end(), [&](const Mesh& b) { return do_touch(a, b); });
        });
      },
      Released(), nb::arg("vertices_a"), nb::arg("faces_a"), nb::arg("vertices_b"), nb::arg("faces_b"),
      "Whether some solid of a list touches one of another face to face, not just in an edge or a point.");
}

}  // namespace rlacd
