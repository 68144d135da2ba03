// Volume, area and moments of triangle meshes, summed face by face: the same bits on every machine.
//
// Input:  vertices and faces; for the volume, of a closed oriented mesh.
// Output: the enclosed volume, the surface area, and the second moments of the surface.
#pragma once

#include <array>
#include <vector>

#include "base/geometry.hpp"

namespace rlacd {

double mesh_volume(const std::vector<Vec3>& vertices, const std::vector<Triangle>& faces);
double mesh_area(const std::vector<Vec3>& vertices, const std::vector<Triangle>& faces);

// Second moments of the surface about its centroid, row-major, up to a positive factor.
std::array<Vec3, 3> mesh_moments(const std::vector<Vec3>& vertices, const std::vector<Triangle>& faces);

}  // namespace rlacd
