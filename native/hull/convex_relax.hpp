// A convex polytope around another one, tightened without adding corners.
//
// In:  an outer convex hull that holds an inner one; both around the origin, about as wide in all directions.
// Out: an outer hull with no more corners and no more volume; what was above the bounds stays there.
// How: one corner w at a time moves to where the volume is least while its neighbours stay. The facets around w turn
//      about the edges of its ring, so the inner hull stays inside as long as w lies beyond the plane through each ring
//      edge that touches the inner hull; the outer hull stays convex as long as w lies below the facets across the
//      ring. Volume is linear in w: a linear program in three variables, with the present w feasible. After each sweep
//      over all corners the hull is taken anew, which lets edges flip.
#pragma once

#include <vector>

#include "base/geometry.hpp"
#include "hull/linear_program.hpp"

namespace rlacd {

Mesh relax_around(Mesh outer, const Mesh& inner, const std::vector<Above>& bounds, int sweeps);

}  // namespace rlacd
