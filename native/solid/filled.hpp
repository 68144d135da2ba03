// How much of a convex hull a solid fills.
//
// In:  a closed, oriented triangle mesh of any shape and a tree of boxes over it; a convex hull, whose corners and
//      facets may lie on the solid's.
// Out: the volume of what both hold: never less by more than rounding, larger by at most 3e-8 of the hull's volume.
// How: the flux of p / 3 through the surface of what both hold. Through a face of the solid it is that of the whole
//      face times the share of it within the hull. Through a facet of the hull it is the facet's distance from the
//      centre times the area of the solid's section, a sum over the faces that cross the facet's plane: each adds the
//      triangle between its segment within the facet and a corner of the facet. To these comes the triangle between
//      that corner and what is inside the solid along the side across: a sum over the crossings with the side's whole
//      line, each by how much of the side comes after it; or all or nothing, as the neighbour knows where no face
//      crosses the side. Every term changes continuously with the places of hull and solid, but for a face in a facet's
//      plane: the hull grows by a tiny share of itself, so that what touches it lies within. Nothing is traced or
//      decided from several crossings, so nothing can be contradictory. Where the solid overlaps itself, it counts as
//      often as it is there.
#pragma once

#include "convex/convex_body.hpp"
#include "surface/surface.hpp"

namespace rlacd {

double filled(const Mesh& solid, const Surface& surface, const ConvexBody& hull);

}  // namespace rlacd
