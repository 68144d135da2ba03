// How far a closed solid is from its convex hull, certified.
//
// In:  a part (closed triangle mesh), its convex hull (closed, convex, holding the part), their volumes.
// Out: max(H_b, 0.3 R_v), the concavity of Wei et al., "Approximate Convex Decomposition for 3D Meshes with
//      Collision-Aware Concavity and Tree Search" (2022), where R_v = cbrt(3 (|hull| - |part|) / 4 pi) and H_b is the
//      two-sided Hausdorff distance between the two *surfaces*; as an interval, or as a strict decision.
// How: both one-sided distances are maxima of a minimum of convex functions, bounded as branch_and_bound.hpp says:
//      part -> hull: inside a convex polytope the distance to its surface is the least distance to a facet's plane;
//      hull -> part: the distance to the nearest of the part's triangles, found through a tree of boxes.
#pragma once

#include "convex/convex_body.hpp"
#include "surface/branch_and_bound.hpp"
#include "surface/surface.hpp"

namespace rlacd {

// The weight of R_v, as in the original definition.
constexpr double kVolumeWeight = 0.3;

struct Concavity {
  Interval part_to_hull, hull_to_part;
  double volume_radius = 0;  // R_v

  Interval value() const {
    return {std::max({part_to_hull.lower, hull_to_part.lower, kVolumeWeight * volume_radius}),
            std::max({part_to_hull.upper, hull_to_part.upper, kVolumeWeight * volume_radius})};
  }
};

double volume_radius(double part_volume, double hull_volume);

// The interval of the value is at most `tolerance` wide; that of a one-sided distance may be wider below the value,
// where the other terms decide it. Values up to `floor` need not be resolved: the interval may then be (0, floor).
// `tree` is the part's, whatever its hull.
Concavity concavity(const Mesh& part, const ConvexBody& hull, double part_volume, double hull_volume, double tolerance,
                    double floor, const TreeCache& tree);

// True only if the concavity is certainly <= threshold. False if it is larger, or within 1e-3 of the threshold and
// undecided.
bool meets_concavity(const Mesh& part, const ConvexBody& hull, double part_volume, double hull_volume, double threshold,
                     const TreeCache& tree);

}  // namespace rlacd
