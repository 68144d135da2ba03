// The part of a closed solid inside a convex polytope, without a general boolean.
//
// In:  a closed, oriented triangle mesh and a tree of boxes over it; a convex polytope.
// Out: the faces inside, clipped; and for every facet that cuts the solid, the rims of the section, which is to be
//      triangulated in the facet's plane. The surface with these caps is closed.
// How: The facet planes are moved out by different tiny amounts, so that no four of them meet in a point and none
//      passes through a corner of the solid. The faces that the tree finds to cross planes are clipped one plane after
//      the other (Sutherland and Hodgman, "Reentrant Polygon Clipping", 1974). A corner made by clipping is known by
//      the edge and the plane, or by the face and the two planes, that made it: faces agree on the corners they share.
//      Clipping leaves open paths on a facet that end on its sides. From the crossings with the solid along every edge
//      of the polytope follows which parts of it are inside; these join the paths to loops.
//      Where rounding makes crossings contradict each other there is no result: callers use a boolean then.
#pragma once

#include <optional>
#include <vector>

#include "convex/convex_body.hpp"
#include "solid/plane_cut.hpp"
#include "surface/surface.hpp"

namespace rlacd {

struct ConvexClip {
  struct Section {
    Vec3 normal;  // of the facet, outwards
    Loops rims;   // counter-clockwise around what is inside
  };
  Mesh mesh;  // without the caps
  std::vector<Section> sections;
};

std::optional<ConvexClip> clip_to_convex(const Mesh& solid, const Surface& surface, const ConvexBody& hull);

}  // namespace rlacd
