// Rims of a cut that cross each other, taken apart into loops that do not.
//
// Where a solid overlaps itself, the rims of a plane cut cross, and no triangulation of them as they are closes the cut
// without leading out of the solid.
//
// Input:  one side of a cut (see plane_cut.hpp) and its rims as points of the plane.
// Output: the same side with a vertex at every crossing, and regions of the plane around which the rims run w times,
//         each with its boundary: loops that cross nowhere, the region to their left. Its triangles close the side
//         where each is taken w times, or -w times upside down where the solid is inside out (w < 0).
// Algorithm: at a crossing, each rim continues along the other (Seifert's smoothing), which leaves simple loops. A ray
// from each gives the winding number beside it. Rims are moved by noise far below any tolerance first, so that they
// cross at single points or not at all; rims that share vertices do not cross there (see plane_cut.hpp).
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <vector>

#include "base/geometry.hpp"
#include "cut/plane_cut.hpp"

namespace rlacd {

struct RimRegion {
  int winding;                                    // never 0
  std::vector<std::vector<std::int32_t>> rims;    // loops of vertices
  std::vector<std::vector<PlanePoint>> outlines;  // the same as points
};

struct UncrossedSide {
  Mesh mesh;
  std::vector<RimRegion> regions;
};

// Outlines: of the side's rims, by `on_plane`. Nothing if there are more than four crossings for each corner of the
// rims: that many come from surfaces that lie on each other in many layers, and would multiply from cut to cut.
std::optional<UncrossedSide> uncross(OpenSide side, const std::vector<std::vector<PlanePoint>>& outlines);

}  // namespace rlacd
