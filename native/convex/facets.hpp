// The facets of a closed triangulated polytope, and how a new corner takes the place of those that it sees.
//
// Invariant between insertions: the living facets form a closed, oriented surface, and each knows its neighbours.
#pragma once

#include <vector>

#include "core/geometry.hpp"
#include "core/invariant.hpp"

namespace rlacd {

template <class Own>  // what a facet has besides
class Facets {
 public:
  struct Facet : Own {
    Triangle corner;
    std::int32_t neighbour[3];  // across the edge corner[i] -> corner[i + 1]
    bool alive = true;
    std::int32_t mark = -1;  // of the last insertion that looked at it
  };

 protected:
  struct HorizonEdge {
    std::int32_t from, to, beyond;
  };

  std::int32_t add_facet(const Facet& facet) {
    if (free_.empty()) {
      facets_.push_back(facet);
      return static_cast<std::int32_t>(facets_.size()) - 1;
    }
    const std::int32_t slot = free_.back();
    free_.pop_back();
    facets_[slot] = facet;
    return slot;
  }

  // A facet that the new corner sees, or is to see.
  void begin_insertion() {
    ++insertion_;
    visible_.clear();
  }
  void see(std::int32_t facet) {
    if (facets_[facet].mark == seen()) return;
    facets_[facet].mark = seen();
    visible_.push_back(facet);
  }

  // Adds to the visible facets all others that are seen, by adjacency, and finds the horizon: the edges around them, in
  // order. False unless it is one simple loop.
  template <class Sees>
  bool find_horizon(const Sees& sees) {
    horizon_.clear();
    for (std::size_t i = 0; i < visible_.size(); ++i)
      for (int e = 0; e < 3; ++e) {
        const Facet& f = facets_[visible_[i]];
        const std::int32_t across = f.neighbour[e];
        if (facets_[across].mark < seen()) {
          if (sees(facets_[across]))
            see(across);
          else
            facets_[across].mark = seen() + 1;
        }
        if (facets_[across].mark > seen()) horizon_.push_back({f.corner[e], f.corner[(e + 1) % 3], across});
      }
    return sort_horizon();
  }

  // Replaces the visible facets by a cone over the horizon, whose facets add(from, to) makes.
  template <class Add>
  void build_cone(const Add& add) {
    for (const std::int32_t f : visible_) facets_[f].alive = false;
    cone_.clear();
    for (const HorizonEdge& e : horizon_) {
      cone_.push_back(add(e.from, e.to));
      Facet& beyond = facets_[e.beyond];
      for (int k = 0; k < 3; ++k)
        if (beyond.corner[k] == e.to && beyond.corner[(k + 1) % 3] == e.from) beyond.neighbour[k] = cone_.back();
    }
    const std::size_t count = cone_.size();
    for (std::size_t i = 0; i < count; ++i) {
      Facet& f = facets_[cone_[i]];
      f.neighbour[0] = horizon_[i].beyond;
      f.neighbour[1] = cone_[(i + 1) % count];
      f.neighbour[2] = cone_[(i + count - 1) % count];
    }
    free_.insert(free_.end(), visible_.begin(), visible_.end());
  }

  std::vector<Facet> facets_;
  std::vector<std::int32_t> free_;
  std::vector<std::int32_t> visible_, cone_;
  std::vector<HorizonEdge> horizon_;

 private:
  std::int32_t seen() const { return 2 * insertion_; }

  bool sort_horizon() {
    const std::size_t count = horizon_.size();
    for (std::size_t i = 0; i < count; ++i) {
      const auto from = static_cast<std::size_t>(horizon_[i].from);
      if (from >= edge_from_.size()) edge_from_.resize(from + 1);
      edge_from_[from] = i;
    }
    sorted_.clear();
    for (std::size_t i = 0, edge = 0; i < count; ++i) {
      // Back at the start too soon, or at a corner that the horizon passes twice.
      if ((i > 0 && edge == 0) || edge_from_[horizon_[i].from] != i) return false;
      sorted_.push_back(horizon_[edge]);
      edge = edge_from_[horizon_[edge].to];
    }
    horizon_.swap(sorted_);
    return count >= 3;
  }

  std::int32_t insertion_ = 0;
  std::vector<std::size_t> edge_from_;  // of a corner: the edge of the horizon that starts there
  std::vector<HorizonEdge> sorted_;
};

}  // namespace rlacd
