// Gluing two solids that touch: the surface of their union.
//
// Input:  two closed triangle meshes with disjoint interiors, as two parts of one solid are.
// Output: the triangles of both except the regions where a triangle of one lies on an oppositely oriented triangle of
//         the other: there the solids touch and the union has no surface. Exact up to kCoincident; triangles cut along
//         such regions no longer share vertices with their neighbours, so the result is a surface to measure distances
//         to, not a mesh to cut.
// Algorithm: from every triangle, the coincident triangles of the other mesh are subtracted in the triangle's plane.
//         The part of a convex polygon outside a triangle is at most three convex polygons, so plain half-plane
//         clipping suffices. (A mesh boolean would need exactly coincident faces; two sides of a slanted cut agree only
//         to about 1e-16.)
#pragma once

#include "core/geometry.hpp"

namespace rlacd {

constexpr double kCoincident = 1e-8;  // distance at which faces count as touching; the frame's longest side is 2

Mesh glue(const Mesh& a, const Mesh& b);

// Adds the planes in which two solids touch.
void add_touching_planes(std::vector<Plane>& planes, const Mesh& a, const Mesh& b);

}  // namespace rlacd
