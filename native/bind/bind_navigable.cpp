// Python bindings of the navigable space: its balls, and hulls against balls.
#include "bind/released.hpp"
#include "decompose/spread_balls.hpp"

namespace rlacd {

auto parts(Balls& own) { return std::tie(own.centres, own.radii); }

void bind_navigable(nb::module_& m) {
  m.def(
      "navigable_balls",
      released([](const Surface& surface, const ConvexBody& hull, double radius, double tolerance, bool reachable_only,
                  const std::optional<PointsIn>& seeds, const std::vector<HalfSpace>& closed, double pitch,
                  int threads) {
        require(radius > 0 && tolerance > 0 && pitch > 0, "radius, tolerance and pitch must be positive");
        const BallSources sources = {reachable_only, !seeds, seeds ? to_points(*seeds) : std::vector<Vec3>()};
        return spread_balls(surface, {surface.bvh(), hull, closed, radius, tolerance}, sources, pitch, threads);
      }),
      "surface"_a, "hull"_a, "radius"_a, "tolerance"_a, "reachable_only"_a, "seeds"_a.none(), "closed"_a, "pitch"_a,
      "threads"_a = 0,
      "Balls (centres [B, 3], radii [B]) that stand for the navigable space around a closed surface with this hull.\n\n"
      "Balls come from the seeds [S, 3], or from outside where there are none; closed [P, 4] are half-spaces (unit "
      "normal n, offset d) with n.x < d that they keep out of; pitch is the grid's.");

  nb::class_<Balls>(m, "BallSet", "Balls to be tested against convex hulls.")
      .def("__init__", released([](Balls* self, const std::vector<Vec3>& centres, const VectorIn<double>& radii) {
             require(centres.size() == radii.size(), "there must be as many radii as centres");
             new (self) Balls{centres, copied<double>(radii)};
           }),
           "centres"_a, "radii"_a)
      .def("intrusions",
           released([](const Balls& self, const ConvexBody& hull,
                       const std::optional<VectorIn<std::int32_t>>& candidates, double least, bool first) {
             std::vector<std::int32_t> among;
             if (candidates) among = to_numbers(*candidates, self.centres.size());
             return intrusions(hull, self, candidates ? &among : nullptr, least, first);
           }),
           "hull"_a, "candidates"_a.none(), "least"_a, "first"_a = false,
           "Which of the candidates (None: of all balls) a convex hull reaches deeper than `least` into: (balls [K], "
           "depths [K]), in the order of the candidates. A depth is the ball's radius less the signed distance of its "
           "centre from the hull. With `first` it ends at the first.");
}

}  // namespace rlacd
