#include "decompose/clearance_grid.hpp"

#include <utility>

#include "core/parallel.hpp"

namespace rlacd {
namespace {

constexpr std::int32_t kBlock = 8;  // cells along a side of the largest cubes
// Distance from the level, in pitches, within which a cell counts as crossed. More than the half diagonal, so that
// every straight line has such a cell on either side: those above the level descend to the whole boundary, those below
// climb into its creases and corners.
constexpr double kCrossed = 1.0;

struct Found {
  std::vector<ClearanceGrid::Crossed> boundary;
  std::vector<ClearanceGrid::Cube> unresolved;
};

class Filling {
 public:
  Filling(const NavigableField& field, ClearanceGrid& grid, bool to_the_end)
      : field_(field), grid_(grid), to_the_end_(to_the_end) {}

  void fill(ClearanceGrid::Cube cube, Found& found) const {
    const double half = 0.5 * cube.side, reach = kHalfRootOfThree * cube.side * grid_.pitch;
    const Vec3 x = grid_.origin + grid_.pitch * Vec3{cube.first[0] + half, cube.first[1] + half, cube.first[2] + half};
    const double radius = field_.radius(), level = field_.level();
    const double margin = reach + (kCrossed - kHalfRootOfThree) * grid_.pitch;

    if (cube.inside < reach) cube.inside = -field_.hull().distance(x, radius + margin);
    const double away = std::max(-cube.inside, 0.0), ground = field_.above_ground(x);
    const double others = std::min(ground + field_.tolerance(), field_.room_by_hull(away));
    // The surface is no nearer than the hull.
    if (others + margin < level && std::min(away, ground) - reach >= radius)
      return fill_free(cube, x, std::min(away, ground));

    // One triangle often shows that the cube is too close to the surface.
    const double most = cube.slot >= 0 ? field_.surface().distance(cube.slot, x) : kInfinity;
    if (std::min(most, ground) + reach < radius) return;
    if (std::min(most, others) + margin < level && !to_the_end_) return found.unresolved.push_back(cube);

    const double within = level + margin;
    const Bvh::Hit hit = field_.surface().closest(x, cube.slot, 0, within);
    const double distance = hit.slot >= 0 ? std::sqrt(hit.distance2) : within;
    const double clearance = std::min(distance, ground), room = std::min(distance, others);
    if (clearance + reach < radius) return;
    const bool off = room + margin < level, on = room - margin >= level;
    if (cube.side == 1) {
      const std::int32_t cell = grid_.at(cube.first[0], cube.first[1], cube.first[2]);
      grid_.clearance[cell] = static_cast<float>(clearance);
      if (off || on) return;
      NavigableField::Value value;
      if (room < field_.room_by_hull(away))
        value = field_.room_near(x, hit.slot);
      else
        value = {room, normalized(field_.hull().bvh().closest(x).point - x), hit.slot, NavigableField::Limit::kHull};
      found.boundary.push_back({cell, cube.inside, value});
      return;
    }
    if ((off || on) && clearance - reach >= radius) return fill_free(cube, x, clearance);
    if (hit.slot >= 0) cube.slot = hit.slot;
    if (off && !to_the_end_) return found.unresolved.push_back(cube);
    const std::int32_t part = cube.side / 2;
    for (std::int32_t k = 0; k < 2; ++k)
      for (std::int32_t j = 0; j < 2; ++j)
        for (std::int32_t i = 0; i < 2; ++i)
          fill({{cube.first[0] + i * part, cube.first[1] + j * part, cube.first[2] + k * part},
                part,
                cube.slot,
                cube.inside - 0.5 * reach},
               found);
  }

 private:
  void fill_free(const ClearanceGrid::Cube& cube, Vec3 x, double clearance) const {
    const auto [a, b, c] = cube.first;
    for (std::int32_t k = c; k < c + cube.side; ++k)
      for (std::int32_t j = b; j < b + cube.side; ++j)
        for (std::int32_t i = a; i < a + cube.side; ++i) {
          const Vec3 there = grid_.origin + grid_.pitch * Vec3{i + 0.5, j + 0.5, k + 0.5};
          grid_.clearance[grid_.at(i, j, k)] = static_cast<float>(clearance - norm(there - x));
        }
  }

  const NavigableField& field_;
  ClearanceGrid& grid_;
  bool to_the_end_;
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

  std::vector<Found> found(static_cast<std::size_t>(blocks[0]) * blocks[1] * blocks[2]);
  const Filling filling(field, grid, false);
  parallel_for(found.size(), threads, [&](std::size_t block) {
    const auto b = static_cast<std::int32_t>(block);
    const std::array<std::int32_t, 3> first = {kBlock * (b % blocks[0]), kBlock * (b / blocks[0] % blocks[1]),
                                               kBlock * (b / blocks[0] / blocks[1])};
    filling.fill({first, kBlock, -1, -kInfinity}, found[block]);
  });
  for (const Found& own : found) {
    grid.boundary.insert(grid.boundary.end(), own.boundary.begin(), own.boundary.end());
    grid.unresolved.insert(grid.unresolved.end(), own.unresolved.begin(), own.unresolved.end());
  }
  std::sort(grid.boundary.begin(), grid.boundary.end(),
            [](const ClearanceGrid::Crossed& a, const ClearanceGrid::Crossed& b) { return a.cell < b.cell; });
  return grid;
}

void resolve(const NavigableField& field, ClearanceGrid& grid, int threads) {
  const std::vector<ClearanceGrid::Cube> cubes = std::move(grid.unresolved);
  grid.unresolved.clear();
  const Filling filling(field, grid, true);
  parallel_for(cubes.size(), threads, [&](std::size_t i) {
    Found nothing;  // the boundary of the space does not cross these cubes
    filling.fill(cubes[i], nothing);
  });
}

}  // namespace rlacd
