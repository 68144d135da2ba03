#include "decompose/least_excess.hpp"

#include <algorithm>
#include <array>
#include <memory>
#include <queue>
#include <stdexcept>

#include "convex/hull.hpp"
#include "core/elementary.hpp"
#include "core/invariant.hpp"
#include "core/parallel.hpp"
#include "decompose/sections.hpp"

namespace rlacd {

namespace {

enum Side : std::size_t { kBelow, kAbove };

Side across(Side side) { return side == kBelow ? kAbove : kBelow; }

double box_volume(const Mesh& mesh) {
  const Box box = Box::of(mesh.vertices);
  const Vec3 e = box.upper - box.lower;
  return e.x * e.y * e.z;
}

// Lower bound on the volume between two parallel sections of a convex body, given the roots of their areas
// (Brunn-Minkowski).
double frustum(double root, double other, double height) {
  return height / 3 * (root * root + root * other + other * other);
}

// Lower bounds on the volumes of the hulls of everything below (or above) each plane: see the algorithm. `roots` are
// the square roots of the areas of the sections' hulls.
std::vector<double> least_hull_volumes(const Sections& sections, const std::vector<double>& roots, Side side) {
  struct Slice {
    double depth, root, volume;  // distance from the end; root of the area; volume between the end and here
  };
  const std::size_t planes = sections.planes();
  const double end = side == kBelow ? sections.lowest() : sections.highest();
  std::vector<Slice> majorant = {{0, std::sqrt(sections.end_area(side == kBelow)), 0}};
  std::vector<double> least(planes, 0);
  for (std::size_t i = 0; i < planes; ++i) {
    const std::size_t j = side == kBelow ? i : planes - 1 - i;
    if (sections.outline(j).empty()) continue;
    Slice next{std::fabs(sections.offset(j) - end), roots[j], 0};
    while (majorant.size() > 1) {
      const Slice &a = majorant[majorant.size() - 2], &b = majorant.back();
      if ((b.root - a.root) * (next.depth - a.depth) > (next.root - a.root) * (b.depth - a.depth)) break;
      majorant.pop_back();
    }
    const Slice& last = majorant.back();
    next.volume = last.volume + frustum(last.root, next.root, next.depth - last.depth);
    least[j] = next.volume;
    majorant.push_back(next);
  }
  return least;
}

// The planes of one direction, and the bounds known so far on the excesses of their sides.
class Direction {
 public:
  // Numbers are those of the bundle's planes among all candidates. The slack exceeds the rounding of volumes.
  Direction(const SolidMesh& mesh, const Bundle& bundle, std::vector<std::ptrdiff_t> numbers, double slack)
      : sections_(mesh, bundle.normal, bundle.offsets), slack_(slack), numbers_(std::move(numbers)) {
    std::vector<double> roots;
    for (std::size_t j = 0; j < planes(); ++j)
      roots.push_back(std::sqrt(outline_area(sections_.outline(j), sections_.normal())));
    for (std::size_t j = 1; j < planes(); ++j) {
      const double slab = frustum(roots[j - 1], roots[j], sections_.offset(j) - sections_.offset(j - 1));
      between_.push_back(std::max(slab - (solid(kBelow, j) - solid(kBelow, j - 1)) - slack_, 0.0));
    }
    for (const Side side : {kBelow, kAbove}) {
      least_[side].assign(planes(), 0);
      hulls_[side].resize(planes());
      const std::vector<double> volumes = least_hull_volumes(sections_, roots, side);
      for (std::size_t j = 0; j < planes(); ++j) raise(side, j, volumes[j] - solid(side, j) - slack_);
    }
    measure_extents();
  }

  std::size_t planes() const { return sections_.planes(); }
  std::ptrdiff_t number(std::size_t j) const { return numbers_[j]; }

  // Lower bound on the excess of a side.
  double least(Side side, std::size_t j) const { return least_[side][j]; }

  bool is_valid(std::size_t j, double least_solid, double sliver) const {
    const double below = sections_.offset(j) - sections_.lowest(), above = sections_.highest() - sections_.offset(j);
    return solid(kBelow, j) > least_solid && solid(kAbove, j) > least_solid &&
           below > sliver * std::max(below, extent_[kBelow][j]) && above > sliver * std::max(above, extent_[kAbove][j]);
  }

