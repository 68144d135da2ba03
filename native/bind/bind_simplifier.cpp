// Python bindings of the simplification of a closed mesh.
#include "base/arrays.hpp"
#include "base/parallel.hpp"
#include "proxy/simplifier.hpp"

namespace rlacd {

void bind_simplifier(nb::module_& m) {
  nb::class_<Simplifier>(m, "Simplifier", "A closed, oriented manifold mesh that gets fewer and fewer triangles.")
      .def(
          "__init__",
          [](Simplifier* self, const PointsIn& vertices, const FacesIn& faces) {
            new (self) Simplifier(to_finite_mesh(vertices, faces));
          },
          Released(), nb::arg("vertices"), nb::arg("faces"))
      .def(
          "reduce",
          [](Simplifier& self, std::size_t count, int threads) { self.reduce(count, resolve_threads(threads)); },
          nb::arg("count"), nb::arg("threads") = 1, Released(),
          "Collapse edges until at most `count` triangles are left, or hardly any edge can be collapsed.")
      .def(
          "mesh", [](const Simplifier& self) { return out(self.mesh()); }, Released(),
          "The vertices [V, 3] and faces [F, 3] reached.");
}

}  // namespace rlacd
