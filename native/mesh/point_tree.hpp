// A k-d tree over points: which of them lie in a ball. Building takes O(n log n).
#pragma once

#include <cstdint>
#include <vector>

#include "base/geometry.hpp"

namespace rlacd {

class PointTree {
 public:
  explicit PointTree(std::vector<Vec3> points);

  // Appends the indices of the points that are at most `radius` away from x, ascending.
  void within(Vec3 x, double radius, std::vector<std::int32_t>& found) const;

 private:
  // A node holds the points order_[begin, end). Its children are the halves of that range; with the next nodes in
  // depth-first order, the first child follows its parent, and the second follows all nodes of the first.
  struct Node {
    Box box;
    std::int32_t begin, end;
    std::int32_t next = 0;  // the node after this one and all below it
    bool is_leaf;
  };
  void build(std::int32_t begin, std::int32_t end);

  std::vector<Vec3> points_;  // in the order of the leaves
  std::vector<std::int32_t> order_;
  std::vector<Node> nodes_;
};

}  // namespace rlacd
