// Candidate planes at concave edges of a solid.
//
// Input:  a closed triangle mesh, its convex hull, and how many edges are wanted.
// Output: edges in the order of choice, and up to three planes for each: the one that halves the reflex angle and those
//         of the edge's two faces, near-duplicates left out.
// Algorithm: every reflex edge is weighed by its depth below the hull's surface, its angle and the length of its whole
// crease. They are chosen one after the other, the weight multiplied by the distance to the nearest one chosen and by
// how much the edge's planes differ from theirs. (J. Andrews, "Navigation-Driven Approximate Convex Decomposition",
// SIGGRAPH 2024.) Depth is first bounded by the largest facets of the hull; only the best are weighed exactly.
#pragma once

#include <cstddef>
#include <vector>

#include "cut/reflex_edges.hpp"

namespace rlacd {

struct CandidatePlane {
  Vec3 normal;  // of unit length, its largest coordinate positive
  double offset;
};

// Up to `count` of a mesh's reflex edges; those that offer no new plane are never chosen.
std::vector<ReflexEdge> choose_concave_edges(const Mesh& mesh, const Mesh& hull, std::size_t count);

// The planes of these edges. A face's plane is moved out until the face, and what is coplanar with it in single
// precision, lies wholly on one side: by nothing where the plane is normal to a coordinate axis (such cuts are exact),
// else by a hair. On the face itself rounding would decide for every corner on which side it comes to lie, and the part
// beyond would carry the face along as a film.
std::vector<CandidatePlane> planes_of_edges(const Mesh& mesh, const Mesh& hull, const std::vector<ReflexEdge>& edges);

}  // namespace rlacd
