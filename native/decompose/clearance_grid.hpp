// The clearance on a grid of cells around a solid, and the cells that the boundary of the navigable space crosses.
//
// How: cubes of cells are halved while the 1-Lipschitz fields at their centre do not decide for all of their cells.
//      First only near the boundary of the space; cells farther off are known to be free only if a large cube shows it,
//      which is nearly always enough for the path of a ball.
#pragma once

#include "decompose/navigable_field.hpp"

namespace rlacd {

struct ClearanceGrid {
  Vec3 origin;  // lower corner of the first cell
  double pitch = 0;
  std::int32_t count[3] = {0, 0, 0};

  // At the centre of each cell. If the whole cell is free it may be a lower bound that shows so; if no point of the
  // cell is free, or the cell is not resolved, it is -infinity.
  std::vector<float> clearance;

  // Cells that the boundary of the space may cross, ascending, and the room at their centres.
  struct Crossed {
    std::int32_t cell;
    double inside;  // lower bound on the depth of its centre in the hull
    NavigableField::Value room;
  };
  std::vector<Crossed> boundary;

  struct Cube {
    std::array<std::int32_t, 3> first;
    std::int32_t side;
    std::int32_t slot;  // of a triangle expected to be near
    double inside;      // lower bound on the depth of its centre in the hull
  };
  std::vector<Cube> unresolved;

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
  // Calls action(other, step) for a cell and those that touch it, the last axis slowest; a step has entries -1, 0
  // and 1.
  template <class Action>
  void for_neighbours(std::int32_t cell, const Action& action) const {
    const auto [i, j, k] = place(cell);
    for (std::int32_t c = -1; c <= 1; ++c)
      for (std::int32_t b = -1; b <= 1; ++b)
        for (std::int32_t a = -1; a <= 1; ++a)
          if (holds(i + a, j + b, k + c)) action(at(i + a, j + b, k + c), Vec3{1.0 * a, 1.0 * b, 1.0 * c});
  }
  // Coordinates of the cell that contains x, possibly off the grid.
  std::array<std::int32_t, 3> over(Vec3 x) const {
    const auto floor_of = [this](double a, double b) { return static_cast<std::int32_t>(std::floor((a - b) / pitch)); };
    return {floor_of(x.x, origin.x), floor_of(x.y, origin.y), floor_of(x.z, origin.z)};
  }
};

// Every cell on the grid's border lies farther than the radius from the hull.
ClearanceGrid clearance_grid(const NavigableField& field, double pitch, int threads);

// Asks for the cells of the cubes that are not resolved.
void resolve(const NavigableField& field, ClearanceGrid& grid, int threads);

}  // namespace rlacd
