// Python bindings of contacts between convex polytopes.

#include <cmath>

#include "base/arrays.hpp"
#include "hull/flush.hpp"

namespace rlacd {

void bind_flush(nb::module_& m) {
  const auto require_depth = [](double depth, double touch) {
    if (!(depth > 0) || !std::isfinite(depth)) throw std::invalid_argument("the depth must be positive");
    if (!(touch >= 0)) throw std::invalid_argument("the gap of a touch must not be negative");
  };
  nb::class_<FlushBody>(m, "FlushBody", "A closed convex triangle mesh by its flat sides, for finding contacts.")
      .def(
          "__init__",
          [](FlushBody* self, const PointsIn& vertices, const FacesIn& faces) {
            const Mesh hull = to_finite_mesh(vertices, faces);
            new (self) FlushBody(hull);
          },
          Released(), nb::arg("vertices"), nb::arg("faces"))
      .def(
          "depths",
          [](const FlushBody& self, const PointsIn& array) {
            std::vector<double> depths;
            for (const Vec3 point : to_points(array)) depths.push_back(self.depth(point));
            return rows<double>(std::move(depths));
          },
          Released(), nb::arg("points"), "How deep points [N, 3] lie inside [N]; negative outside.")
      .def(
          "contact",
          [=](const FlushBody& self, const FlushBody& other, double depth, double touch) {
            require_depth(depth, touch);
            FlushBody::Contact contact = self.contact(other, depth, touch);
            return std::tuple(rows<std::int32_t>(std::move(contact.sides)), rows<double>(std::move(contact.places)));
          },
          Released(), nb::arg("other"), nb::arg("depth"), nb::arg("touch"),
          "Where a side of another body, turned the other way, lies less deep than `depth` under a side of this one:\n"
          "(sides [S] of this body, places [N, 3] on the other). Sides touch that are no farther apart than `touch`.")
      .def(
          "layer",
          [=](const FlushBody& self, const FlushBody& other, const IndicesIn& array, double depth, double touch) {
            require_depth(depth, touch);
            return rows<double>(self.layer(other, to_numbers(array, self.size()), depth, touch));
          },
          Released(), nb::arg("other"), nb::arg("sides"), nb::arg("depth"), nb::arg("touch"),
          "What another body fills of this one with some of its sides, and those within 60 degrees of them, moved\n"
          "outwards: points [N, 3] whose hull it is. Planes that it crosses by at most `touch` are left out.");
}

}  // namespace rlacd
