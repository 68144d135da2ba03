// Python bindings of the convex hull and of mesh volume and area.
#include "arrays.hpp"
#include "hull.hpp"
#include "parallel.hpp"

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
      "joint_hull_volumes",
      [](const PointsIn& array,
         const nb::ndarray<const std::int32_t, nb::ndim<1>, nb::c_contig, nb::device::cpu>& starts,
         const nb::ndarray<const std::int32_t, nb::shape<-1, 2>, nb::c_contig, nb::device::cpu>& pairs, int threads) {
        const std::vector<Vec3> points = to_points(array);
        const std::vector<std::int32_t> start(starts.data(), starts.data() + starts.size());
        const auto groups = static_cast<std::int32_t>(start.size()) - 1;
        for (std::int32_t g = 0; g < groups; ++g)
          if (start[g] < 0 || start[g] > start[g + 1]) throw std::invalid_argument("starts must ascend from 0");
        if (groups < 0 || start.back() > static_cast<std::int32_t>(points.size()))
          throw std::invalid_argument("starts must end at the number of points");
        const std::size_t count = pairs.shape(0);
        for (std::size_t i = 0; i < pairs.size(); ++i)
          if (pairs.data()[i] < 0 || pairs.data()[i] >= groups) throw std::invalid_argument("pair out of range");
        const std::vector<std::int32_t> pair(pairs.data(), pairs.data() + pairs.size());
        std::vector<double> volumes(count);
        {
          nb::gil_scoped_release release;
          parallel_for(count, threads, [&](std::size_t i) {
            HullBuilder hull;
            std::vector<Vec3> both;
            for (const std::int32_t g : {pair[2 * i], pair[2 * i + 1]})
              both.insert(both.end(), points.begin() + start[g], points.begin() + start[g + 1]);
            hull.add(both);
            volumes[i] = hull.volume();
          });
        }
        return to_array<double>(std::move(volumes));
      },
      nb::arg("points"), nb::arg("starts"), nb::arg("pairs"), nb::arg("threads") = 0,
      "Volumes [P] of the joint hulls of pairs [P, 2] of point groups; group g is points[starts[g]:starts[g + 1]].");
  m.def(
      "mesh_volume", [](const PointsIn& v, const FacesIn& f) { return mesh_volume(to_points(v), to_mesh(v, f).faces); },
      nb::arg("vertices"), nb::arg("faces"), "Signed volume of a closed triangle mesh.");
  m.def(
      "mesh_area", [](const PointsIn& v, const FacesIn& f) { return mesh_area(to_points(v), to_mesh(v, f).faces); },
      nb::arg("vertices"), nb::arg("faces"), "Area of a triangle mesh.");
}

}  // namespace rlacd