  // The excess of one side of a plane.
  double measure(Side side, std::size_t j) {
    std::size_t from = j;  // the nearest plane on this side with a known hull
    while (from != end(side) && !hulls_[side][from]) from = side == kBelow ? from - 1 : from + 1;
    std::vector<Vec3> points = sections_.outline(j);
    const auto append = [&points](Vec3 p) { points.push_back(p); };
    if (side == kBelow)
      sections_.for_each_inside(from + 1, j + 1, append);  // from the first slab beyond the known hulls
    else
      sections_.for_each_inside(j + 1, std::min(from, planes()) + 1, append);
    auto hull = from == end(side) ? std::make_unique<HullBuilder>(sections_.film())
                                  : std::make_unique<HullBuilder>(*hulls_[side][from]);
    hull->add(points);
    hull->drop_inner_points();
    const double excess = std::max(hull->volume() - solid(side, j), 0.0);
    hulls_[side][j] = std::move(hull);
    raise(side, j, excess - slack_);
    return excess;
  }

 private:
  // One past the outermost plane.
  std::size_t end(Side side) const { return side == kBelow ? static_cast<std::size_t>(-1) : planes(); }

  double solid(Side side, std::size_t j) const {
    return side == kBelow ? sections_.solid_below(j) : sections_.solid_above(j);
  }

  // The excess below a plane, plus the excess of the slabs up to a higher plane, bounds the excess below that one;
  // likewise the excess above a plane bounds those above all lower ones.
  void raise(Side side, std::size_t j, double excess) {
    while (least_[side][j] < excess) {
      RLACD_ASSERT(j < planes());
      least_[side][j] = excess;
      const std::size_t slab = side == kBelow ? j : j - 1;
      if (slab >= between_.size()) return;
      excess += between_[slab];
      side == kBelow ? ++j : --j;
    }
  }

  void measure_extents() {
    std::vector<Box> slabs(planes() + 1), sections(planes());
    for (std::size_t j = 0; j <= planes(); ++j)
      sections_.for_each_inside(j, j + 1, [&](Vec3 p) { slabs[j].extend(p); });
    for (std::size_t j = 0; j < planes(); ++j)
      for (const Vec3 p : sections_.outline(j)) sections[j].extend(p);
    for (const Side side : {kBelow, kAbove}) {
      extent_[side].resize(planes());
      Box box;
      for (std::size_t i = 0; i < planes(); ++i) {
        const std::size_t j = side == kBelow ? i : planes() - 1 - i;
        for (const Box& more : {slabs[side == kBelow ? j : j + 1], sections[j]})
          if (!more.is_empty()) box.extend(more);
        extent_[side][j] = box.is_empty() ? 0 : max_abs(box.upper - box.lower);
      }
    }
  }

  Sections sections_;
  const double slack_;
  std::vector<std::ptrdiff_t> numbers_;
  std::vector<double> between_;                // lower bound on the excess of the hull between planes j and j + 1
  std::array<std::vector<double>, 2> least_;   // by side and plane: a lower bound of the excess
  std::array<std::vector<double>, 2> extent_;  // the largest extent of the side's box
  std::array<std::vector<std::unique_ptr<HullBuilder>>, 2> hulls_;
};

class Search {
 public:
  Search(const Mesh& mesh, const std::vector<Vec3>& normals, const std::vector<double>& offsets,
         const LeastExcess& wanted, int threads)
      : wanted_(wanted), solid_(mesh) {
    const Bundles bundles = bundle_planes(normals, offsets);
    std::vector<std::vector<std::ptrdiff_t>> numbers;
    for (const Bundle& bundle : bundles.all) numbers.emplace_back(bundle.offsets.size(), -1);
    for (std::size_t i = bundles.place.size(); i-- > 0;)  // the first of equal planes counts
      numbers[bundles.place[i].bundle][bundles.place[i].plane] = static_cast<std::ptrdiff_t>(i);
    directions_.resize(numbers.size());
    const double slack = kRounding * box_volume(mesh);  // rounding of a hull's volume stays far below
    parallel_for(directions_.size(), threads, [&](std::size_t k) {
      directions_[k] = std::make_unique<Direction>(solid_, bundles.all[k], std::move(numbers[k]), slack);
    });
  }

