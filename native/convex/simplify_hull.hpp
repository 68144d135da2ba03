// A convex polytope with fewer corners around a convex polytope.
//
// In:  a convex hull, limits on corners and triangles, a tolerance, half-spaces that hold the hull; how far corners may
//      stick out.
// Out: a convex hull that contains the given one, within the limits, with little added volume. Corners that can be
//      removed without the hull growing by more than the tolerance anywhere are removed in any case. The result stays
//      in the half-spaces, unless the limits leave no such hull.
// How: everything is measured after an affine map that makes the hull about as wide in all directions: ratios of
//      volumes do not change, and needles and plates become well-conditioned.
//      (1) Edge collapse. For an edge, the point that lies beyond the planes of all facets around its two corners and
//      adds least volume is a linear program in three variables (Sander, Gu, Gortler, Hoppe, Snyder: "Silhouette
//      Clipping", 2000). The polytope is replaced by its hull with that point, which swallows both corners (and maybe
//      more), so it stays convex and only grows. Cheapest first. (2) Relaxation: the remaining corners move, one at a
//      time, to where the volume is least. (3) For very few corners, and if no edge can be
//      collapsed, boxes, prisms and tetrahedra around the hull are relaxed too, and the smallest result is kept: there
//      always is one. (4) If a corner sticks out farther than is enough, corners are evened out (even_out.hpp).
// Selecting a subset of the hull's planes (greedily, by the volume cut off) was tried against (1): it added two to five
// times the volume for 16 to 64 corners, since a polytope of n planes needs nearly 2 n corners.
#pragma once

#include "convex/convex_body.hpp"
#include "convex/linear_program.hpp"

namespace rlacd {

Mesh simplify_hull(const ConvexBody& hull, std::size_t max_vertices, std::size_t max_faces, double tolerance,
                   const std::vector<Above>& bounds, double enough);

}  // namespace rlacd
