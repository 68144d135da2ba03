// Cuts an L by the plane through the middle of its box that is normal to the x axis, and prints the volumes of the
// pieces and of their convex hulls, and how close each hull is to the L.
#include <algorithm>
#include <iostream>

#include "solid/against.hpp"
#include "solid/pieces.hpp"

int main() {
  const rlacd::Mesh mesh{{{0, 0, 0},
                          {3, 0, 0},
                          {3, 2, 0},
                          {2, 2, 0},
                          {2, 1, 0},
                          {0, 1, 0},
                          {0, 0, 1},
                          {3, 0, 1},
                          {3, 2, 1},
                          {2, 2, 1},
                          {2, 1, 1},
                          {0, 1, 1}},
                         {{0, 4, 1},  {6, 7, 10}, {0, 5, 4},  {6, 10, 11}, {1, 3, 2}, {7, 8, 9}, {1, 4, 3},
                          {7, 9, 10}, {0, 1, 7},  {0, 7, 6},  {1, 2, 8},   {1, 8, 7}, {2, 3, 9}, {2, 9, 8},
                          {3, 4, 10}, {3, 10, 9}, {4, 5, 11}, {4, 11, 10}, {5, 0, 6}, {5, 6, 11}}};
  const rlacd::Against against(mesh);
  const rlacd::Box box = rlacd::Box::of(mesh.vertices);
  for (const auto& side : rlacd::cut(mesh, {1, 0, 0}, (box.lower.x + box.upper.x) / 2, 0)) {
    if (!side) continue;
    const auto pieces = rlacd::connected_pieces(side->mesh, 0).value_or(std::vector{*side});
    for (const rlacd::Piece& piece : pieces) {
      const rlacd::ConvexBody hull(piece.hull);
      const rlacd::Against::Fit fit = against.measure(hull, 1e-4, 0);
      std::cout << "volume " << piece.volume << ", of its hull " << piece.hull_volume << ", from the L at most "
                << std::max(fit.depth.upper, fit.reach.upper) << '\n';
    }
  }
}
