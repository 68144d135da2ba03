// The region that the centre of a ball can reach.
//
// In:  the clearance on a grid, and points.
// Out: which points can be joined by a path along which the clearance nowhere falls below the radius r.
// How: the clearance is 1-Lipschitz, so a straight segment from a to b is certainly free if
//      clearance(a) + clearance(b) >= |ab| + 2 r. Neighbouring cells are joined by that rule first, which nearly always
//      answers the question. Regions that are still apart are examined closely: they grow, cell by cell, through cells
//      whose centre may be blocked but that hold a free point nearby, along segments that are bisected where the rule
//      is undecided, with their midpoint pushed away from the nearest surface.
// Every path found is free for a ball of 0.99 r. A passage is missed only if it is so contorted that, between points
// half a radius apart, pushing does not find the path.
#pragma once

#include <unordered_map>

#include "decompose/clearance_grid.hpp"
#include "surface/edges.hpp"

namespace rlacd {

class BallReach {
 public:
  BallReach(const NavigableField& field, ClearanceGrid& grid);

  // Adds a point with its clearance, which must be at least the radius; returns its number, counted from 0.
  std::int32_t add(Vec3 point, double clearance);

  // Makes everything around the grid, or a point, a start.
  void start_outside() {
    from_outside_ = true;
    start_on_border();
  }
  void start_at(std::int32_t point);

  bool reached(std::int32_t point) { return root(node_of(point)) == root(kStart); }
  // Points with the same number can reach each other; cells that are not free are isolated.
  std::int32_t region(std::int32_t point) { return root(node_of(point)); }
  std::int32_t region_of_cell(std::int32_t cell) { return root(node_of_cell(cell)); }

  // Examines closely the regions that are not reached but hold one of these points. Resolves cells of the grid.
  void look_closely(const std::vector<std::int32_t>& points, int threads);

 private:
  struct Place {
    Vec3 at;
    double clearance;
    std::int32_t slot;
  };
  static constexpr std::int32_t kStart = 0;  // node
  static constexpr std::int32_t kShut = -2;  // mark

  std::int32_t node_of(std::int32_t point) const { return 1 + grid_.size() + point; }
  static std::int32_t node_of_cell(std::int32_t cell) { return 1 + cell; }
  std::int32_t root(std::int32_t node) { return static_cast<std::int32_t>(regions_.root(node)); }
  void join(std::int32_t a, std::int32_t b) { regions_.join(a, b); }

  void start_on_border();
  bool is_free(std::int32_t cell) const { return grid_.clearance[cell] >= least_; }
  void join_cells();
  void join_point(std::int32_t point);
  bool may_be_free(std::int32_t cell) const { return grid_.clearance[cell] >= least_ - half_diagonal_; }
  bool may_be_reached(const std::vector<std::int32_t>& cells, std::int32_t region);
  void grow(const std::vector<std::int32_t>& points, const std::vector<std::int32_t>& cells, std::int32_t region);
  const Place* place_in(std::int32_t cell);
  bool push(Place& place) const;
  bool is_way(const Place& a, const Place& b) const;

  const NavigableField& field_;
  ClearanceGrid& grid_;
  std::vector<Vec3> points_;
  std::vector<double> clearance_;  // of the points
  double least_, half_diagonal_;
  bool from_outside_ = false;
  Groups regions_;
  std::unordered_map<std::int32_t, Place> places_;  // clearance 0: the cell has none
  // By cell: the region whose search has seen it, or a mark that everything reachable from it has been seen.
  std::vector<std::int32_t> mark_;
};

}  // namespace rlacd
