// Solids that touch face to face, reunited into one that can be cut again.
//
// Input:  closed triangle meshes with disjoint interiors, pieces of one solid.
// Output: their union, closed; nothing if rounding leaves it open or changes its volume.
// Algorithm: all faces in a plane where two solids touch are taken out. What is left ends in that plane in rims, run
// around one way by the solids below it and the other way by those above. Once both have a vertex wherever one meets
// the other, edges that run both ways vanish, and what the others bound is closed again: once, facing up or down.
#pragma once

#include <optional>
#include <vector>

#include "core/geometry.hpp"

namespace rlacd {

std::optional<Mesh> reunited(const std::vector<Mesh>& solids);

}  // namespace rlacd
