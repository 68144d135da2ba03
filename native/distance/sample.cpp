#include "distance/sample.hpp"

#include <stdexcept>

namespace rlacd {
namespace {

// Uniform in [0, 1), a function of the seed and the counter alone (Steele, Lea, Flood: SplitMix64, 2014).
double uniform(std::uint64_t seed, std::uint64_t counter) {
  std::uint64_t z = seed + (counter + 1) * 0x9e3779b97f4a7c15u;
  z = (z ^ (z >> 30)) * 0xbf58476d1ce4e5b9u;
  z = (z ^ (z >> 27)) * 0x94d049bb133111ebu;
  z ^= z >> 31;
  return static_cast<double>(z >> 11) * 0x1p-53;
}

double fraction(double x) { return x - std::floor(x); }

// 1 / g and 1 / g^2 for the plastic number g, the real root of g^3 = g + 1.
constexpr double kStepU = 0.7548776662466927, kStepV = 0.5698402909980532;

}  // namespace

SurfaceSamples sample_surface(const Mesh& mesh, std::size_t count, std::uint64_t seed) {
  std::vector<double> area_up_to(mesh.faces.size());
  double area = 0;
  for (std::size_t f = 0; f < mesh.faces.size(); ++f) {
    area += norm(long_normal(mesh, mesh.faces[f]));
    area_up_to[f] = area;
  }
  SurfaceSamples samples;
  if (count == 0) return samples;
  if (!(area > 0)) throw std::invalid_argument("the surface has no area to sample");

  samples.points.resize(count);
  samples.faces.resize(count);
  const double shift_u = uniform(seed, 0), shift_v = uniform(seed, 1);
  std::size_t f = 0;
  for (std::size_t i = 0; i < count; ++i) {
    const double along = (static_cast<double>(i) + uniform(seed, i + 2)) / static_cast<double>(count) * area;
    // Rounding can put the last position at the very end; faces of zero area are never the first to reach beyond it.
    while (f + 1 < area_up_to.size() && area_up_to[f] <= along) ++f;
    while (area_up_to[f] <= (f > 0 ? area_up_to[f - 1] : 0.0)) --f;
    const double step = static_cast<double>(i + 1);
    double u = fraction(shift_u + step * kStepU), v = fraction(shift_v + step * kStepV);
    if (u + v > 1) u = 1 - u, v = 1 - v;
    const auto [a, b, c] = corners_of(mesh, mesh.faces[f]);
    samples.points[i] = a + u * (b - a) + v * (c - a);
    samples.faces[i] = static_cast<std::int32_t>(f);
  }
  return samples;
}

}  // namespace rlacd
