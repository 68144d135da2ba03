// Seeded points on a surface, spread evenly by area.
//
// In:  a triangle mesh, a number of points, a seed.
// Out: the points and the face of each; each is uniform over the surface, together they are more even than independent
//      draws: a region with a share s of the area gets s * count points, give or take about one.
// How: point i lies at a random place in the i-th of `count` equal stretches of accumulated area (stratified), and at a
//      place in its triangle taken from the two-dimensional additive recurrence of the plastic number, randomly
//      shifted, so that neighbours in one triangle keep apart. The only generator is a counter put through SplitMix64,
//      and the only operations are IEEE-exact: the same bits everywhere.
#pragma once

#include <cstdint>
#include <vector>

#include "base/geometry.hpp"

namespace rlacd {

struct SurfaceSamples {
  std::vector<Vec3> points;
  std::vector<std::int32_t> faces;
};

SurfaceSamples sample_surface(const Mesh& mesh, std::size_t count, std::uint64_t seed);

}  // namespace rlacd
