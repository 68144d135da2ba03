// How much of a convex hull a solid fills.
//
// In:  a closed, oriented triangle mesh of any shape and a tree of boxes over it; a convex hull, whose corners and
//      facets may lie on the solid's.
// Out: the volume of what both hold. It is never less than that by more than rounding, and larger by at most 3e-8 of
//      the hull's volume.
// How: the flux of p / 3 through the surface of what both hold. Through a face of the solid it is that of the whole
// face
//      times the share of it within the hull. Through a facet of the hull it is the facet's distance from the centre
//      times the area of the solid's section, a sum over the faces that cross the facet's plane: each adds the triangle
//      between its segment within the facet and a corner of the facet. What is inside the solid along the side opposite
//      to that corner is summed from the crossings with the whole line behind its end, each by the length it changes.
//      Every term changes continuously with the places of hull and solid, but for a face in a facet's plane: the hull
//      is made larger by a tiny share of itself, so that what touches it lies within. Nothing is traced or decided from
//      several crossings, so nothing can be contradictory.
#pragma once

#include "convex/convex_body.hpp"
#include "surface/surface.hpp"

namespace rlacd {

double filled(const Mesh& solid, const Surface& surface, const ConvexBody& hull);

}  // namespace rlacd
