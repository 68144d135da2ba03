// How far a triangle is from a surface that it lies in, or from a solid that it lies in or inside.
//
// In:  a triangle; a surface; the same as one that encloses a solid.
// Out: an upper bound on the distance of its points: what rounding amounts to where it lies so, infinite where it does
//      not, or where it meets too many triangles to tell.
// How: what lies over triangles in its plane is clipped off; it is as far from each as its farthest corner. The rest is
//      split by the planes of the other triangles that it meets. Then no surface comes into a piece, so its middle
//      tells of all of it whether it is inside. A triangle that meets many others is halved.
#pragma once

#include "surface/surface.hpp"

namespace rlacd {

double lying_in(const Corners& triangle, const Bvh& surface);
double lying_inside(const Corners& triangle, const Surface& solid);

}  // namespace rlacd
