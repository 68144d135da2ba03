// Which balls a convex hull overlaps, and how deeply.
//
// How: balls whose box misses the hull's box are skipped; most others are ruled out by one facet plane, often by the
// one
//      that ruled out the ball before; the rest are decided exactly.
#pragma once

#include "hull/convex_body.hpp"

namespace rlacd {

struct Intrusion {
  std::int32_t ball;
  double depth;  // radius minus the signed distance of the centre from the hull
};

// The balls among `candidates` (all if null) that the hull penetrates deeper than `least`, in the given order. Depths
// are exact. With `first`, at most one.
std::vector<Intrusion> intrusions(const ConvexBody& hull, const std::vector<Vec3>& centres,
                                  const std::vector<double>& radii, const std::vector<std::int32_t>* candidates,
                                  double least, bool first);

}  // namespace rlacd
