// A tree of boxes over triangles that answers "which point of the surface is closest?".
//
// In:  a triangle mesh of any quality: open, self-intersecting, with degenerate triangles.
// Out: closest points, exact up to rounding.
// How: top-down build, each node split where the surface-area heuristic is least over eight bins along the longest axis
//      of its centroids (halved by count if that fails or the tree gets deep); a node holds the boxes of both its
//      children, and a query visits the nearer child first and prunes by the best distance so far.
#pragma once

#include <limits>
#include <vector>

#include "base/geometry.hpp"
#include "distance/triangle.hpp"

namespace rlacd {

// A tree over the first faces of a mesh, without boxes: its leaves hold them in their order. It is what clipping leaves
// of the tree over a solid, and saves sorting the faces again.
struct TreeShape {
  // A child is a node (child >= 0) or a leaf that holds the faces [~child, ~child + leaf_size).
  struct Node {
    std::int32_t child[2] = {-1, -1};
    std::int32_t leaf_size[2] = {0, 0};
  };
  std::vector<Node> nodes;  // before their children
  std::size_t faces = 0;
};

class Bvh {
 public:
  explicit Bvh(const Mesh& mesh, int threads = 1);  // which do not change the tree
  // The faces beyond those of the shape get a tree of their own beside it.
  Bvh(const Mesh& mesh, const TreeShape& shape);

  // Triangles are stored in the order of the leaves; a *slot* is a position in that order.
  struct Hit {
    Vec3 point;
    double distance2 = std::numeric_limits<double>::infinity();
    std::int32_t slot = -1;
  };

  // The closest point to p. A hint (the slot of a triangle expected to be near) only makes the query faster. The search
  // ends at the first triangle within `enough`: the distance is then at most `enough`, not the least. If no triangle is
  // nearer than `within`, the slot is -1.
  Hit closest(Vec3 p, std::int32_t hint = -1, double enough = 0,
              double within = std::numeric_limits<double>::infinity()) const;

  double distance(std::int32_t slot, Vec3 p) const { return distance_to_triangle(triangles_[slot], p); }
  std::int32_t face(std::int32_t slot) const { return faces_[slot]; }
  std::size_t size() const { return triangles_.size(); }

  // A child is a node (child >= 0) or a leaf that holds the slots [~child, ~child + leaf_size).
  struct Node {
    Box box[2];
    std::int32_t child[2] = {-1, -1};
    std::int32_t leaf_size[2] = {0, 0};
  };
  // Nodes come before their children.
  const std::vector<Node>& nodes() const { return nodes_; }
  const TriangleFrame& triangle(std::int32_t slot) const { return triangles_[slot]; }

 private:
  void hold(const Mesh& mesh, std::int32_t face);

  std::vector<Node> nodes_;
  std::vector<TriangleFrame> triangles_;
  std::vector<std::int32_t> faces_;
};

}  // namespace rlacd
