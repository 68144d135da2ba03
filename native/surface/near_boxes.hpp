// Boxes under numbers, and pairs of them that are near each other.
//
// Input:  boxes, which of them are new, and a distance.
// Output: pairs of a new box and any other, ascending: those within reach of each other, or of a common third box.
#pragma once

#include <array>
#include <vector>

#include "core/geometry.hpp"

namespace rlacd {

class Boxes {
 public:
  std::size_t size() const { return boxes_.size(); }
  // Its number has to be larger than all before.
  void add(std::int32_t number, const Box& box);
  Boxes without(const std::vector<std::int32_t>& gone) const;
  std::vector<std::array<std::int32_t, 2>> pairs(const std::vector<std::int32_t>& fresh, double reach,
                                                 bool across) const;

 private:
  std::vector<std::int32_t> numbers_;
  std::vector<Box> boxes_;
};

}  // namespace rlacd
