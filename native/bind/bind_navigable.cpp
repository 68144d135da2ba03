// Python bindings of the navigable space: its balls, and hulls against balls.
#include <nanobind/stl/optional.h>

#include <optional>

#include "base/arrays.hpp"
#include "navigable/hull_balls.hpp"
#include "navigable/spread_balls.hpp"

namespace rlacd {
namespace {

struct BallSet {
  std::vector<Vec3> centres;
  std::vector<double> radii;
};

}  // namespace

void bind_navigable(nb::module_& m) {
  m.def(
      "navigable_balls",
      [](const Surface& surface, const PointsIn& hull_vertices, const FacesIn& hull_faces, double radius,
         double tolerance, bool reachable_only, const std::optional<PointsIn>& seeds, const PlanesIn& closed,
         double pitch, int threads) {
        Mesh mesh = to_finite_mesh(hull_vertices, hull_faces);
        if (!(radius > 0) || !(tolerance > 0) || !(pitch > 0))
          throw std::invalid_argument("radius, tolerance and pitch must be positive");
        BallSources sources;
        sources.reachable_only = reachable_only;
        sources.outside = !seeds.has_value();
        if (seeds) sources.seeds = to_points(*seeds);
        require_finite(sources.seeds);
        std::vector<HalfSpace> half_spaces;
        for (std::size_t i = 0; i < closed.shape(0); ++i) {
          const double* row = closed.data() + 4 * i;
          half_spaces.push_back({{row[0], row[1], row[2]}, row[3]});
          require_finite({half_spaces.back().normal});
        }
        const ConvexBody hull(std::move(mesh));
        const NavigableField field(surface.bvh(), hull, std::move(half_spaces), radius, tolerance);
        Balls balls = spread_balls(surface, field, sources, pitch, threads);
        return std::tuple(rows<double>(std::move(balls.centres)), rows<double>(std::move(balls.radii)));
      },
      Released(), nb::arg("surface"), nb::arg("hull_vertices"), nb::arg("hull_faces"), nb::arg("radius"),
      nb::arg("tolerance"), nb::arg("reachable_only"), nb::arg("seeds").none(), nb::arg("closed"), nb::arg("pitch"),
      nb::arg("threads") = 0,
      "Balls (centres [B, 3], radii [B]) that stand for the navigable space around a closed surface with this hull.\n\n"
      "Balls come from the seeds [S, 3], or from outside where there are none; closed [P, 4] are half-spaces\n"
      "(unit normal n, offset d) with n.x < d that they keep out of; pitch is the grid's.");

  nb::class_<BallSet>(m, "BallSet", "Balls to be tested against convex hulls.")
      .def(
          "__init__",
          [](BallSet* self, const PointsIn& centres, const VectorIn& radii) {
            BallSet balls{to_points(centres), std::vector<double>(radii.data(), radii.data() + radii.size())};
            require_finite(balls.centres);
            if (balls.centres.size() != balls.radii.size())
              throw std::invalid_argument("there must be as many radii as centres");
            new (self) BallSet(std::move(balls));
          },
          nb::arg("centres"), nb::arg("radii"))
      .def(
          "intrusions",
          [](const BallSet& self, const PointsIn& vertices, const FacesIn& faces,
             const std::optional<IndicesIn>& candidates, double least, bool first) {
            Mesh mesh = to_finite_mesh(vertices, faces);
            std::vector<std::int32_t> among;
            if (candidates) among = to_numbers(*candidates, self.centres.size());
            std::vector<std::int32_t> balls;
            std::vector<double> depths;
            const ConvexBody hull(std::move(mesh));
            for (const Intrusion& found :
                 intrusions(hull, self.centres, self.radii, candidates ? &among : nullptr, least, first)) {
              balls.push_back(found.ball);
              depths.push_back(found.depth);
            }
            return std::tuple(rows<std::int32_t>(std::move(balls)), rows<double>(std::move(depths)));
          },
          Released(), nb::arg("vertices"), nb::arg("faces"), nb::arg("candidates").none(), nb::arg("least"),
          nb::arg("first") = false,
          "Which of the candidates (None: of all balls) a convex hull reaches deeper than `least` into: (balls [K],\n"
          "depths [K]), in the order of the candidates. A depth is the ball's radius less the signed distance of its\n"
          "centre from the hull. With `first` it ends at the first.");
}

}  // namespace rlacd
