// Triangulates a closed loop of points with little bending, by dynamic programming over its chords.
//
// In:  a loop, the normals of the faces along it, and the chords it should not use.
// Out: triangles with corners in the loop.
// How: the cost is the sum over all edges, those of the loop included, of length times angle between the faces: the
//      total absolute mean curvature, which restores the sharp edges of an object where least area would cut them off.
//      A small weight on area decides where nothing bends. After Liepa, "Filling holes in meshes" (2003):
//      what lies behind a chord is chosen without what lies beyond it, so that the sum can be a little above the least.
//      O(n^3).
#pragma once

#include <cstdint>
#include <vector>

#include "core/geometry.hpp"

namespace rlacd {

struct Loop {
  std::vector<Vec3> points;  // [N], N >= 3
  std::vector<Vec3> beside;  // [N], unit normals of the faces beyond the edges from each point to the next
  std::vector<bool> taken;   // [N N] or empty, pairs of points that should not get an edge
};

// [N - 2], wound like the loop; the faces beyond its edges run against it.
std::vector<Triangle> least_bent(const Loop& loop);

}  // namespace rlacd
