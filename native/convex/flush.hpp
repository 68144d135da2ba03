// Where two convex polytopes lie flush, and what one fills of the other with some of its sides moved outwards.
//
// In:  convex bodies, by their flat sides.
// Out: the sides at which one touches the other, with places spread over the contact; the corners of a layer.
// How: polygons are clipped by planes.
#pragma once

#include "convex/convex_body.hpp"

namespace rlacd {

struct Contact {
  std::vector<std::int32_t> sides;  // of the first body
  std::vector<Vec3> places;         // on the other, moved a little towards the middle of each contact
};
// Where a side of another body, turned the other way, lies less deep than `depth` under a side of the first. Sides
// count as touching up to `touch`.
Contact contact(const ConvexBody& body, const ConvexBody& other, double depth, double touch);

// What another body fills of the first with some of its sides, and those nearly parallel to them, moved outwards by
// `depth`: points whose hull it is; none if it is empty. Planes that the other crosses by at most `touch` are left out.
std::vector<Vec3> layer(const ConvexBody& body, const ConvexBody& other, const std::vector<std::int32_t>& sides,
                        double depth, double touch);

}  // namespace rlacd
