// Caps: what closes a solid where a plane cuts it.
//
// Input:  one side of a cut with the rims of its cap (see plane_cut.hpp).
// Output: the closed side, and how much of the cap is upside down.
// Algorithm: rims are triangulated. They cross where a solid overlaps itself; triangles between them may lead out of
// the solid. If more than `kFolded` of the cap does, rims are taken apart into loops that do not cross,
// which close the solid exactly as often as it overlaps itself, unless there are too many crossings.
#pragma once

#include "solid/plane_cut.hpp"

namespace rlacd {

// Share of a cap's area that may be upside down where a solid overlaps itself by a hair: vertices at crossings would
// pile up there, cut after cut.
constexpr double kFolded = 1e-2;

// Closes loops of vertices in a plane so many times, upside down if that is negative; returns the area of what it adds,
// all of it and what is upside down without being asked for.
struct CapArea {
  double all = 0, folded = 0;
};
CapArea add_caps(std::vector<Triangle>& faces, const std::vector<Vec3>& vertices, const Loops& rims, Vec3 outward,
                 int times = 1);

// New vertices, one for each crossing of rims that were taken apart, follow the others.
Mesh capped(OpenSide side, Vec3 outward);

}  // namespace rlacd
