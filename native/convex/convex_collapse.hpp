// A closed convex triangle mesh whose number of corners is reduced by letting it grow.
//
// In:  a convex hull around the origin, about as wide in all directions.
// Out: convex hulls around it with fewer and fewer corners, the cheapest edge collapse first.
// Invariants: the living facets form a closed, outward oriented triangle mesh of sphere topology; it is convex up to
// a hair; every collapse replaces it by its hull with one new point.
#pragma once

#include <cstdint>
#include <functional>
#include <optional>
#include <utility>
#include <vector>

#include "convex/facets.hpp"
#include "convex/linear_program.hpp"
#include "core/geometry.hpp"

namespace rlacd {

struct CollapseFacet {
  Vec3 normal;
  double offset, area;
};

class ConvexCollapse : Facets<CollapseFacet> {
 public:
  // New corners stay above the bounds.
  ConvexCollapse(const Mesh& hull, std::vector<Above> bounds) : ConvexCollapse(hull, std::move(bounds), {}, 0) {}
  // The same if no corner is acceptable that is farther than the tolerance from the hull, measured where `placed` puts
  // corners: most edges are too long then, which is seen before their new corner is known.
  ConvexCollapse(const Mesh& hull, std::vector<Above> bounds, std::function<Vec3(Vec3)> placed, double tolerance);

  // Collapses edges while there are more than `most` corners, and beyond that while the new corner is acceptable. False
  // if no edge can be collapsed although there are still too many corners.
  template <class Acceptable>
  bool reduce(std::size_t most, const Acceptable& acceptable);

  std::vector<Vec3> corners() const;

 private:
  struct Collapse {
    double cost;  // added volume
    std::int32_t from, to;
    std::uint32_t from_version, to_version;
    Vec3 point;
    bool operator<(const Collapse& other) const {  // the cheapest on top of a max-heap; ties by the corners
      if (cost != other.cost) return cost > other.cost;
      return from != other.from ? from > other.from : to > other.to;
    }
  };

  std::int32_t new_facet(std::int32_t a, std::int32_t b, std::int32_t c);
  std::int32_t add_corner(Vec3 point);
  bool is_near(std::int32_t from, std::int32_t to);
  double reach(std::int32_t corner);
  bool gather(std::int32_t from, std::int32_t to);
  bool find_horizon_of(Vec3 point);
  std::optional<Collapse> plan(std::int32_t from, std::int32_t to);
  void schedule(std::int32_t from, std::int32_t to);
  void apply(const Collapse& collapse);

  const std::vector<Above> bounds_;
  const std::function<Vec3(Vec3)> placed_;
  const double tolerance_;
  std::vector<Vec3> points_, places_;
  std::vector<double> reach_;           // of a corner; not a number where it is not known
  std::vector<std::int32_t> facet_of_;  // one living facet of each living corner, -1 for the dead
  std::vector<std::uint32_t> version_;  // of a corner: changes with its facets
  std::vector<Collapse> heap_;
  std::size_t alive_ = 0;

  std::vector<Above> above_;
  std::vector<Vec3> edges_;
};

template <class Acceptable>
bool ConvexCollapse::reduce(std::size_t most, const Acceptable& acceptable) {
  while (!heap_.empty() && alive_ > 4) {
    const Collapse collapse = heap_.front();
    std::pop_heap(heap_.begin(), heap_.end());
    heap_.pop_back();
    if (facet_of_[collapse.from] < 0 || facet_of_[collapse.to] < 0) continue;
    if (version_[collapse.from] != collapse.from_version || version_[collapse.to] != collapse.to_version) {
      schedule(collapse.from, collapse.to);
      continue;
    }
    if (alive_ > most || acceptable(collapse.point)) apply(collapse);
  }
  return alive_ <= most;
}

}  // namespace rlacd
