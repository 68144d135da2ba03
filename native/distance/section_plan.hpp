// The sections that a clip leaves open, laid out for triangulation.
#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "distance/convex_clip.hpp"

namespace rlacd {

// The sections, each in its own plane, moved side by side into one plane: they can be triangulated together.
struct SectionPlan {
  std::vector<std::int32_t> corners;       // vertices of all rims, one rim after the other
  std::vector<PlanePoint> outline;         // the same as points of the plane
  std::vector<std::int32_t> rim_ends;      // places in `corners` at which the rims end
  std::vector<std::int32_t> section_ends;  // numbers of rims at which the sections end
};
SectionPlan side_by_side(const ConvexClip& clip);

}  // namespace rlacd
