// Python bindings of distances: of points, of hulls from a solid and of their union.
#include <nanobind/stl/shared_ptr.h>

#include "bind/released.hpp"
#include "convex/union_distance.hpp"
#include "core/parallel.hpp"
#include "solid/against.hpp"
#include "solid/apart.hpp"
#include "surface/crossings.hpp"
#include "surface/pushed.hpp"
#include "surface/surface.hpp"

namespace rlacd {

auto parts(Interval& own) { return std::tie(own.lower, own.upper); }
auto parts(Greatest& own) { return std::tie(own.lower, own.upper, own.at); }
auto parts(Against::Fit& own) { return std::tie(own.depth, own.reach); }
auto parts(Pushed& own) { return std::tie(own.best, own.radii, own.ends); }

namespace {

// The closest points of a surface: neighbours in the list are often near each other.
std::vector<Bvh::Hit> closest(const Bvh& bvh, const std::vector<Vec3>& points, int threads) {
  std::vector<Bvh::Hit> hits(points.size());
  const auto find = [&](std::size_t i) { hits[i] = bvh.closest_near(points[i], i % kQuick ? hits[i - 1].slot : -1); };
  parallel_for(points.size(), threads, find, kQuick);
  return hits;
}

void require_positive(double tolerance, double gap = 1) {
  require(tolerance > 0, "the tolerance must be positive");
  require(gap > 0, "the gap must be positive");
}

void bind_surface(nb::module_& m) {
  nb::class_<Surface>(m, "Surface",
                      "A triangle surface and a tree of boxes over it. Any quality: open, self-intersecting, slivers.")
      .def("__init__", released([](Surface* self, const Mesh& mesh, int threads) {
             require(!mesh.faces.empty(), "the surface has no faces");
             new (self) Surface(mesh, threads);
           }),
           "vertices"_a, "faces"_a, "threads"_a = 1)
      .def("distance", released([](const Surface& self, const std::vector<Vec3>& points, int threads) {
             std::vector<double> distances;
             for (const Bvh::Hit& hit : closest(self.bvh(), points, threads))
               distances.push_back(std::sqrt(hit.distance2));
             return distances;
           }),
           "points"_a, "threads"_a = 0, "Unsigned distances [N] of points [N, 3] to the surface.")
      .def("closest", released([](const Surface& self, const std::vector<Vec3>& points, int threads) {
             std::vector<Vec3> at;
             std::vector<std::int32_t> faces;
             for (const Bvh::Hit& hit : closest(self.bvh(), points, threads))
               at.push_back(hit.point), faces.push_back(self.bvh().face(hit.slot));
             return std::pair(std::move(at), std::move(faces));
           }),
           "points"_a, "threads"_a = 0,
           "Closest points of the surface [N, 3] to points [N, 3], and the faces [N] they lie on.")
      .def("between",
           released([](const Surface& self, const std::vector<Vec3>& points, const VectorIn<double>& least,
                       const VectorIn<double>& most, int threads) {
             require(least.size() == points.size() && most.size() == points.size(), "one distance for each point");
             std::vector<std::int32_t> lies(points.size());
             const auto find = [&](std::size_t i) {
               const Bvh::Hit hit = self.bvh().closest(points[i], -1, least.data()[i], most.data()[i]);
               lies[i] = hit.slot >= 0 && hit.distance2 > least.data()[i] * least.data()[i];
             };
             parallel_for(points.size(), threads, find, kQuick);
             return lies;
           }),
           "points"_a, "least"_a, "most"_a, "threads"_a = 0,
           "Whether [N] the distance of each point [N, 3] from the surface lies between two others [N].")
      .def("held_balls",
           released([](const Surface& self, const std::vector<Vec3>& points, const std::vector<Vec3>& normals,
                       double least, double most, int threads) {
             require(normals.size() == points.size(), "one normal for each point");
             return held_balls(self.bvh(), points, normals, least, most, threads);
           }),
           "points"_a, "normals"_a, "least"_a, "most"_a, "threads"_a = 0,
           "Radii [N] of balls of `least` to `most` that touch the surface in points [N, 3], from the side of their "
           "unit normals, and elsewhere at least 60 degrees away; 0 where there is none.")
      .def("pushed",
           released([](const Surface& self, const std::vector<Vec3>& points, const std::vector<Vec3>& against,
                       const VectorIn<double>& steps, int times, double least, int threads) {
             require(steps.size() == points.size() && against.size() == points.size(), "one step for each point");
             return pushed(self.bvh(), points, against, copied<double>(steps), times, least, threads);
           }),
           "points"_a, "against"_a, "steps"_a, "times"_a, "least"_a, "threads"_a = 0,
           "Points [N, 3] pushed `times` times away from the nearest place of the surface, each by its step [N], but "
           "towards it along its unit vector `against` [N, 3], unless that is 0, and no further once they are within "
           "`least`: the places [N, 3] on their ways farthest from the surface, how far [N], and the ends [N, 3].")
      .def(
          "crossing", released([](const Surface& self, const Mesh& mesh, double slack) {
            require(slack >= 0, "the slack must not be negative");
            return crossing(self.bvh(), mesh, slack);
          }),
          "vertices"_a, "faces"_a, "slack"_a,
          "The faces [K] of a mesh that cross the surface, ascending; those that overlap it by no more than `slack` do "
          "not.")
      .def("winding",
           released(
               [](const Surface& self, const std::vector<Vec3>& points, double accuracy, int threads, bool is_closed) {
                 require(accuracy >= 1, "the accuracy must be at least 1");
                 std::vector<double> windings(points.size());
                 const Winding& winding = self.winding();
                 const auto find = [&](std::size_t i) {
                   windings[i] = is_closed ? winding.of_closed(points[i]) : winding.at(points[i], accuracy);
                 };
                 parallel_for(points.size(), threads, find, kQuick);
                 return windings;
               }),
           "points"_a, "accuracy"_a = 2.0, "threads"_a = 0, "is_closed"_a = false,
           "Generalised winding numbers [N] of points [N, 3].\n\n"
           "Groups of triangles farther than `accuracy` times their radius are expanded to second order: with the "
           "default 2 errors up to 0.03 were seen close to real surfaces, with 4 up to 0.01; infinity is exact. Around "
           "a closed surface they are whole numbers, and quicker to find.");
  m.def("apart_points",
        released([](const Surface& surface, const std::vector<Vec3>& points, double reach, std::size_t enough) {
          require(reach > 0, "the reach must be positive");
          return apart_points(surface, points, reach, enough);
        }),
        "surface"_a, "points"_a, "reach"_a, "enough"_a,
        "Indices [K] of points [N, 3] of a closed solid of which no two can lie in one convex set whose surface stays "
        "within `reach` of the solid; the search ends when `enough` are found.");
}

void bind_against(nb::module_& m) {
  nb::class_<Against>(m, "Against", "A closed solid that convex hulls of its parts are held against.")
      .def("__init__", released([](Against* self, const Mesh& solid, int threads) {
             require(!solid.faces.empty(), "the solid has no faces");
             new (self) Against(solid, threads);
           }),
           "vertices"_a, "faces"_a, "threads"_a = 1)
      .def_prop_ro("surface", &Against::surface, nb::rv_policy::reference_internal, "The solid's surface.")
      .def("leads_farther", released(&Against::leads_farther), "hull"_a, "threshold"_a,
           "Whether the hull's surface leads farther than the threshold from the solid; so if undecided (within 0.1%).")
      .def("measure", released([](const Against& self, const ConvexBody& hull, double tolerance, double floor) {
             require_positive(tolerance);
             return self.measure(hull, tolerance, floor);
           }),
           "hull"_a, "tolerance"_a, "floor"_a = 0.0,
           "How deep the solid's surface comes into a hull at most, and how far the hull's surface is from the solid: "
           "(depth, reach), certified intervals (lower, upper).\n\n"
           "That of the larger is at most `tolerance` wide, or ends below `floor`.")
      .def("feasible_volumes",
           released([](const Against& self, const std::vector<const ConvexBody*>& hulls, const PairsIn& pairs,
                       double threshold, int threads) {
             const std::vector<std::int32_t> pair = to_numbers(pairs, hulls.size());
             std::vector<double> volumes(pairs.shape(0));
             parallel_for(volumes.size(), threads, [&](std::size_t i) {
               volumes[i] = self.feasible_volume(*hulls[pair[2 * i]], *hulls[pair[2 * i + 1]], threshold);
             });
             return volumes;
           }),
           "hulls"_a, "pairs"_a, "threshold"_a, "threads"_a = 0,
           "Volumes [P] of the joint hulls of pairs [P, 2] of hulls that meet the threshold, infinite where the joint "
           "hull "
           "certainly does not.")
      .def("comes_deeper", released(&Against::comes_deeper), "hull"_a, "threshold"_a,
           "Whether the solid's surface comes deeper than the threshold inside a hull.")
      .def("filled", released(&Against::filled), "hull"_a, "The volume that the solid fills of a convex hull.")
      .def("inside", released(&Against::inside), "hull"_a,
           "The solid clipped to a convex hull and closed: vertices [V, 3], faces [F, 3]; no faces if it is too "
           "tangled.")
      .def("grown", released(&Against::grown), "hull"_a, "depth"_a,
           "Half-spaces n.x <= d that hold a hull, rows of n and d [P, 4]: their intersection has grown until the "
           "solid's surface stops it, which may come as deep as `depth` into it.")
      .def("uncovered",
           released([](const Against& self, const std::vector<const ConvexBody*>& hulls, double reach, double grain,
                       int threads) {
             require(!hulls.empty(), "there are no hulls");
             require(grain > 0, "the grain must be positive");
             return self.uncovered(hulls, reach, grain, threads);
           }),
           "hulls"_a, "reach"_a, "grain"_a, "threads"_a = 0,
           "Points [N, 3] that each convex hull has to take in, so that together they cover the solid's surface.\n\n"
           "Hulls grow by at most `grain` more than they must. Hulls farther than `reach` from a face are only looked "
           "at if all are.");
}

void bind_union(nb::module_& m) {
  nb::class_<HullUnion>(m, "HullUnion", "The union of convex hulls, each closed, convex and outward oriented.")
      .def(nb::init<std::vector<std::shared_ptr<ConvexBody>>, int>(), nb::call_guard<nb::gil_scoped_release>(),
           "hulls"_a, "threads"_a = 0)
      .def("exposed", released([](const HullUnion& self, double gap, int threads) {
             require_positive(1, gap);
             HullUnion::Exposed found = self.exposed(gap, threads);
             append(found.exposed, found.unresolved);
             return std::move(found.exposed);
           }),
           "gap"_a = 1e-6, "threads"_a = 0,
           "Surface of the union as triangles (vertices [V, 3], faces [F, 3]); touching facets are no part of it.")
      .def("over",
           released([](const HullUnion& self, const Surface& surface, double tolerance, double gap, int threads,
                       double floor) {
             require_positive(tolerance, gap);
             return self.over(surface.bvh(), {tolerance, floor}, gap, threads);
           }),
           "surface"_a, "tolerance"_a, "gap"_a = 1e-6, "threads"_a = 0, "floor"_a = 0.0,
           "(lower, upper, place) of the greatest distance from the union's surface to the given surface.\n\n"
           "The interval is at most `tolerance` wide, or ends below `floor`.")
      .def("under", released([](const HullUnion& self, const Mesh& mesh, double tolerance, int threads, double floor) {
             require_positive(tolerance);
             return self.under(mesh, {tolerance, floor}, threads);
           }),
           "vertices"_a, "faces"_a, "tolerance"_a, "threads"_a = 0, "floor"_a = 0.0,
           "(lower, upper, place) of the greatest distance from the mesh's faces to the union as a solid, 0 inside; as "
           "narrow as that of `over`.")
      .def("distance", released([](const HullUnion& self, const std::vector<Vec3>& points, int threads) {
             std::vector<double> distances(points.size());
             parallel_for(
                 points.size(), threads, [&](std::size_t i) { distances[i] = self.distance(points[i]); }, kQuick);
             return distances;
           }),
           "points"_a, "threads"_a = 0, "Distances [N] of points [N, 3] to the solid, 0 inside a hull.");
}

}  // namespace

void bind_distance(nb::module_& m) {
  bind_surface(m);
  bind_against(m);
  bind_union(m);
}

}  // namespace rlacd
