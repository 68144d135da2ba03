// Python bindings of the convex hull and of mesh volume and area.
#include <nanobind/stl/optional.h>
#include <nanobind/stl/vector.h>

#include <cmath>
#include <stdexcept>

#include "base/arrays.hpp"
#include "base/mesh_measures.hpp"
#include "base/parallel.hpp"
#include "distance/filling.hpp"
#include "hull/hull.hpp"
#include "hull/inscribed_ball.hpp"

namespace rlacd {

namespace {

constexpr std::size_t kPairsAThread = 8;  // starting a thread takes as long as a few joint hulls of small parts

// The predicates are undefined for infinity and NaN.
void require_numbers(const std::vector<Vec3>& points) {
  for (const Vec3& p : points)
    if (!std::isfinite(p.x) || !std::isfinite(p.y) || !std::isfinite(p.z))
      throw std::invalid_argument("points must be finite");
}

}  // namespace

void bind_hull(nb::module_& m) {
  m.def(
      "convex_hull",
      [](const PointsIn& array) {
        const std::vector<Vec3> points = to_points(array);
        require_numbers(points);
        Hull hull = convex_hull(points);
        return std::tuple(rows<std::int32_t>(std::move(hull.indices)), rows<std::int32_t>(std::move(hull.faces)),
                          hull.rank);
      },
      Released(), nb::arg("points"),
      "Convex hull of points [N, 3]: (indices [H] into points, faces [F, 3] into those H points, rank).\n\n"
      "Every index is an extreme point, the facets are exactly convex (no rounding in the decisions) and outward\n"
      "oriented. rank < 3 (all points coplanar): no indices, no faces.");
  m.def(
      "joint_hull",
      [](const std::vector<PointsIn>& groups) {
        std::vector<Vec3> points;
        for (const PointsIn& group : groups) {
          const std::vector<Vec3> own = to_points(group);
          points.insert(points.end(), own.begin(), own.end());
        }
        require_numbers(points);
        Mesh hull = hull_mesh(points);
        using Out = std::tuple<Rows<double, Vec3>, Rows<std::int32_t, Triangle>, double>;
        if (hull.faces.empty()) return std::optional<Out>();
        const double volume = mesh_volume(hull.vertices, hull.faces);
        return std::optional<Out>(
            {rows<double>(std::move(hull.vertices)), rows<std::int32_t>(std::move(hull.faces)), volume});
      },
      Released(), nb::arg("groups"),
      "Corners [H, 3], faces [F, 3] and volume of the convex hull of several arrays of points [N, 3]; None if all lie\n"
      "in a plane.");
  m.def(
      "holds_ball",
      [](const PointsIn& vertices, const FacesIn& faces, double radius) {
        const Mesh hull = to_finite_mesh(vertices, faces);
        return holds_ball(hull, radius);
      },
      Released(), nb::arg("vertices"), nb::arg("faces"), nb::arg("radius"),
      "Whether a ball of this radius fits into a convex hull.");
  m.def(
      "joint_hull_volumes",
      [](const std::vector<const HullCorners*>& groups, const PairsIn& pairs, int threads) {
        const std::vector<std::int32_t> pair = to_numbers(pairs, groups.size());
        std::vector<double> volumes(pairs.shape(0));
        const auto worth_threads = static_cast<int>(1 + volumes.size() / kPairsAThread);
        parallel_for(volumes.size(), std::min(resolve_threads(threads), worth_threads), [&](std::size_t i) {
          HullBuilder hull;
          std::vector<Vec3> both = groups[pair[2 * i]]->all;
          const std::vector<Vec3>& other = groups[pair[2 * i + 1]]->all;
          both.insert(both.end(), other.begin(), other.end());
          hull.add(both);
          volumes[i] = hull.volume();
        });
        return rows<double>(std::move(volumes));
      },
      Released(), nb::arg("hulls"), nb::arg("pairs"), nb::arg("threads") = 0,
      "Volumes [P] of the joint hulls of pairs [P, 2] of hulls.");
  m.def(
      "mesh_volume",
      [](const PointsIn& v, const FacesIn& f) {
        const Mesh mesh = to_mesh(v, f);
        return mesh_volume(mesh.vertices, mesh.faces);
      },
      nb::arg("vertices"), nb::arg("faces"), "Signed volume of a closed triangle mesh.");
  m.def(
      "principal_axes",
      [](const PointsIn& vertices, const FacesIn& faces) {
        const Mesh mesh = to_mesh(vertices, faces);
        const std::array<Vec3, 3> axes = principal_axes(mesh.vertices, mesh.faces);
        return rows<double>(std::vector<Vec3>(axes.begin(), axes.end()));
      },
      Released(), nb::arg("vertices"), nb::arg("faces"),
      "Principal axes [3, 3] of a surface, one per row, longest first, the largest entry of each positive.");
  m.def(
      "mesh_mass",
      [](const PointsIn& vertices, const FacesIn& faces) {
        const Mesh mesh = to_mesh(vertices, faces);
        const Mass mass = mesh_mass(mesh.vertices, mesh.faces);
        const auto& inertia = mass.inertia;
        return std::tuple(mass.volume, rows<double>(std::vector<double>{mass.centre.x, mass.centre.y, mass.centre.z}),
                          rows<double>(std::vector<Vec3>(inertia.begin(), inertia.end())));
      },
      Released(), nb::arg("vertices"), nb::arg("faces"),
      "Volume, centre of mass [3], and inertia about it [3, 3] of the solid of density one in a closed mesh.");
  m.def(
      "mesh_area",
      [](const PointsIn& v, const FacesIn& f) {
        const Mesh mesh = to_mesh(v, f);
        return mesh_area(mesh.vertices, mesh.faces);
      },
      nb::arg("vertices"), nb::arg("faces"), "Area of a triangle mesh.");
}

}  // namespace rlacd
