#include "surface/spread_points.hpp"

#include <algorithm>
#include <cmath>
#include <stdexcept>

#include "core/random.hpp"
#include "core/stop.hpp"
#include "surface/edges.hpp"

namespace rlacd {
namespace {

constexpr int kMostSteps = 768;

// Rounded up to 1, 2, 3, 4, 6, 8, 12, 16, ...
int steps(double length, double spacing) {
  int count = 1;
  while (count < length / spacing && count < kMostSteps)
    count = count == 1 ? 2 : (count & (count - 1)) == 0 ? count / 2 * 3 : count / 3 * 4;
  return count;
}

// Calls take(point) for all points of one face.
template <class Take>
void spread_over(const Mesh& mesh, const Triangle& face, double spacing, const Take& take) {
  // From a to b along the longest edge; rows are parallel to it.
  const Corners corners = corners_of(mesh, face);
  const int k = longest_side(corners);
  const Vec3 a = corners[k], b = corners[(k + 1) % 3], c = corners[(k + 2) % 3];
  const double base = norm(b - a);
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

double fraction(double x) { return x - std::floor(x); }

// 1 / g and 1 / g^2 for the plastic number g, the real root of g^3 = g + 1.
constexpr double kStepU = 0.7548776662466927, kStepV = 0.5698402909980532;

}  // namespace

SpreadPoints spread_points(const Mesh& mesh, double spacing) {
  SpreadPoints spread;
  for (std::size_t f = 0; f < mesh.faces.size(); ++f) {
    poll_stop(f);
    spread_over(mesh, mesh.faces[f], spacing, [&](Vec3 point) { spread.points.push_back(point); });
    spread.faces.resize(spread.points.size(), static_cast<std::int32_t>(f));
  }
  return spread;
}

MarkedCells mark_cells(const Mesh& mesh, double spacing, double pitch, std::int64_t margin) {
  MarkedCells cells;
  const auto for_each = [&](const auto& take) {
    for (std::size_t f = 0; f < mesh.faces.size(); ++f) {
      poll_stop(f);
      spread_over(mesh, mesh.faces[f], spacing, take);
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

std::vector<std::int64_t> label_cells(const bool* marks, Cell shape) {
  const std::int64_t steps[3] = {shape[1] * shape[2], shape[2], 1}, count = shape[0] * steps[0];
  Groups groups(static_cast<std::size_t>(count));
  for (std::int64_t cell = 0; cell < count; ++cell) {
    poll_stop(cell);
    for (std::size_t axis = 0; axis < 3; ++axis)
      if (marks[cell] && cell / steps[axis] % shape[axis] > 0 && marks[cell - steps[axis]])
        groups.join(cell, cell - steps[axis]);
  }
  std::vector<std::int64_t> labels = groups.labels().second;
  for (std::int64_t cell = 0; cell < count; ++cell) labels[cell] = marks[cell] ? labels[cell] + 1 : 0;
  return labels;
}

std::vector<std::int64_t> nearest_labels(const std::int64_t* labels, Cell shape, const std::vector<Cell>& cells,
                                         double reach) {
  std::vector<Cell> offsets;
  const auto norm2 = [](const Cell& c) { return c[0] * c[0] + c[1] * c[1] + c[2] * c[2]; };
  const auto most = static_cast<std::int64_t>(std::floor(reach));
  for (std::int64_t i = -most; i <= most; ++i)
    for (std::int64_t j = -most; j <= most; ++j)
      for (std::int64_t k = -most; k <= most; ++k)
        if (static_cast<double>(norm2({i, j, k})) <= reach * reach) offsets.push_back({i, j, k});
  std::stable_sort(offsets.begin(), offsets.end(), [&](const Cell& a, const Cell& b) { return norm2(a) < norm2(b); });
  std::vector<std::int64_t> nearest;
  nearest.reserve(cells.size());
  for (std::size_t n = 0; n < cells.size(); ++n) {
    poll_stop(n);
    std::int64_t found = 0;
    for (std::size_t o = 0; o < offsets.size() && found == 0; ++o) {
      const std::int64_t i = cells[n][0] + offsets[o][0], j = cells[n][1] + offsets[o][1],
                         k = cells[n][2] + offsets[o][2];
      if (i >= 0 && j >= 0 && k >= 0 && i < shape[0] && j < shape[1] && k < shape[2])
        found = labels[(i * shape[1] + j) * shape[2] + k];
    }
    nearest.push_back(found);
  }
  return nearest;
}

SpreadPoints sample_surface(const Mesh& mesh, std::size_t count, std::uint64_t seed) {
  std::vector<double> area_up_to(mesh.faces.size());
  double area = 0;
  for (std::size_t f = 0; f < mesh.faces.size(); ++f) {
    area += norm(long_normal(mesh, mesh.faces[f]));
    area_up_to[f] = area;
  }
  SpreadPoints samples;
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
