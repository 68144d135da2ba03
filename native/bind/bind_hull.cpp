// Python bindings of convex hulls: built, joined, simplified, and in contact.
#include <cmath>

#include "bind/released.hpp"
#include "convex/flush.hpp"
#include "convex/hull.hpp"
#include "convex/simplify_hull.hpp"
#include "core/mesh_measures.hpp"
#include "core/parallel.hpp"

namespace rlacd {

auto parts(Hull& own) { return std::tie(own.indices, own.faces, own.rank); }
auto parts(Contact& own) { return std::tie(own.sides, own.places); }

namespace {

// The predicates are undefined for infinity and NaN.
std::vector<Vec3> to_numbers_only(const std::vector<PointsIn>& groups) {
  std::vector<Vec3> points;
  for (const PointsIn& group : groups)
    for (const Vec3 p : copied<Vec3>(group)) {
      require(std::isfinite(p.x) && std::isfinite(p.y) && std::isfinite(p.z), "points must be finite");
      points.push_back(p);
    }
  return points;
}

std::vector<double> joint_hull_volumes(const std::vector<const ConvexBody*>& hulls, const PairsIn& pairs, int threads) {
  const std::vector<std::int32_t> pair = to_numbers(pairs, hulls.size());
  std::vector<double> volumes(pairs.shape(0));
  const auto measure = [&](std::size_t i) {
    HullBuilder hull;
    hull.add(joined(hulls[pair[2 * i]]->mesh().vertices, hulls[pair[2 * i + 1]]->mesh().vertices));
    volumes[i] = hull.volume();
  };
  parallel_for(volumes.size(), threads, measure, kSlower);
  return volumes;
}

// Nothing if the hull is flat.
std::optional<std::tuple<std::vector<Vec3>, std::vector<Triangle>, double>> with_volume(Mesh hull) {
  if (hull.faces.empty()) return std::nullopt;
  const double volume = mesh_volume(hull);
  return std::tuple(std::move(hull.vertices), std::move(hull.faces), volume);
}

void require_depth(double depth, double touch) {
  require(depth > 0 && std::isfinite(depth), "the depth must be positive");
  require(touch >= 0, "the gap of a touch must not be negative");
}

}  // namespace

void bind_hull(nb::module_& m) {
  m.def("convex_hull", released([](const PointsIn& points) { return convex_hull(to_numbers_only({points})); }),
        "points"_a,
        "Convex hull of points [N, 3]: (indices [H] into points, faces [F, 3] into those H points, rank).\n\n"
        "Every index is an extreme point, the facets are exactly convex (no rounding in the decisions) and outward "
        "oriented. rank < 3 (all points coplanar): no indices, no faces.");
  m.def(
      "joint_hull",
      released([](const std::vector<PointsIn>& groups) { return with_volume(hull_mesh(to_numbers_only(groups))); }),
      "groups"_a,
      "Corners [H, 3], faces [F, 3] and volume of the convex hull of several arrays of points [N, 3]; None if all lie "
      "in a plane.");
  m.def("cut_back", released([](Mesh hull, const std::vector<HalfSpace>& spaces) {
          const auto is_beyond = [&](const HalfSpace& space) {
            return std::any_of(hull.vertices.begin(), hull.vertices.end(), [&](Vec3 p) { return space.depth(p) < 0; });
          };
          bool is_cut = false;
          for (const HalfSpace& space : spaces)
            if (Mesh rest; is_beyond(space) && !(rest = hull_below(hull, space)).faces.empty())
              hull = std::move(rest), is_cut = true;
          return is_cut ? with_volume(std::move(hull)) : std::nullopt;
        }),
        "vertices"_a, "faces"_a, "spaces"_a,
        "Corners [H, 3], faces [F, 3] and volume of what of a convex hull lies in half-spaces n.x <= d, rows of n and "
        "d [P, 4], but for those that would leave it flat; None if nothing of it is outside.");
  m.def("holds_ball", released(holds_ball), "vertices"_a, "faces"_a, "radius"_a,
        "Whether a ball of this radius fits into a convex hull.");
  m.def("joint_hull_volumes", released(joint_hull_volumes), "hulls"_a, "pairs"_a, "threads"_a = 0,
        "Volumes [P] of the joint hulls of pairs [P, 2] of hulls.");
  m.def("simplify_hull",
        released([](const ConvexBody& hull, std::size_t max_vertices, std::size_t max_faces, double tolerance,
                    const std::vector<HalfSpace>& bounds, double enough) {
          require(tolerance >= 0, "the tolerance must not be negative");
          require(!hull.mesh().vertices.empty(), "the hull has no vertices");
          std::vector<Above> above;
          for (const HalfSpace& space : bounds) above.push_back({-space.normal, -space.offset});
          return simplify_hull(hull, max_vertices, max_faces, tolerance, above, enough);
        }),
        "hull"_a, "max_vertices"_a, "max_faces"_a, "tolerance"_a, "bounds"_a, "enough"_a = kInfinity,
        "A convex hull (vertices [V, 3], faces [F, 3]) around a convex hull with at most max_vertices corners and "
        "max_faces triangles and little added volume; corners that cost no more than `tolerance` of distance go "
        "anyway. It stays in the half-spaces n.x <= d of bounds [P, 4] (unit n, d), unless the limits leave no such "
        "hull. Without any, corners that stick out farther than `enough` are evened out.");

  nb::class_<ConvexBody>(m, "ConvexBody", "A closed convex triangle mesh, prepared for what is asked about it.")
      .def("__init__", released([](ConvexBody* self, const Mesh& mesh) { new (self) ConvexBody(mesh); }), "vertices"_a,
           "faces"_a)
      .def_prop_ro("box",
                   released([](const ConvexBody& self) { return std::array{self.box().lower, self.box().upper}; }),
                   "Lower and upper corner of the bounding box [2, 3].")
      .def("depths", released([](const ConvexBody& self, const std::vector<Vec3>& points) {
             std::vector<double> depths;
             for (const Vec3 point : points) depths.push_back(self.planes().nearest(point).depth);
             return depths;
           }),
           "points"_a, "How deep points [N, 3] lie inside [N]; negative outside.")
      .def("contact", released([](const ConvexBody& self, const ConvexBody& other, double depth, double touch) {
             require_depth(depth, touch);
             return contact(self, other, depth, touch);
           }),
           "other"_a, "depth"_a, "touch"_a,
           "Where a side of another body, turned the other way, lies less deep than `depth` under a side of this one: "
           "(sides [S] of this body, places [N, 3] on the other). Sides touch that are no farther apart than `touch`.")
      .def("layer",
           released([](const ConvexBody& self, const ConvexBody& other, const VectorIn<std::int32_t>& sides,
                       double depth, double touch) {
             require_depth(depth, touch);
             return layer(self, other, to_numbers(sides, self.sides().size()), depth, touch);
           }),
           "other"_a, "sides"_a, "depth"_a, "touch"_a,
           "What another body fills of this one with some of its sides, and those within 60 degrees of them, moved "
           "outwards: points [N, 3] whose hull it is. Planes that it crosses by at most `touch` are left out.");
}

}  // namespace rlacd
