// Balls that represent the navigable space around a solid.
//
// In:  a closed surface and its convex hull; the radius r of the moving ball, and the tolerance t.
// Out: balls with their centres on the boundary of the space, each as large as leaves t to the surface (so r at least),
//      those that touch the hull.
// The space: points outside the solid, at least r + t from its surface, at most r from the hull, where a ball of radius
// r stays out of the closed half-spaces, and which the centre of such a ball can reach.
// How: cells that the boundary crosses (clearance_grid.hpp) give one candidate each, moved exactly onto the boundary;
//      in creases, where several points of the surface are nearest, onto the crease. Sides of the surface are decided
//      by the winding number, once per connected region; reachability by ball_reach.hpp. Then candidates are taken
//      greedily, the sharpest first, unless a ball is already there. The same bits for any number of threads.
#pragma once

#include "decompose/navigable_field.hpp"
#include "surface/surface.hpp"

namespace rlacd {

struct Balls {
  std::vector<Vec3> centres;
  std::vector<double> radii;
};

struct BallSources {
  bool reachable_only = true;
  bool outside = true;      // balls come from outside ...
  std::vector<Vec3> seeds;  // ... or from here
};

// Centres are no closer than this share of the radius of the smaller ball. A point of the boundary is no farther from
// one than that plus the distance to the next candidate, which is about half the pitch.
constexpr double kBallSpacing = 0.45;

Balls spread_balls(const Surface& surface, const NavigableField& field, const BallSources& sources, double pitch,
                   int threads);

// The balls among `candidates` (all if null) that the hull penetrates deeper than `least`, in the given order, and the
// depths: the radius minus the signed distance of the centre from the hull, exact. With `first`, at most one. Most
// balls are ruled out by one facet plane, often by the one that ruled out the ball before; the rest are decided
// exactly.
std::pair<std::vector<std::int32_t>, std::vector<double>> intrusions(const ConvexBody& hull, const Balls& balls,
                                                                     const std::vector<std::int32_t>* candidates,
                                                                     double least, bool first);

}  // namespace rlacd
