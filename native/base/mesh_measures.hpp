// Volume, area, axes and mass of triangle meshes, summed face by face: the same bits on every machine.
//
// Input:  vertices and faces; for the volume, of a closed oriented mesh.
// Output: the enclosed volume, the surface area, the principal axes of the surface, and the mass of the solid.
#pragma once

#include <array>
#include <vector>

#include "base/geometry.hpp"

namespace rlacd {

double mesh_volume(const std::vector<Vec3>& vertices, const std::vector<Triangle>& faces);
double mesh_area(const std::vector<Vec3>& vertices, const std::vector<Triangle>& faces);

// Unit vectors along the principal axes of the surface, longest first, the largest entry of each positive.
std::array<Vec3, 3> principal_axes(const std::vector<Vec3>& vertices, const std::vector<Triangle>& faces);

// Volume, centre of mass, and inertia about it, row-major, of the solid of density one in a closed mesh.
struct Mass {
  double volume = 0;
  Vec3 centre;
  std::array<Vec3, 3> inertia{};
};
Mass mesh_mass(const std::vector<Vec3>& vertices, const std::vector<Triangle>& faces);

}  // namespace rlacd
