// The wedges of space around the edges of a triangle soup, and which sides of its faces bound each. n log n time.
#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "base/geometry.hpp"
#include "mesh/edges.hpp"

namespace rlacd {

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
