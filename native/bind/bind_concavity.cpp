// Python bindings of the concavity of a part.
#include <nanobind/stl/vector.h>

#include "base/arrays.hpp"
#include "base/parallel.hpp"
#include "distance/concavity.hpp"
#include "distance/filling.hpp"

namespace rlacd {

void bind_concavity(nb::module_& m) {
  nb::class_<TreeCache>(m, "TreeCache", "The tree of one part's surface, made by the first test that needs it.")
      .def(nb::init<>());
  m.def(
      "meets_concavity",
      [](const PointsIn& part_vertices, const FacesIn& part_faces, const PointsIn& hull_vertices,
         const FacesIn& hull_faces, double part_volume, double hull_volume, double threshold, const TreeCache* tree) {
        const Mesh part = to_finite_mesh(part_vertices, part_faces), hull = to_finite_mesh(hull_vertices, hull_faces);
        const TreeCache own;
        return meets_concavity(part, hull, part_volume, hull_volume, threshold, tree ? *tree : own);
      },
      Released(), nb::arg("part_vertices"), nb::arg("part_faces"), nb::arg("hull_vertices"), nb::arg("hull_faces"),
      nb::arg("part_volume"), nb::arg("hull_volume"), nb::arg("threshold"), nb::arg("tree") = nb::none(),
      "Whether the concavity of a closed part with this hull is certainly <= threshold.\n\n"
      "False when it is larger, or so close (0.1 %) that branch and bound gave up. The hull must hold the part.\n"
      "`tree` is that of the part's surface; without it, one is made and forgotten.");
  m.def(
      "concavity",
      [](const PointsIn& part_vertices, const FacesIn& part_faces, const PointsIn& hull_vertices,
         const FacesIn& hull_faces, double part_volume, double hull_volume, double tolerance, double floor,
         const TreeCache* tree) {
        const Mesh part = to_finite_mesh(part_vertices, part_faces), hull = to_finite_mesh(hull_vertices, hull_faces);
        if (!(tolerance > 0)) throw std::invalid_argument("the tolerance must be positive");
        const TreeCache own;
        const Concavity c = concavity(part, hull, part_volume, hull_volume, tolerance, floor, tree ? *tree : own);
        const auto pair = [](const Interval& i) { return std::tuple(i.lower, i.upper); };
        return std::tuple(pair(c.value()), pair(c.part_to_hull), pair(c.hull_to_part), c.volume_radius);
      },
      Released(), nb::arg("part_vertices"), nb::arg("part_faces"), nb::arg("hull_vertices"), nb::arg("hull_faces"),
      nb::arg("part_volume"), nb::arg("hull_volume"), nb::arg("tolerance"), nb::arg("floor") = 0.0,
      nb::arg("tree") = nb::none(),
      "Concavity of a closed part with this hull: (value, part_to_hull, hull_to_part, volume_radius).\n\n"
      "The first three are certified intervals (lower, upper). The value's is at most `tolerance` wide; that of a\n"
      "one-sided distance may be wider below the value, where the others decide it. Values up to `floor` need not be "
      "told\n"
      "apart: the interval may then be as wide as (0, floor), which is much faster for nearly convex parts.");
  nb::class_<HullCorners>(m, "HullCorners", "The corners of a convex hull, prepared for tests of joint hulls.")
      .def(
          "__init__",
          [](HullCorners* self, const PointsIn& corners) {
            std::vector<Vec3> points = to_points(corners);
            require_finite(points);
            new (self) HullCorners(std::move(points));
          },
          nb::arg("corners"))
      .def("__len__", [](const HullCorners& self) { return self.all.size(); })
      .def_prop_ro(
          "box",
          [](const HullCorners& self) { return to_array<double>(std::vector<Vec3>{self.box.lower, self.box.upper}); },
          nb::rv_policy::move, "Lower and upper corner of the bounding box [2, 3].");
  nb::class_<Filling>(m, "Filling", "A closed solid that hulls of its parts are held against.")
      .def(
          "__init__",
          [](Filling* self, const PointsIn& vertices, const FacesIn& faces, int threads) {
            const Mesh solid = to_finite_mesh(vertices, faces);
            if (solid.faces.empty()) throw std::invalid_argument("the solid has no faces");
            new (self) Filling(solid, threads);
          },
          Released(), nb::arg("vertices"), nb::arg("faces"), nb::arg("threads") = 1)
      .def_prop_ro("surface", &Filling::surface, nb::rv_policy::reference_internal, "The solid's surface.")
      .def(
          "feasibility",
          [](const Filling& self, const PointsIn& hull_vertices, const FacesIn& hull_faces, double threshold) {
            return static_cast<int>(self.feasibility(to_finite_mesh(hull_vertices, hull_faces), threshold));
          },
          Released(), nb::arg("hull_vertices"), nb::arg("hull_faces"), nb::arg("threshold"),
          "Whether the surfaces of a hull and of the solid's share of it may be as near as the threshold.\n\n"
          "0: they may; 1: they are not; 2: nor are those of any hull that holds this one.")
      .def(
          "joint_feasibilities",
          [](const Filling& self, const std::vector<const HullCorners*>& hulls, const PairsIn& pairs, double threshold,
             int threads) {
            const std::vector<std::int32_t> pair = to_numbers(pairs, hulls.size());
            std::vector<double> volumes(pairs.shape(0));
            std::vector<std::int32_t> verdicts(pairs.shape(0));
            parallel_for(volumes.size(), resolve_threads(threads), [&](std::size_t i) {
              const Filling::Joint joint =
                  self.joint_feasibility(*hulls[pair[2 * i]], *hulls[pair[2 * i + 1]], threshold);
              volumes[i] = joint.volume;
              verdicts[i] = static_cast<std::int32_t>(joint.feasibility);
            });
            return std::tuple(rows<double>(std::move(volumes)), rows<std::int32_t>(std::move(verdicts)));
          },
          Released(), nb::arg("hulls"), nb::arg("pairs"), nb::arg("threshold"), nb::arg("threads") = 0,
          "Volumes [P] of the joint hulls of pairs [P, 2] of hulls, and the `feasibility` [P] of each, decided less\n"
          "thoroughly than for a single hull, where the hulls themselves are close enough to their shares of the "
          "solid.\n"
          "There is no volume (0) where it is 2.")
      .def(
          "comes_deeper",
          [](const Filling& self, const PointsIn& hull_vertices, const FacesIn& hull_faces, double threshold) {
            return self.comes_deeper(to_finite_mesh(hull_vertices, hull_faces), threshold);
          },
          Released(), nb::arg("hull_vertices"), nb::arg("hull_faces"), nb::arg("threshold"),
          "Whether the solid's surface comes deeper than the threshold inside a hull: `feasibility` is 2.")
      .def(
          "clipped",
          [](const Filling& self, const PointsIn& hull_vertices, const FacesIn& hull_faces) {
            ClippedSolid clip = self.clipped(to_finite_mesh(hull_vertices, hull_faces));
            return std::tuple(rows<double>(std::move(clip.mesh.vertices)),
                              rows<std::int32_t>(std::move(clip.mesh.faces)), clip.volume,
                              new TreeCache(std::move(clip.shape)));
          },
          Released(), nb::arg("hull_vertices"), nb::arg("hull_faces"),
          "The solid clipped to a convex hull and closed by caps on the hull's facets: vertices [V, 3], faces [F, 3],\n"
          "volume, and what makes the tree of that surface.")
      .def(
          "grown",
          [](const Filling& self, const PointsIn& hull_vertices, const FacesIn& hull_faces, double depth) {
            std::vector<std::array<double, 4>> spaces;
            for (const auto& [n, d] : self.grown(to_finite_mesh(hull_vertices, hull_faces), depth))
              spaces.push_back({n.x, n.y, n.z, d});
            return rows<double>(std::move(spaces));
          },
          Released(), nb::arg("hull_vertices"), nb::arg("hull_faces"), nb::arg("depth"),
          "Half-spaces n.x <= d that hold a hull, rows of n and d [P, 4]: their intersection has grown until the\n"
          "solid's surface stops it, which may come as deep as `depth` into it.")
      .def(
          "uncovered",
          [](const Filling& self, const std::vector<PointsIn>& vertices, const std::vector<FacesIn>& faces,
             double reach, double grain, int threads) {
            if (vertices.empty()) throw std::invalid_argument("there are no hulls");
            if (!(grain > 0)) throw std::invalid_argument("the grain must be positive");
            std::vector<std::vector<Vec3>> points =
                self.uncovered(to_finite_meshes(vertices, faces), reach, grain, threads);
            std::vector<Rows<double, Vec3>> result;
            for (std::vector<Vec3>& own : points) result.push_back(rows<double>(std::move(own)));
            return result;
          },
          Released(), nb::arg("vertices"), nb::arg("faces"), nb::arg("reach"), nb::arg("grain"), nb::arg("threads") = 0,
          "Points [N, 3] that each convex hull has to take in, so that together they cover the solid's surface.\n\n"
          "Hulls grow by at most `grain` more than they must. Hulls farther than `reach` from a face are only looked "
          "at\n"
          "if all are.");
}

}  // namespace rlacd
