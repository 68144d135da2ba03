#include "distance/section_plan.hpp"

#include <algorithm>
#include <limits>

#include "cut/plane_cut.hpp"

namespace rlacd {

SectionPlan side_by_side(const ConvexClip& clip) {
  constexpr double kApart = 1.1;  // of a section's width, from its left end to the next one's
  SectionPlan plan;
  double x = 0;
  for (const ConvexClip::Section& section : clip.sections) {
    const std::size_t first = plan.outline.size();
    for (const std::vector<std::int32_t>& rim : section.rims) {
      std::vector<Vec3> points;
      points.reserve(rim.size());
      for (const std::int32_t i : rim) points.push_back(clip.mesh.vertices[i]);
      const std::vector<PlanePoint> outline = on_plane(points, section.normal);
      plan.corners.insert(plan.corners.end(), rim.begin(), rim.end());
      plan.outline.insert(plan.outline.end(), outline.begin(), outline.end());
      plan.rim_ends.push_back(static_cast<std::int32_t>(plan.corners.size()));
    }
    plan.section_ends.push_back(static_cast<std::int32_t>(plan.rim_ends.size()));
    double left = std::numeric_limits<double>::infinity(), right = -left;
    for (std::size_t i = first; i < plan.outline.size(); ++i)
      left = std::min(left, plan.outline[i][0]), right = std::max(right, plan.outline[i][0]);
    for (std::size_t i = first; i < plan.outline.size(); ++i) plan.outline[i][0] += x - left;
    x += kApart * (right - left);
  }
  return plan;
}

}  // namespace rlacd