  std::ptrdiff_t run() {
    for (const double sliver : wanted_.slivers)
      if (const std::ptrdiff_t found = run(sliver); found >= 0) return found;
    return -1;
  }

 private:
  // Neighbouring planes of one direction, none of them measured.
  struct Interval {
    double bound;  // lower bound on the costs of the planes still unmeasured
    std::size_t direction, first, last;

    bool operator<(const Interval& other) const {  // the greatest is looked at first
      if (bound != other.bound) return bound > other.bound;
      if (direction != other.direction) return direction > other.direction;
      return first > other.first;
    }
  };

  double cost(double below, double above) const {
    if (wanted_.exponent == 1) return below + above;
    if (wanted_.exponent == kInfinity) return std::max(below, above);
    return power(below, wanted_.exponent) + power(above, wanted_.exponent);
  }

  double bound(const Direction& direction, std::size_t j) const {
    return cost(direction.least(kBelow, j), direction.least(kAbove, j));
  }

  double limit() const { return least_cost_ + wanted_.tie; }

  // Valid candidates in an interval that are not ruled out.
  std::vector<std::size_t> open_planes(const Interval& interval, double sliver) const {
    const Direction& direction = *directions_[interval.direction];
    std::vector<std::size_t> open;
    for (std::size_t j = interval.first; j < interval.last; ++j)
      if (bound(direction, j) <= limit() && direction.is_valid(j, wanted_.least_solid, sliver)) open.push_back(j);
    return open;
  }

  void put(std::size_t direction, std::size_t first, std::size_t last, double sliver) {
    Interval interval{kInfinity, direction, first, last};
    for (const std::size_t j : open_planes(interval, sliver))
      interval.bound = std::min(interval.bound, bound(*directions_[direction], j));
    if (interval.bound < kInfinity) queue_.push(interval);
  }

  std::ptrdiff_t run(double sliver) {
    struct Measured {
      double cost;
      std::ptrdiff_t number;
    };
    std::vector<Measured> measured;
    for (std::size_t k = 0; k < directions_.size(); ++k) put(k, 0, directions_[k]->planes(), sliver);
    while (!queue_.empty()) {
      poll_stop();
      const Interval here = queue_.top();
      queue_.pop();
      const std::vector<std::size_t> open = open_planes(here, sliver);
      if (open.empty()) continue;
      const std::size_t middle = open[open.size() / 2];
      measured.push_back({measure(*directions_[here.direction], middle), directions_[here.direction]->number(middle)});
      least_cost_ = std::min(least_cost_, measured.back().cost);
      put(here.direction, here.first, middle, sliver);
      put(here.direction, middle + 1, here.last, sliver);
    }
    std::ptrdiff_t first = -1;
    for (const Measured& plane : measured)
      if (plane.cost < kInfinity && plane.cost <= limit() && (first < 0 || plane.number < first)) first = plane.number;
    return first;
  }

  // The cost of a plane; infinity if one side alone rules it out.
  double measure(Direction& direction, std::size_t j) {
    const Side side = direction.least(kBelow, j) >= direction.least(kAbove, j) ? kBelow : kAbove;
    const double excess = direction.measure(side, j);
    if (cost(excess, direction.least(across(side), j)) > limit()) return kInfinity;
    return cost(excess, direction.measure(across(side), j));
  }

  const LeastExcess wanted_;
  const SolidMesh solid_;
  std::vector<std::unique_ptr<Direction>> directions_;
  std::priority_queue<Interval> queue_;
  double least_cost_ = kInfinity;
};

}  // namespace

std::ptrdiff_t find_least_excess(const Mesh& mesh, const std::vector<Vec3>& directions,
                                 const std::vector<double>& offsets, const LeastExcess& wanted, int threads) {
  if (!(wanted.exponent >= 1)) throw std::invalid_argument("the exponent of a norm is at least 1");
  if (!(wanted.tie >= 0)) throw std::invalid_argument("a tie is not negative");
  return Search(mesh, directions, offsets, wanted, threads).run();
}

}  // namespace rlacd
