#include "mesh/spread_points.hpp"

#include "base/stop.hpp"

namespace rlacd {
namespace {

constexpr int kMostSteps = 768;
constexpr std::size_t kBetweenPolls = 256;

// Rounded up to 1, 2, 3, 4, 6, 8, 12, 16, ...
int steps(double length, double spacing) {
  int count = 1;
  while (count < length / spacing && count < kMostSteps)
    count = count == 1 ? 2 : (count & (count - 1)) == 0 ? count / 2 * 3 : count / 3 * 4;
  return count;
}

}  // namespace

SpreadPoints spread_points(const Mesh& mesh, double spacing) {
  SpreadPoints spread;
  for (std::size_t f = 0; f < mesh.faces.size(); ++f) {
    if (f % kBetweenPolls == 0) poll_stop();
    // From a to b along the longest edge; rows are parallel to it.
    Vec3 a, b, c;
    double longest2 = -1;
    for (int corner = 0; corner < 3; ++corner) {
      const Vec3 p = mesh.vertices[mesh.faces[f][corner]], q = mesh.vertices[mesh.faces[f][(corner + 1) % 3]];
      if (norm2(q - p) <= longest2) continue;
      longest2 = norm2(q - p);
      a = p, b = q, c = mesh.vertices[mesh.faces[f][(corner + 2) % 3]];
    }
    const double base = std::sqrt(longest2);
    const double height = norm(cross(b - a, c - a)) / std::max(base, std::numeric_limits<double>::min());
    const int columns = steps(base, spacing), rows = steps(height, spacing);
    for (int row = 0; row < rows; ++row) {
      const double v = static_cast<double>(row) / rows;
      const Vec3 start = (1 - v) * a + v * c, end = (1 - v) * b + v * c;
      for (int column = 0; column <= columns; ++column) {
        const double u = static_cast<double>(column) / columns;
        spread.points.push_back((1 - u) * start + u * end);
      }
    }
    spread.points.push_back(c);
    spread.faces.resize(spread.points.size(), static_cast<std::int32_t>(f));
  }
  return spread;
}

}  // namespace rlacd
