#include "surface/near_boxes.hpp"

#include <algorithm>
#include <cmath>
#include <stdexcept>

#include "core/invariant.hpp"
#include "core/stop.hpp"

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
  const std::size_t count = boxes_.size();
  std::vector<char> is_new(count, 0);
  std::vector<std::size_t> places;
  for (const std::int32_t number : fresh) {
    const auto found = std::lower_bound(numbers_.begin(), numbers_.end(), number);
    if (found == numbers_.end() || *found != number) throw std::invalid_argument("there is no box of this number");
    places.push_back(static_cast<std::size_t>(found - numbers_.begin()));
    is_new[places.back()] = 1;
  }
  std::vector<std::array<std::int32_t, 2>> pairs;
  for (const std::size_t own : places) {
    poll_stop();
    std::vector<char> is_near(count, 0);
    std::vector<std::size_t> near;
    const auto take_near = [&](std::size_t box) {
      for (std::size_t other = 0; other < count; ++other)
        if (!is_near[other] && gap(boxes_[box], boxes_[other]) <= reach) is_near[other] = 1, near.push_back(other);
    };
    take_near(own);
    if (across)
      for (std::size_t i = 0, hops = near.size(); i < hops; ++i) take_near(near[i]);
    for (const std::size_t other : near)  // two new boxes find each other twice
      if (other != own && !(is_new[other] && other < own))
        pairs.push_back({numbers_[std::min(own, other)], numbers_[std::max(own, other)]});
  }
  std::sort(pairs.begin(), pairs.end());
  return pairs;
}

}  // namespace rlacd
