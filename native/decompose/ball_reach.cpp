#include "decompose/ball_reach.hpp"

#include <utility>

#include "core/stop.hpp"

namespace rlacd {
namespace {

// Shares of the radius that may be missing along a path, and at its vertices.
constexpr double kSlackOfWay = 0.01, kSlackOfPoint = 0.004;
constexpr double kMargin = 1e-6;  // for rounding
constexpr int kPushes = 24;
// A cell's free point may lie a little outside it.
constexpr double kInCell = 0.55;

}  // namespace

BallReach::BallReach(const NavigableField& field, ClearanceGrid& grid)
    : field_(field),
      grid_(grid),
      least_(field.radius() * (1 - kMargin)),
      half_diagonal_(kHalfRootOfThree * grid.pitch * (1 + kMargin)),
      regions_(static_cast<std::size_t>(1 + grid.size())) {
  join_cells();
}

std::int32_t BallReach::add(Vec3 point, double clearance) {
  const auto number = static_cast<std::int32_t>(points_.size());
  points_.push_back(point);
  clearance_.push_back(clearance);
  regions_.add();
  join_point(number);
  return number;
}

void BallReach::join_cells() {
  const std::int32_t step[3] = {1, grid_.count[0], grid_.count[0] * grid_.count[1]};
  std::int32_t cell = 0;
  for (std::int32_t k = 0; k < grid_.count[2]; ++k)
    for (std::int32_t j = 0; j < grid_.count[1]; ++j)
      for (std::int32_t i = 0; i < grid_.count[0]; ++i, ++cell) {
        if (!is_free(cell)) continue;
        const std::int32_t place[3] = {i, j, k};
        for (int axis = 0; axis < 3; ++axis) {
          if (place[axis] == 0) continue;
          const std::int32_t before = cell - step[axis];
          if (static_cast<double>(grid_.clearance[cell]) + grid_.clearance[before] >= grid_.pitch + 2 * least_)
            join(node_of_cell(cell), node_of_cell(before));
        }
      }
}

void BallReach::join_point(std::int32_t point) {
  const auto [i, j, k] = grid_.over(points_[point]);
  if (!grid_.holds(i, j, k)) return;
  grid_.for_neighbours(grid_.at(i, j, k), [&](std::int32_t cell, Vec3) {
    const double clearances = clearance_[point] + grid_.clearance[cell];
    if (is_free(cell) && clearances >= norm(grid_.centre(cell) - points_[point]) + 2 * least_)
      join(node_of(point), node_of_cell(cell));
  });
}

void BallReach::start_at(std::int32_t point) {
  join(kStart, node_of(point));
  const auto [i, j, k] = grid_.over(points_[point]);
  if (!grid_.holds(i, j, k)) start_outside();
}

void BallReach::start_on_border() {
  for (std::int32_t cell = 0; cell < grid_.size(); ++cell) {
    const auto place = grid_.place(cell);
    bool border = false;
    for (int axis = 0; axis < 3; ++axis) border |= place[axis] == 0 || place[axis] == grid_.count[axis] - 1;
    if (border && is_free(cell)) join(node_of_cell(cell), kStart);
  }
}

// Pushes a point away from the nearest surface, alternating between both sides of a narrow passage, until it is free.
bool BallReach::push(Place& place) const {
  for (int i = 0; i < kPushes; ++i) {
    const NavigableField::Value value = field_.clearance(place.at, place.slot);
    place.clearance = value.value;
    place.slot = value.slot;
    if (value.value >= (1 - kSlackOfPoint) * field_.radius()) return true;
    place.at = place.at + (field_.radius() - value.value) * value.uphill;
  }
  return false;
}

const BallReach::Place* BallReach::place_in(std::int32_t cell) {
  if (!may_be_free(cell)) return nullptr;
  const auto [entry, is_new] = places_.try_emplace(cell);
  Place& place = entry->second;
  if (is_new) {
    const Vec3 centre = grid_.centre(cell);
    place = {centre, 0, -1};
    if (!push(place) || max_abs(place.at - centre) > kInCell * grid_.pitch) place.clearance = 0;
  }
  return place.clearance > 0 ? &place : nullptr;
}

bool BallReach::is_way(const Place& a, const Place& b) const {
  const double length = norm(b.at - a.at);
  if (a.clearance + b.clearance >= length + 2 * (1 - kSlackOfWay) * field_.radius()) return true;
  const Vec3 middle = 0.5 * (a.at + b.at);
  Place between = {middle, 0, a.slot};
  // Both halves must be shorter, or the bisection would not end.
  if (!push(between) || norm(between.at - middle) > 0.35 * length) return false;
  return is_way(a, between) && is_way(between, b);
}

// Whether the region can be connected with the start at all, through cells that may hold a free point.
bool BallReach::may_be_reached(const std::vector<std::int32_t>& cells, std::int32_t region) {
  std::vector<std::int32_t> open;
  const std::int32_t start = root(kStart);
  const auto enter = [&](std::int32_t cell) {  // returns whether the question is settled
    if (mark_[cell] == region) return false;
    mark_[cell] = region;
    open.push_back(cell);
    return root(node_of_cell(cell)) == start;
  };
  for (const std::int32_t cell : cells)
    if (mark_[cell] != kShut && enter(cell)) return true;
  for (std::size_t next = 0; next < open.size(); ++next) {
    poll_stop();
    bool found = false;
    grid_.for_neighbours(open[next], [&](std::int32_t cell, Vec3) {
      if (!found && mark_[cell] != kShut && may_be_free(cell)) found = enter(cell);
    });
    if (found) return true;
  }
  for (const std::int32_t cell : open) mark_[cell] = kShut;
  return false;
}

void BallReach::grow(const std::vector<std::int32_t>& points, const std::vector<std::int32_t>& cells,
                     std::int32_t region) {
  std::vector<std::int32_t> open;
  const auto enter = [&](std::int32_t cell) {
    if (mark_[cell] == kShut || mark_[cell] == region) return;  // nothing more can be reached from a shut cell
    mark_[cell] = region;
    open.push_back(cell);
  };
  for (std::size_t p = 0; p < points.size(); ++p) {
    const Place from = {points_[points[p]], clearance_[points[p]], -1};
    grid_.for_neighbours(cells[p], [&](std::int32_t cell, Vec3) {
      if (root(node_of_cell(cell)) != root(node_of(points[p]))) {
        const Place* place = place_in(cell);
        if (place == nullptr || !is_way(from, *place)) return;
        join(node_of(points[p]), node_of_cell(cell));
      }
      enter(cell);
    });
  }
  for (std::size_t next = 0; next < open.size() && !reached(points[0]); ++next) {
    poll_stop();
    const std::int32_t cell = open[next];
    grid_.for_neighbours(cell, [&](std::int32_t neighbour, Vec3) {
      if (mark_[neighbour] == region) return;
      if (root(node_of_cell(neighbour)) != root(node_of_cell(cell))) {
        const Place* from = place_in(cell);
        const Place* to = from != nullptr ? place_in(neighbour) : nullptr;
        if (to == nullptr || !is_way(*from, *to)) return;
        join(node_of_cell(cell), node_of_cell(neighbour));
      }
      enter(neighbour);
    });
  }
  if (reached(points[0])) return;
  for (const std::int32_t cell : open) mark_[cell] = kShut;
}

void BallReach::look_closely(const std::vector<std::int32_t>& points, int threads) {
  resolve(field_, grid_, threads);
  join_cells();
  if (from_outside_) start_on_border();
  for (std::size_t i = 0; i < points_.size(); ++i) join_point(static_cast<std::int32_t>(i));
  std::unordered_map<std::int32_t, std::size_t> number;
  std::vector<std::vector<std::int32_t>> regions;
  for (const std::int32_t point : points) {
    if (reached(point)) continue;
    const auto [entry, is_new] = number.try_emplace(root(node_of(point)), regions.size());
    if (is_new) regions.emplace_back();
    regions[entry->second].push_back(point);
  }
  mark_.assign(grid_.size(), -1);
  for (std::size_t r = 0; r < regions.size(); ++r) {
    poll_stop();
    if (reached(regions[r][0])) continue;  // through an earlier region
    std::vector<std::int32_t> cells;
    for (const std::int32_t point : regions[r]) {
      const auto [i, j, k] = grid_.over(points_[point]);
      cells.push_back(grid_.at(i, j, k));
    }
    const auto mark = static_cast<std::int32_t>(2 * r);
    if (may_be_reached(cells, mark)) grow(regions[r], cells, mark + 1);
  }
}

}  // namespace rlacd
