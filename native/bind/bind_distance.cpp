// Python bindings of the surface queries: closest points, winding numbers, samples, one-sided Hausdorff distance.

#include "base/arrays.hpp"
#include "base/parallel.hpp"
#include "distance/apart.hpp"
#include "distance/crossings.hpp"
#include "distance/hausdorff.hpp"
#include "distance/sample.hpp"
#include "distance/surface.hpp"

namespace rlacd {
namespace {

using LabelsIn = nb::ndarray<const std::int64_t, nb::ndim<1>, nb::c_contig, nb::device::cpu>;

constexpr std::size_t kChunk = 256;

// The closest points of a surface: neighbours in the list are often near each other, so the triangle found for one
// point bounds the distance of the next. The bound allows for rounding, so
// that the triangle found is the same without it.
template <class Take>
void for_each_closest(const Bvh& bvh, const std::vector<Vec3>& points, int threads, const Take& take) {
  const std::size_t chunks = (points.size() + kChunk - 1) / kChunk;
  parallel_for(chunks, threads, [&](std::size_t chunk) {
    std::int32_t near = -1;
    for (std::size_t i = chunk * kChunk; i < std::min(points.size(), (chunk + 1) * kChunk); ++i) {
      Bvh::Hit hit;
      if (near >= 0) {
        const double known = bvh.distance(near, points[i]), slack = 1e-7 * std::sqrt(bvh.triangle(near).longest2);
        hit = bvh.closest(points[i], -1, 0, known + slack);
      }
      if (hit.slot < 0) hit = bvh.closest(points[i]);
      near = hit.slot;
      take(i, hit);
    }
  });
}

// Runs task(i) for every point without the GIL, in chunks large enough to justify a thread.
template <class Task>
void for_each_point(std::size_t count, int threads, const Task& task) {
  const std::size_t chunks = (count + kChunk - 1) / kChunk;
  parallel_for(chunks, threads, [&](std::size_t chunk) {
    for (std::size_t i = chunk * kChunk; i < std::min(count, (chunk + 1) * kChunk); ++i) task(i);
  });
}

void require_positive_tolerance(double tolerance) {
  if (!(tolerance > 0)) throw std::invalid_argument("the tolerance must be positive");
}

}  // namespace

void bind_distance(nb::module_& m) {
  nb::class_<Surface>(m, "Surface",
                      "A triangle surface and a tree of boxes over it. Any quality: open, self-intersecting, slivers.")
      .def(
          "__init__",
          [](Surface* self, const PointsIn& vertices, const FacesIn& faces, int threads) {
            const Mesh mesh = to_finite_mesh(vertices, faces);
            if (mesh.faces.empty()) throw std::invalid_argument("the surface has no faces");
            new (self) Surface(mesh, threads);
          },
          Released(), nb::arg("vertices"), nb::arg("faces"), nb::arg("threads") = 1)
      .def(
          "distance",
          [](const Surface& self, const PointsIn& array, int threads) {
            const std::vector<Vec3> points = to_points(array);
            require_finite(points);
            std::vector<double> distances(points.size());
            for_each_closest(self.bvh(), points, threads,
                             [&](std::size_t i, const Bvh::Hit& hit) { distances[i] = std::sqrt(hit.distance2); });
            return rows<double>(std::move(distances));
          },
          Released(), nb::arg("points"), nb::arg("threads") = 0,
          "Unsigned distances [N] of points [N, 3] to the surface.")
      .def(
          "closest",
          [](const Surface& self, const PointsIn& array, int threads) {
            const std::vector<Vec3> points = to_points(array);
            require_finite(points);
            std::vector<Vec3> closest(points.size());
            std::vector<std::int32_t> faces(points.size());
            for_each_closest(self.bvh(), points, threads, [&](std::size_t i, const Bvh::Hit& hit) {
              closest[i] = hit.point;
              faces[i] = self.bvh().face(hit.slot);
            });
            return std::tuple(rows<double>(std::move(closest)), rows<std::int32_t>(std::move(faces)));
          },
          Released(), nb::arg("points"), nb::arg("threads") = 0,
          "Closest points of the surface [N, 3] to points [N, 3], and the faces [N] they lie on.")
      .def(
          "winding",
          [](const Surface& self, const PointsIn& array, double accuracy, int threads, bool is_closed) {
            const std::vector<Vec3> points = to_points(array);
            require_finite(points);
            if (!(accuracy >= 1)) throw std::invalid_argument("the accuracy must be at least 1");
            std::vector<double> windings(points.size());
            const Winding& winding = self.winding();
            for_each_point(points.size(), threads, [&](std::size_t i) {
              windings[i] = is_closed ? winding.of_closed(points[i]) : winding.at(points[i], accuracy);
            });
            return rows<double>(std::move(windings));
          },
          Released(), nb::arg("points"), nb::arg("accuracy") = 2.0, nb::arg("threads") = 0,
          nb::arg("is_closed") = false,
          "Generalised winding numbers [N] of points [N, 3].\n\n"
          "Groups of triangles farther than `accuracy` times their radius are expanded to second order: with the\n"
          "default 2 errors up to 0.03 were seen close to real surfaces, with 4 up to 0.01; infinity is exact.\n"
          "Around a closed surface they are whole numbers, and quicker to find.");

  m.def(
      "sample_surface",
      [](const PointsIn& vertices, const FacesIn& faces, std::size_t count, std::uint64_t seed) {
        SurfaceSamples samples = sample_surface(to_finite_mesh(vertices, faces), count, seed);
        return std::tuple(rows<double>(std::move(samples.points)), rows<std::int32_t>(std::move(samples.faces)));
      },
      Released(), nb::arg("vertices"), nb::arg("faces"), nb::arg("count"), nb::arg("seed"),
      "Points [count, 3] spread evenly by area over a surface, and their faces [count]; the same bits for a seed.");

  m.def(
      "directed_hausdorff",
      [](const PointsIn& vertices, const FacesIn& faces, const Surface& surface, double tolerance, int threads) {
        const Mesh mesh = to_finite_mesh(vertices, faces);
        require_positive_tolerance(tolerance);
        Interval found = directed_hausdorff(mesh, surface.bvh(), tolerance, threads);
        return std::tuple(found.lower, found.upper);
      },
      Released(), nb::arg("vertices"), nb::arg("faces"), nb::arg("surface"), nb::arg("tolerance"),
      nb::arg("threads") = 0,
      "(lower, upper) around the greatest distance from a point of the mesh's faces to the surface;\n"
      "upper - lower <= tolerance.");

  m.def(
      "crossings",
      [](const PointsIn& vertices, const FacesIn& faces, const LabelsIn& array, std::int64_t most) {
        const Mesh mesh = to_finite_mesh(vertices, faces);
        if (array.shape(0) != mesh.faces.size()) throw std::invalid_argument("one body for every face");
        const std::vector<std::int64_t> body(array.data(), array.data() + array.shape(0));
        const Crossings found = mesh.faces.empty() ? Crossings() : crossings(mesh, body, most);
        return std::tuple(found.pairs, found.corners);
      },
      Released(), nb::arg("vertices"), nb::arg("faces"), nb::arg("body"), nb::arg("most"),
      "How many pairs of faces of different bodies [F] touch, and a bound on the corners of their arrangement.\n"
      "Stops to count once there are more than `most` pairs.");

  m.def(
      "apart_points",
      [](const Surface& surface, const PointsIn& array, double reach, std::size_t enough) {
        const std::vector<Vec3> points = to_points(array);
        require_finite(points);
        if (!(reach > 0)) throw std::invalid_argument("the reach must be positive");
        return rows<std::int32_t>(apart_points(surface, points, reach, enough));
      },
      Released(), nb::arg("surface"), nb::arg("points"), nb::arg("reach"), nb::arg("enough"),
      "Indices [K] of points [N, 3] of a closed solid of which no two can lie in one convex set whose surface stays\n"
      "within `reach` of the solid; the search ends when `enough` are found.");
}

}  // namespace rlacd
