// The corners of a convex polytope around a convex polytope, moved until they stick out about equally.
//
// In:  an outer and an inner convex hull; a distance that is little enough.
// Out: an outer hull with no more corners that sticks out less, or the given one if that sticks out little enough.
// How: what lies farthest out is a corner, and a corner alone cannot come in: its facets touch the inner hull, so its
//      neighbours have to go out. Each step therefore moves all corners at once: in towards the inner hull, by a power
//      of their distance that grows from step to step (from the mean to the maximum), and out where a facet cuts the
//      inner hull, each corner by its share (the barycentric coordinate of the deepest point). The hull is then taken
//      anew. Scaled up about the middle until it holds the inner hull, each state is a result. Kept is the one with the
//      least volume among those that stick out little enough, or the one that sticks out least.
// A ball's hull of 64 corners that only has little volume sticks out by 8 to 10 % of the radius, this one by 4.7 to
// 4.9 %. No 64 corners stick out by less than 3.9 %.
#pragma once

#include "convex/convex_body.hpp"

namespace rlacd {

Mesh evened_out(Mesh outer, const ConvexBody& inner, double enough);

}  // namespace rlacd
