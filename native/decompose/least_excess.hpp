// The plane whose two sides fill their hulls best, found among many candidates without building all their hulls.
//
// Input:  a closed triangle mesh, candidate planes n.x = d, and the cost to minimise: the p-norm of the two sides'
//         excesses. The excess of a side is the volume of its hull minus that of its solid.
// Output: the first of the valid candidates with the least cost, up to ties.
// Algorithm: branch and bound. As a plane moves up, the excess below it can only grow and the one above it only shrink,
//         since the hull gains at least the solid that the side gains. (Where a solid overlaps itself, the overlap
//         counts twice, and bounds may be too high by its volume.) So a measured hull bounds the costs of all
//         planes of its direction on one side of it; the excess of the solid's own sections between them tightens the
//         bound. Before any hull is built, sections bound them: the square root of the area of a convex body's section
//         is a concave function of its height (Brunn-Minkowski), and at every plane it is at least that of the hull of
//         the solid's own section. So the hull's volume is at least the integral of the square of the least concave
//         function above these roots. Of the neighbouring planes with the least bound, the middle one is measured, its
//         larger excess first: that alone may rule it out. A seventh of all hulls are built, and each grows from the
//         nearest existing one.
#pragma once

#include <cstddef>
#include <vector>

#include "core/geometry.hpp"

namespace rlacd {

struct LeastExcess {
  double exponent;     // p: at least 1; infinity for the maximum of the two
  double tie;          // costs (p-th powers of norms, where p is finite) no farther apart than this are equal
  double least_solid;  // a valid plane leaves more than this volume on both sides
  std::vector<double>
      slivers;  // and sides thicker than this share of their largest extent: the first share that some plane meets
};

// Number of the plane among K directions times M offsets (row-major), or -1 where no plane is valid. Threads cut the
// sections of the directions side by side; the result does not depend on them.
std::ptrdiff_t find_least_excess(const Mesh& mesh, const std::vector<Vec3>& directions,
                                 const std::vector<double>& offsets, const LeastExcess& wanted, int threads);

}  // namespace rlacd
