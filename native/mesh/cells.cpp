#include "mesh/cells.hpp"

#include <algorithm>
#include <cmath>

#include "base/stop.hpp"

namespace rlacd {
namespace {

constexpr std::size_t kBetweenPolls = 1 << 16;

}  // namespace

std::vector<std::int64_t> label_cells(const bool* marks, Cell shape) {
  const auto [x, y, z] = shape;
  const std::int64_t steps[3] = {y * z, z, 1};
  std::vector<std::int64_t> label(static_cast<std::size_t>(x * y * z), 0), open;
  std::int64_t count = 0;
  std::size_t polls = 0;
  for (std::int64_t first = 0; first < x * y * z; ++first) {
    if (!marks[first] || label[first] != 0) continue;
    label[first] = ++count;
    open.push_back(first);
    while (!open.empty()) {
      if (++polls % kBetweenPolls == 0) poll_stop();
      const std::int64_t cell = open.back();
      open.pop_back();
      const Cell at = {cell / steps[0], cell / steps[1] % y, cell % z};
      for (int axis = 0; axis < 3; ++axis)
        for (const int side : {-1, 1}) {
          if (at[axis] + side < 0 || at[axis] + side >= shape[axis]) continue;
          const std::int64_t next = cell + side * steps[axis];
          if (!marks[next] || label[next] != 0) continue;
          label[next] = count;
          open.push_back(next);
        }
    }
  }
  return label;
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
    if (n % 1024 == 0) poll_stop();
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

}  // namespace rlacd
