// The edges of a triangle soup, and what its faces form by sharing them. Linear time.
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <utility>
#include <vector>

#include "core/geometry.hpp"

namespace rlacd {

// Items grouped by a key below `keys`, in the order in which they are added: count them all, allocate, add them all.
template <class Item>
class Buckets {
 public:
  explicit Buckets(std::size_t keys) : begin_(keys + 1, 0) {}
  void count(std::size_t key) { ++begin_[key + 1]; }
  void allocate() {
    for (std::size_t k = 1; k < begin_.size(); ++k) begin_[k] += begin_[k - 1];
    items_.resize(begin_.back());
    next_.assign(begin_.begin(), begin_.end() - 1);
  }
  void add(std::size_t key, const Item& item) { items_[next_[key]++] = item; }
  std::pair<Item*, Item*> range(std::size_t key) {
    return {items_.data() + begin_[key], items_.data() + begin_[key + 1]};
  }
  // Calls task(item) for those with keys in [from, to).
  template <class Task>
  void for_each(std::size_t from, std::size_t to, const Task& task) const {
    for (std::size_t i = begin_[from]; i < begin_[to]; ++i) task(items_[i]);
  }

 private:
  std::vector<std::size_t> begin_, next_;
  std::vector<Item> items_;
};

// The halfedges of each vertex that is the smaller of their two, sorted by the larger and then by number.
struct Run {
  std::int32_t high;  // the larger of the edge's vertices
  std::uint32_t halfedge;
};
Buckets<Run> sorted_halfedges(const std::vector<Triangle>& faces, std::size_t vertices);

// Halfedge 3 f + c runs from corner c of face f to its next corner.

// Whether a halfedge runs from the smaller of its edge's vertices to the larger.
inline bool ascends(const std::vector<Triangle>& faces, std::size_t low, const Run& run) {
  return faces[run.halfedge / 3][run.halfedge % 3] == static_cast<std::int32_t>(low);
}

// The other halfedge along the same edge; empty if there are not always two, in opposite directions.
std::vector<std::uint32_t> mates_of(const std::vector<Triangle>& faces, std::size_t vertices);

struct Edges {
  std::vector<std::int64_t> of_halfedge;              // [3F]
  std::vector<std::array<std::int64_t, 2>> vertices;  // [E], the smaller first, in ascending order
  std::vector<std::int64_t> valence;                  // [E], how many halfedges run along the edge
};
Edges edges_of(const std::vector<Triangle>& faces, std::size_t vertices);

// Groups of nodes, given by links between them; a group has the number of its first node's rank among those.
class Groups {
 public:
  explicit Groups(std::size_t nodes);
  void add() { parent_.push_back(static_cast<std::int64_t>(parent_.size())); }
  void join(std::int64_t a, std::int64_t b);
  // A node that all of its group share.
  std::int64_t root(std::int64_t node);
  // The number of groups, and the group of each node.
  std::pair<std::int64_t, std::vector<std::int64_t>> labels();

 private:
  std::vector<std::int64_t> parent_;  // never larger than the node
};

// A mesh all of whose edges join two faces that run along them in opposite directions.
struct ClosedBodies {
  std::vector<std::int64_t> body;  // [F], the sets of faces that share edges, numbered by their first faces
  std::vector<double> volume, area;
  std::vector<Box> box;
  // No vertex at which faces meet that are not neighbours around it.
  bool has_no_pinch = false;
  double least_height = 0;  // of a face
  double least_fold = 2;    // the least length of the sum of two neighbours' unit normals; 0 if one is folded back
};
// Nothing if there are other edges, or none.
std::optional<ClosedBodies> closed_bodies(const Mesh& mesh);

// The wedges of space around the edges, and which sides of faces bound each. n log n time.
using Pair = std::array<std::int64_t, 2>;

struct Wedges {
  // [3F], halfedges: going around their edge from its smaller to its larger vertex by the right-hand rule, the second
  // follows the first with nothing in between. Both are the same on a free edge.
  std::vector<Pair> halfedges;
  // [3F], the side that each of them shows to the wedge: 2 f is the front of face f, 2 f + 1 its back.
  std::vector<Pair> sides;
};

// Faces are ordered by their angles around the edge; those that coincide, and all around edges none of whose faces is
// in doubt (`trusted`, [F] or empty), alternate as their windings require.
Wedges wedges_of(const Mesh& mesh, const std::vector<std::int64_t>& edge_of_halfedge, std::size_t edges,
                 const std::vector<bool>& trusted);

}  // namespace rlacd
