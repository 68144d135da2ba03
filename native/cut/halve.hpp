// Halving a piece of a solid where the hulls around it can best share it.
//
// In:  a closed mesh, the corners of its hull, the corners and volumes of the hulls around, a share of its length.
// Out: its sides below and above a plane across the direction between the middles of the two hulls that would grow the
//      least by all of it; none if there are no two such hulls apart. Around a round hole the plane follows the hole,
//      which no axis does.
#pragma once

#include "cut/pieces.hpp"

namespace rlacd {

struct HullAround {
  const std::vector<Vec3>* corners;
  double volume;
};

std::array<std::optional<Piece>, 2> halve(const Mesh& piece, const std::vector<Vec3>& corners,
                                          const std::vector<HullAround>& around, double share, double least);

}  // namespace rlacd
