// Python bindings of distances between a union of hulls and a surface.
#include <nanobind/stl/vector.h>

#include "base/arrays.hpp"
#include "base/parallel.hpp"
#include "distance/surface.hpp"
#include "distance/union_distance.hpp"

namespace rlacd {

void bind_union(nb::module_& m) {
  const auto require_positive = [](double tolerance, double gap) {
    if (!(tolerance > 0)) throw std::invalid_argument("the tolerance must be positive");
    if (!(gap > 0)) throw std::invalid_argument("the gap must be positive");
  };
  nb::class_<HullUnion>(m, "HullUnion", "The union of convex hulls, each closed, convex and outward oriented.")
      .def(
          "__init__",
          [](HullUnion* self, const std::vector<PointsIn>& vertices, const std::vector<FacesIn>& faces, int threads) {
            new (self) HullUnion(to_finite_meshes(vertices, faces), threads);
          },
          Released(), nb::arg("vertices"), nb::arg("faces"), nb::arg("threads") = 0)
      .def(
          "only", [](const HullUnion& self, const std::vector<std::int32_t>& some) { return self.only(some); },
          nb::arg("some"), "The union of the hulls with these numbers, which are not prepared again.")
      .def(
          "exposed",
          [=](const HullUnion& self, double gap, int threads) {
            require_positive(1, gap);
            HullUnion::Exposed found = self.exposed(gap, threads);
            append(found.exposed, found.unresolved);
            return out(std::move(found.exposed));
          },
          Released(), nb::arg("gap") = 1e-6, nb::arg("threads") = 0,
          "Surface of the union as triangles (vertices [V, 3], faces [F, 3]); touching facets are no part of it.")
      .def(
          "over",
          [=](const HullUnion& self, const Surface& surface, double tolerance, double gap, int threads) {
            require_positive(tolerance, gap);
            Greatest found = self.over(surface.bvh(), tolerance, gap, threads);
            return std::tuple(found.lower, found.upper, std::tuple(found.at.x, found.at.y, found.at.z));
          },
          Released(), nb::arg("surface"), nb::arg("tolerance"), nb::arg("gap") = 1e-6, nb::arg("threads") = 0,
          "(lower, upper, place) of the greatest distance from the union's surface to the given surface.")
      .def(
          "under",
          [=](const HullUnion& self, const PointsIn& vertices, const FacesIn& faces, double tolerance, int threads) {
            require_positive(tolerance, 1);
            const Mesh mesh = to_finite_mesh(vertices, faces);
            Greatest found = self.under(mesh, tolerance, threads);
            return std::tuple(found.lower, found.upper, std::tuple(found.at.x, found.at.y, found.at.z));
          },
          Released(), nb::arg("vertices"), nb::arg("faces"), nb::arg("tolerance"), nb::arg("threads") = 0,
          "(lower, upper, place) of the greatest distance from the mesh's faces to the union as a solid, 0 inside.")
      .def(
          "distance",
          [](const HullUnion& self, const PointsIn& array, int threads) {
            const std::vector<Vec3> points = to_points(array);
            require_finite(points);
            std::vector<double> distances(points.size());
            constexpr std::size_t kChunk = 64;
            parallel_for((points.size() + kChunk - 1) / kChunk, threads, [&](std::size_t chunk) {
              for (std::size_t i = chunk * kChunk; i < std::min(points.size(), (chunk + 1) * kChunk); ++i)
                distances[i] = self.distance(points[i]);
            });
            return rows<double>(std::move(distances));
          },
          Released(), nb::arg("points"), nb::arg("threads") = 0,
          "Distances [N] of points [N, 3] to the solid, 0 inside a hull.");
}

}  // namespace rlacd
