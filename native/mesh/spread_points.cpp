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

// Calls take(point) for all points of one face.
template <class Take>
void spread_over(const Mesh& mesh, const Triangle& face, double spacing, bool corners_suffice, const Take& take) {
  // From a to b along the longest edge; rows are parallel to it.
  Vec3 a, b, c;
  double longest2 = -1;
  for (int corner = 0; corner < 3; ++corner) {
    const Vec3 p = mesh.vertices[face[corner]], q = mesh.vertices[face[(corner + 1) % 3]];
    if (norm2(q - p) <= longest2) continue;
    longest2 = norm2(q - p);
    a = p, b = q, c = mesh.vertices[face[(corner + 2) % 3]];
  }
  const double base = std::sqrt(longest2);
  if (corners_suffice && base <= spacing) {
    for (const std::int32_t corner : face) take(mesh.vertices[corner]);
    return;
  }
  const double height = norm(cross(b - a, c - a)) / std::max(base, std::numeric_limits<double>::min());
  const int columns = steps(base, spacing), rows = steps(height, spacing);
  for (int row = 0; row < rows; ++row) {
    const double v = static_cast<double>(row) / rows;
    const Vec3 start = (1 - v) * a + v * c, end = (1 - v) * b + v * c;
    for (int column = 0; column <= columns; ++column) {
      const double u = static_cast<double>(column) / columns;
      take((1 - u) * start + u * end);
    }
  }
  take(c);
}

}  // namespace

SpreadPoints spread_points(const Mesh& mesh, double spacing) {
  SpreadPoints spread;
  for (std::size_t f = 0; f < mesh.faces.size(); ++f) {
    if (f % kBetweenPolls == 0) poll_stop();
    spread_over(mesh, mesh.faces[f], spacing, false, [&](Vec3 point) { spread.points.push_back(point); });
    spread.faces.resize(spread.points.size(), static_cast<std::int32_t>(f));
  }
  return spread;
}

MarkedCells mark_cells(const Mesh& mesh, double spacing, double pitch, std::int64_t margin) {
  MarkedCells cells;
  const auto for_each = [&](const auto& take) {
    for (std::size_t f = 0; f < mesh.faces.size(); ++f) {
      if (f % kBetweenPolls == 0) poll_stop();
      spread_over(mesh, mesh.faces[f], spacing, true, take);
    }
  };
  Box box;
  for_each([&](Vec3 point) { box.extend(point); });
  const double room = static_cast<double>(margin) * pitch;
  cells.origin = box.lower - Vec3{room, room, room};
  const auto cell_of = [&](Vec3 point) {
    Cell cell;
    for (int axis = 0; axis < 3; ++axis)
      cell[axis] = static_cast<std::int64_t>(std::nearbyint((point[axis] - cells.origin[axis]) / pitch));
    return cell;
  };
  const Cell last = cell_of(box.upper);
  for (int axis = 0; axis < 3; ++axis) cells.shape[axis] = last[axis] + 1 + margin;
  cells.marks.resize(cells.shape[0] * cells.shape[1] * cells.shape[2]);
  for_each([&](Vec3 point) {
    const Cell cell = cell_of(point);
    cells.marks[(cell[0] * cells.shape[1] + cell[1]) * cells.shape[2] + cell[2]] = 1;
  });
  return cells;
}

}  // namespace rlacd
