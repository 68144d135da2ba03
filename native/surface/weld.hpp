// From triangles with repeated corners to an indexed mesh.
#pragma once

#include <cstdint>
#include <vector>

#include "core/geometry.hpp"

namespace rlacd {

// For each point, the first point at the same place. Zeros of either sign are equal.
std::vector<std::int32_t> first_in_place(const std::vector<Vec3>& points);

// The distinct places of the vertices that faces use, in the order in which any vertex first has them, without zeros of
// negative sign; and the faces that have three different corners. Of those with the same corners, the first that is
// wound like most of them stays; it is a film if as many are wound in either way. Linear time.
struct Welded {
  Mesh mesh;
  std::vector<char> is_film;  // of each face
};
Welded weld(const Mesh& mesh);

// Whether each face is the first with its three corners, in any order. Linear time.
std::vector<char> first_of_doubled(const std::vector<Triangle>& faces, std::size_t vertices);

}  // namespace rlacd
