// Pieces of a solid: what a cut or a search for connected bodies leaves, each with its volume and its hull.
//
// Input:  a closed oriented triangle mesh.
// Output: its sides below and above a plane, or its connected pieces; closed.
// Algorithm: cut by the plane and capped; bodies, with each cavity in the smallest shell around it.
#pragma once

#include <array>
#include <optional>
#include <vector>

#include "convex/convex_body.hpp"

namespace rlacd {

struct Piece {
  Mesh mesh, hull;
  double volume, hull_volume;
};

// Nothing if the volume is not above the least, or the mesh is flat.
std::optional<Piece> piece_of(Mesh mesh, double least);

std::array<std::optional<Piece>, 2> cut(const Mesh& mesh, Vec3 normal, double offset, double least);

// The direction between the middles of the two hulls around that would grow the least by all of a piece; none if there
// are no two such hulls apart. Around a round hole it follows the hole, which no axis does.
std::vector<Vec3> between(const ConvexBody& hull, const std::vector<const ConvexBody*>& around);

// The sides of a plane at a share of a piece's length along the direction of those in which it is longest, the smaller
// first; none if one would be empty.
std::vector<Piece> halve(const Mesh& piece, const ConvexBody& hull, const std::vector<Vec3>& directions, double share,
                         double least);

// Nothing if all is one piece.
std::optional<std::vector<Piece>> connected_pieces(const Mesh& mesh, double least);

}  // namespace rlacd
