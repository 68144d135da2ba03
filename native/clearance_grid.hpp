// The clearance on a grid of cells around a solid, and the cells that the boundary of the navigable space crosses.
//
// How: cubes of cells are halved as long as the field at their centre, which changes no faster than one moves, leaves
//      open what holds for all of them; only near the two level sets each cell is asked for.
#pragma once

#include "navigable_field.hpp"

namespace rlacd {

struct ClearanceGrid {
  Vec3 origin;  // lower corner of the first cell
  double pitch = 0;
  std::int32_t count[3] = {0, 0, 0};

  // At the centre of each cell. Where the whole cell is free it may be a lower bound that says so; where no point of
  // the cell is, -infinity.
  std::vector<float> clearance;
  // Cells that the boundary of the space may cross, ascending.
  std::vector<std::int32_t> boundary;

  std::int32_t size() const { return count[0] * count[1] * count[2]; }
  std::int32_t at(std::int32_t i, std::int32_t j, std::int32_t k) const { return (k * count[1] + j) * count[0] + i; }
  std::array<std::int32_t, 3> place(std::int32_t cell) const {
    return {cell % count[0], cell / count[0] % count[1], cell / count[0] / count[1]};
  }
  Vec3 centre(std::int32_t cell) const {
    const auto [i, j, k] = place(cell);
    return origin + pitch * Vec3{i + 0.5, j + 0.5, k + 0.5};
  }
  bool holds(std::int32_t i, std::int32_t j, std::int32_t k) const {
    return i >= 0 && j >= 0 && k >= 0 && i < count[0] && j < count[1] && k < count[2];
  }
  // Coordinates of the cell that holds x, perhaps off the grid.
  std::array<std::int32_t, 3> over(Vec3 x) const {
    const auto floor_of = [this](double a, double b) { return static_cast<std::int32_t>(std::floor((a - b) / pitch)); };
    return {floor_of(x.x, origin.x), floor_of(x.y, origin.y), floor_of(x.z, origin.z)};
  }
};

// Every cell on the grid's border lies farther than the radius from the hull.
ClearanceGrid clearance_grid(const NavigableField& field, double pitch, int threads);

}  // namespace rlacd
