#include "clearance_grid.hpp"

#include "parallel.hpp"

namespace rlacd {
namespace {

constexpr std::int32_t kBlock = 8;  // cells along a side of the largest cubes
constexpr double kHalfDiagonal = 0.8660254037844387;
// Cells up to a whole pitch below the level are asked too: from there the way up leads into creases and corners.
constexpr double kBelow = 1.0;

class Filling {
 public:
  Filling(const NavigableField& field, ClearanceGrid& grid) : field_(field), grid_(grid) {}

  // Fills the cells of one cube; `inside` bounds from below how deep in the hull its centre lies.
  void fill(std::array<std::int32_t, 3> first, std::int32_t side, std::int32_t hint, double inside,
            std::vector<std::int32_t>& boundary) {
    const double half = 0.5 * side;
    const Vec3 x = grid_.origin + grid_.pitch * Vec3{first[0] + half, first[1] + half, first[2] + half};
    const double reach = kHalfDiagonal * side * grid_.pitch;
    const double radius = field_.radius(), level = field_.level();

    const Bvh::Hit hit = field_.surface().closest(x, hint);
    const double distance = std::sqrt(hit.distance2), ground = field_.above_ground(x);
    const double clearance = std::min(distance, ground);
    if (side > 1 && clearance + reach < radius) return;  // -infinity stays

    if (inside < reach) inside = -field_.hull().distance(x, radius + reach + grid_.pitch);
    const double room = std::min({distance, ground + field_.tolerance(), field_.room_by_hull(std::max(-inside, 0.0))});
    const bool off = room + reach + (kBelow - kHalfDiagonal) * grid_.pitch<level, on = room - reach> level;
    if (side == 1) {
      const std::int32_t cell = grid_.at(first[0], first[1], first[2]);
      grid_.clearance[cell] = static_cast<float>(clearance);
      if (!off && !on) boundary.push_back(cell);
      return;
    }
    if ((off || on) && clearance - reach >= radius) return fill_free(first, side, x, clearance);
    const std::int32_t part = side / 2;
    const double shift = 0.5 * reach;  // to the centre of a child
    for (std::int32_t k = 0; k < 2; ++k)
      for (std::int32_t j = 0; j < 2; ++j)
        for (std::int32_t i = 0; i < 2; ++i)
          fill({first[0] + i * part, first[1] + j * part, first[2] + k * part}, part, hit.slot, inside - shift,
               boundary);
  }

 private:
  void fill_free(std::array<std::int32_t, 3> first, std::int32_t side, Vec3 x, double clearance) {
    for (std::int32_t k = first[2]; k < first[2] + side; ++k)
      for (std::int32_t j = first[1]; j < first[1] + side; ++j)
        for (std::int32_t i = first[0]; i < first[0] + side; ++i) {
          const std::int32_t cell = grid_.at(i, j, k);
          const Vec3 there = grid_.origin + grid_.pitch * Vec3{i + 0.5, j + 0.5, k + 0.5};
          grid_.clearance[cell] = static_cast<float>(clearance - norm(there - x));
        }
  }

  const NavigableField& field_;
  ClearanceGrid& grid_;
};

}  // namespace

ClearanceGrid clearance_grid(const NavigableField& field, double pitch, int threads) {
  ClearanceGrid grid;
  grid.pitch = pitch;
  const Box& box = field.hull().box();
  const double margin = field.radius() + 2 * pitch;
  std::int32_t blocks[3];
  for (int axis = 0; axis < 3; ++axis) {
    const double extent = box.upper[axis] - box.lower[axis] + 2 * margin;
    blocks[axis] = static_cast<std::int32_t>(std::ceil(extent / (kBlock * pitch)));
    grid.count[axis] = kBlock * blocks[axis];
    grid.origin[axis] = 0.5 * (box.lower[axis] + box.upper[axis] - grid.count[axis] * pitch);
  }
  grid.clearance.assign(grid.size(), -std::numeric_limits<float>::infinity());

  std::vector<std::vector<std::int32_t>> boundary(static_cast<std::size_t>(blocks[0]) * blocks[1] * blocks[2]);
  Filling filling(field, grid);
  parallel_for(boundary.size(), threads, [&](std::size_t block) {
    const auto b = static_cast<std::int32_t>(block);
    const std::array<std::int32_t, 3> first = {kBlock * (b % blocks[0]), kBlock * (b / blocks[0] % blocks[1]),
                                               kBlock * (b / blocks[0] / blocks[1])};
    filling.fill(first, kBlock, -1, -std::numeric_limits<double>::infinity(), boundary[block]);
  });
  for (const std::vector<std::int32_t>& cells : boundary)
    grid.boundary.insert(grid.boundary.end(), cells.begin(), cells.end());
  std::sort(grid.boundary.begin(), grid.boundary.end());
  return grid;
}

}  // namespace rlacd
