// Volume, area, axes and mass of triangle meshes, summed face by face: the same bits on every machine.
//
// Input:  a mesh, for the volume a closed oriented one; or points.
// Output: the enclosed volume, the surface area, the principal axes of the surface or points, the mass of the solid.
#pragma once

#include <array>

#include "core/geometry.hpp"

namespace rlacd {

double mesh_volume(const Mesh& mesh);
double mesh_area(const Mesh& mesh);

// Unit vectors along the principal axes of a surface, or of points, longest first, the largest entry of each positive.
std::array<Vec3, 3> principal_axes(const Mesh& mesh);
std::array<Vec3, 3> principal_axes(const std::vector<Vec3>& points);

// Volume, centre of mass, and inertia about it, row-major, of the solid of density one in a closed mesh.
struct Mass {
  double volume = 0;
  Vec3 centre;
  std::array<Vec3, 3> inertia{};
};
Mass mesh_mass(const Mesh& mesh);

}  // namespace rlacd
