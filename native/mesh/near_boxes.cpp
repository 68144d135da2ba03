#include "mesh/near_boxes.hpp"

#include <algorithm>
#include <cmath>
#include <numeric>
#include <stdexcept>

#include "base/invariant.hpp"
#include "base/stop.hpp"

namespace rlacd {

namespace {

double gap(const Box& a, const Box& b) {
  double sum = 0;
  for (int axis = 0; axis < 3; ++axis) {
    const double own = std::max({a.lower[axis] - b.upper[axis], b.lower[axis] - a.upper[axis], 0.0});
    sum += own * own;
  }
  return std::sqrt(sum);
}

class SortedBoxes {
 public:
  SortedBoxes(const std::vector<Box>& boxes, double reach) : boxes_(boxes), reach_(reach), order_(boxes.size()) {
    std::iota(order_.begin(), order_.end(), 0);
    double least = std::numeric_limits<double>::infinity();
    for (int axis = 0; axis < 3 && !boxes.empty(); ++axis) {
      double low = boxes[0].lower[axis], high = low, longest = 0;
      for (const Box& box : boxes) {
        low = std::min(low, box.lower[axis]);
        high = std::max(high, box.lower[axis]);
        longest = std::max(longest, box.upper[axis] - box.lower[axis]);
      }
      const double share = (longest + reach) / std::max(high - low, std::numeric_limits<double>::min());
      if (axis == 0 || share < least) least = share, axis_ = axis, longest_ = longest;
    }
    std::sort(order_.begin(), order_.end(), [&](std::int32_t a, std::int32_t b) { return begin(a) < begin(b); });
  }

  // Calls take(i) for every box within reach of a box, itself included.
  template <class Take>
  void each_near(std::int32_t own, const Take& take) const {
    const double slack = 1e-9 * (1 + longest_);
    auto other = std::lower_bound(order_.begin(), order_.end(), begin(own) - reach_ - longest_ - slack,
                                  [&](std::int32_t i, double x) { return begin(i) < x; });
    for (; other != order_.end() && begin(*other) <= boxes_[own].upper[axis_] + reach_ + slack; ++other)
      if (gap(boxes_[own], boxes_[*other]) <= reach_) take(*other);
  }

 private:
  double begin(std::int32_t i) const { return boxes_[i].lower[axis_]; }

  const std::vector<Box>& boxes_;
  const double reach_;
  std::vector<std::int32_t> order_;
  int axis_ = 0;
  double longest_ = 0;  // extent along the axis: a box that holds a place begins at most this far before it
};

}  // namespace

void Boxes::add(std::int32_t number, const Box& box) {
  RLACD_ASSERT(numbers_.empty() || numbers_.back() < number, "numbers ascend");
  numbers_.push_back(number);
  boxes_.push_back(box);
}

Boxes Boxes::without(const std::vector<std::int32_t>& gone) const {
  Boxes left;
  for (std::size_t i = 0; i < boxes_.size(); ++i)
    if (std::find(gone.begin(), gone.end(), numbers_[i]) == gone.end()) left.add(numbers_[i], boxes_[i]);
  return left;
}

std::vector<std::array<std::int32_t, 2>> Boxes::pairs(const std::vector<std::int32_t>& fresh, double reach,
                                                      bool across) const {
  const SortedBoxes sorted(boxes_, reach);
  std::vector<char> is_new(boxes_.size(), 0);
  std::vector<std::int32_t> places;
  for (const std::int32_t number : fresh) {
    const auto found = std::lower_bound(numbers_.begin(), numbers_.end(), number);
    if (found == numbers_.end() || *found != number) throw std::invalid_argument("there is no box of this number");
    places.push_back(static_cast<std::int32_t>(found - numbers_.begin()));
    is_new[places.back()] = 1;
  }
  std::vector<std::array<std::int32_t, 2>> pairs;
  for (const std::int32_t own : places) {
    poll_stop();
    std::vector<char> is_near(boxes_.size(), 0);
    std::vector<std::int32_t> near;
    const auto take = [&](std::int32_t other) {
      if (!is_near[other]) is_near[other] = 1, near.push_back(other);
    };
    sorted.each_near(own, take);
    if (across)
      for (std::size_t i = 0, hops = near.size(); i < hops && near.size() < boxes_.size(); ++i)
        sorted.each_near(near[i], take);
    for (const std::int32_t other : near)  // two new boxes find each other twice
      if (other != own && !(is_new[other] && other < own))
        pairs.push_back({numbers_[std::min(own, other)], numbers_[std::max(own, other)]});
  }
  std::sort(pairs.begin(), pairs.end());
  return pairs;
}

}  // namespace rlacd
