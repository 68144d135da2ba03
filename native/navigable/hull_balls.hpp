// Which balls a convex hull overlaps, and how deep.
//
// How: balls whose box misses the hull's box are passed over; of the others most are ruled out by one facet plane,
// often
//      by the one that ruled out the ball before; what is left is decided exactly.
#pragma once

#include "hull/convex_body.hpp"

namespace rlacd {

struct Intrusion {
  std::int32_t ball;
  double depth;  // radius minus the signed distance of the centre from the hull
};

// Those balls among `candidates` (all when null) that the hull reaches deeper than `least` into, in the order given.
// Depths are exact. With `first`, no more than one.
std::vector<Intrusion> intrusions(const ConvexBody& hull, const std::vector<Vec3>& centres,
                                  const std::vector<double>& radii, const std::vector<std::int32_t>* candidates,
                                  double least, bool first);

}  // namespace rlacd
