#include "decompose/spread_balls.hpp"

#include <map>
#include <numeric>
#include <unordered_map>

#include "core/parallel.hpp"
#include "core/stop.hpp"
#include "decompose/ball_reach.hpp"

namespace rlacd {
namespace {

// Above this, the surfaces that are nearest to a place and to another meet at an angle.
constexpr double kMeeting = 0.15;

struct Candidate {
  Vec3 at;
  double radius = 0;
  double clearance = 0;
  double sharpness = 0;
};

// Climbs to the boundary from nearby. In a crease, the surface points that were nearest on the way are kept at the
// level together, up to three at a time: Newton's method on the planes in front of them.
class Climb {
 public:
  Climb(const NavigableField& field, Vec3 x, const NavigableField::Value& value)
      : field_(field), start_(x), x_(x), value_(value) {}

  // A surface point that was nearest elsewhere may be in the way here too.
  void beware(Vec3 there, const NavigableField::Value& value_there) { see(there, value_there); }

  // Pushes away from whatever is too near, repeatedly.
  bool by_pushing(double farthest) {
    for (int push = 0; push < kPushes && !is_there(); ++push) {
      see(x_, value_);
      if (!move((field_.level() - value_.value) * value_.uphill, farthest)) return false;
    }
    return is_there();
  }

  // The first step goes into the crease between the nearest surface here and the one to watch.
  bool into_crease(double farthest) {
    for (int step = 0; step == 0 || (step < kSteps && !is_there()); ++step) {
      see(x_, value_);
      if (!move(correction(), farthest)) return false;
    }
    return is_there();
  }

  Vec3 at() const { return x_; }
  const NavigableField::Value& value() const { return value_; }

  // 0 on a smooth place; in a crease, the more the sides disagree, 2 between two that face each other; in a corner of
  // three, as if they disagreed a little more. Sides that face each other need not quite be touched at the same time.
  double sharpness() {
    see(x_, value_);
    const double exactly = kTouched * field_.radius(), nearly = kNearlyTouched * field_.radius();
    double off[kMost], sharpest = 0;
    for (int a = 0; a < count_; ++a) {
      off[a] = std::fabs(value_at(seen_[a]));
      for (int b = 0; b < a; ++b) {
        const double disagreement = 1 - dot(seen_[a].uphill, seen_[b].uphill);
        if (std::max(off[a], off[b]) <= (disagreement > kFacing ? nearly : exactly))
          sharpest = std::max(sharpest, disagreement);
      }
    }
    if (count_ == 3 && std::max({off[0], off[1], off[2]}) <= exactly)
      sharpest = std::max(sharpest, kCorner * std::fabs(dot(cross(seen_[0].uphill, seen_[1].uphill), seen_[2].uphill)));
    return sharpest;
  }

 private:
  static constexpr int kMost = 3, kSteps = 8, kPushes = 32;
  static constexpr double kCorner = 1.5, kFacing = 1.8;
  static constexpr double kTouched = 0.02, kNearlyTouched = 0.1;  // shares of the radius
  static constexpr double kSame = 0.97;
  struct Seen {
    Vec3 level;  // a point of the plane on which this is at the level
    Vec3 uphill;
  };

  // At the level, or above it: then down to it.
  bool is_there() {
    if (value_.value < field_.level() - kHair) return false;
    x_ = x_ - (value_.value - field_.level()) * value_.uphill;
    value_.value = field_.level();
    return true;
  }

  bool move(Vec3 step, double farthest) {
    x_ = x_ + step;
    if (!(max_abs(x_ - start_) <= farthest)) return false;
    value_ = field_.room_near(x_, value_.slot);
    return true;
  }

  double value_at(const Seen& seen) const { return dot(x_ - seen.level, seen.uphill); }

  // Adds the nearest surface, replacing one that is nearly the same, or the oldest.
  void see(Vec3 x, const NavigableField::Value& value) {
    const Seen seen = {x + (field_.level() - value.value) * value.uphill, value.uphill};
    for (int i = 0; i < count_; ++i)
      if (dot(seen_[i].uphill, seen.uphill) > kSame) {
        std::rotate(seen_ + i, seen_ + i + 1, seen_ + count_);
        seen_[count_ - 1] = seen;
        return;
      }
    if (count_ == kMost) std::rotate(seen_, seen_ + 1, seen_ + kMost), --count_;
    seen_[count_++] = seen;
  }

  // The smallest step onto the planes of all surfaces seen, or of the newest if those hardly intersect.
  Vec3 correction() {
    for (; count_ > 1; std::rotate(seen_, seen_ + 1, seen_ + count_), --count_) {
      const Vec3 a = seen_[count_ - 1].uphill, b = seen_[count_ - 2].uphill;
      const double ha = -value_at(seen_[count_ - 1]), hb = -value_at(seen_[count_ - 2]);
      const Vec3 along = cross(a, b);
      if (count_ == 2) {
        const double ab = dot(a, b), sine2 = norm2(along);
        if (sine2 > kMeeting) return ((ha - ab * hb) / sine2) * a + ((hb - ab * ha) / sine2) * b;
      } else {
        const Vec3 c = seen_[0].uphill;
        const double hc = -value_at(seen_[0]), volume = dot(along, c);
        if (std::fabs(volume) > kMeeting) return (1 / volume) * (ha * cross(b, c) + hb * cross(c, a) + hc * along);
      }
    }
    return -value_at(seen_[0]) * seen_[0].uphill;
  }

  const NavigableField& field_;
  Vec3 start_, x_;
  NavigableField::Value value_;
  Seen seen_[kMost];
  int count_ = 0;
};

// Finds cells whose uphill directions converge: there the boundary has a crease.
class Meeting {
 public:
  explicit Meeting(const ClearanceGrid& grid) : grid_(grid), index_(grid.size(), -1) {
    for (std::size_t i = 0; i < grid.boundary.size(); ++i)
      if (grid.boundary[i].room.by != NavigableField::Limit::kHull)  // smooth, but where no ball would touch the hull
        index_[grid.boundary[i].cell] = static_cast<std::int32_t>(i);
  }

  // The neighbour whose uphill direction opposes a cell's most; none on a smooth part.
  const ClearanceGrid::Crossed* at(const ClearanceGrid::Crossed& crossed) const {
    if (index_[crossed.cell] < 0) return nullptr;
    const ClearanceGrid::Crossed* found = nullptr;
    double most = kMeeting;
    grid_.for_neighbours(crossed.cell, [&](std::int32_t cell, Vec3 there) {
      if (index_[cell] < 0) return;
      const ClearanceGrid::Crossed& other = grid_.boundary[index_[cell]];
      const double meet = dot(crossed.room.uphill - other.room.uphill, normalized(there));
      if (meet > most) most = meet, found = &other;
    });
    return found;
  }

 private:
  const ClearanceGrid& grid_;
  std::vector<std::int32_t> index_;  // into the boundary, by cell
};

class Spreading {
 public:
  Spreading(const Surface& surface, const NavigableField& field, double pitch, int threads)
      : surface_(surface), field_(field), threads_(threads), grid_(clearance_grid(field, pitch, threads)) {}

  Balls run(const BallSources& sources) {
    BallReach reach(field_, grid_);
    const std::vector<Candidate> candidates = on_boundary(reach);
    return spread(reachable(candidates, sources, reach));
  }

 private:
  // Candidates whose ball touches the hull, in the order of the cells they come from.
  std::vector<Candidate> on_boundary(BallReach& reach) const {
    const std::size_t count = grid_.boundary.size();
    std::vector<bool> wanted(count);
    for (std::size_t i = 0; i < count; ++i) wanted[i] = !is_inside(grid_.boundary[i].cell, reach);
    const Meeting meeting(grid_);
    std::vector<Candidate> all(2 * count);
    const auto find = [&](std::size_t i) {
      if (!wanted[i]) return;
      const ClearanceGrid::Crossed& crossed = grid_.boundary[i];
      const ClearanceGrid::Crossed* other = meeting.at(crossed);
      if (crossed.room.value >= field_.level())
        all[2 * i] = down_from(crossed);
      else if (other != nullptr)  // otherwise a cell above the level gives the same position
        all[2 * i] = up_from(crossed, *other, false);
      if (other != nullptr) all[2 * i + 1] = up_from(crossed, *other, true);
    };
    parallel_for(count, threads_, find, kQuick);
    all.erase(std::remove_if(all.begin(), all.end(), [](const Candidate& c) { return !(c.radius > 0); }), all.end());
    return all;
  }

  // Whether a cell is free, but on the inner side of the surface. All points of a region are on one side.
  bool is_inside(std::int32_t cell, BallReach& reach) const {
    if (grid_.clearance[cell] < field_.radius()) return false;
    return is_inside(reach.region_of_cell(cell), grid_.centre(cell));
  }
  bool is_inside(std::int32_t region, Vec3 x) const {
    const auto [entry, is_new] = inside_.try_emplace(region);
    if (is_new) entry->second = surface_.holds(x);
    return entry->second;
  }

  Candidate down_from(const ClearanceGrid::Crossed& crossed) const {
    const NavigableField::Value& room = crossed.room;
    return candidate(crossed, grid_.centre(crossed.cell) - (room.value - field_.level()) * room.uphill, room, 0);
  }

  Candidate up_from(const ClearanceGrid::Crossed& crossed, const ClearanceGrid::Crossed& other,
                    bool into_crease) const {
    Climb climb(field_, grid_.centre(crossed.cell), crossed.room);
    climb.beware(grid_.centre(other.cell), other.room);
    const double farthest = 2 * grid_.pitch;
    if (!(into_crease ? climb.into_crease(farthest) : climb.by_pushing(farthest))) return {};
    return candidate(crossed, climb.at(), climb.value(), climb.sharpness());
  }

  // The ball around a point on the boundary; none where it would not touch the hull.
  Candidate candidate(const ClearanceGrid::Crossed& crossed, Vec3 at, const NavigableField::Value& value,
                      double sharpness) const {
    const double distance = value.by == NavigableField::Limit::kSurface
                                ? field_.level()
                                : std::sqrt(field_.surface().closest(at, value.slot).distance2);
    // It keeps t from the surface, and lies entirely outside the closed half-spaces.
    const double ground = field_.above_ground(at);
    const double radius = std::min(distance - field_.tolerance(), ground);
    const bool in_hull = crossed.inside >= norm(at - grid_.centre(crossed.cell));
    if (!in_hull && field_.hull().distance(at, radius) >= radius - kHair) return {};
    return {at, radius, std::min(distance, ground), sharpness};
  }

  std::vector<Candidate> reachable(const std::vector<Candidate>& candidates, const BallSources& sources,
                                   BallReach& reach) const {
    for (const Candidate& candidate : candidates) reach.add(candidate.at, candidate.clearance);
    if (sources.outside) reach.start_outside();
    for (const Vec3 seed : sources.seeds) reach.start_at(reach.add(seed, field_.clearance(seed).value));

    inside_.clear();  // points have joined regions
    std::vector<std::int32_t> cut_off;
    std::vector<bool> keep(candidates.size());
    for (std::size_t i = 0; i < candidates.size(); ++i) {
      const auto point = static_cast<std::int32_t>(i);
      keep[i] = reach.reached(point);
      if (keep[i] || is_inside(reach.region(point), candidates[i].at)) continue;
      if (sources.reachable_only)
        cut_off.push_back(point);
      else
        keep[i] = true;
    }
    if (!cut_off.empty()) {
      reach.look_closely(cut_off, threads_);
      for (const std::int32_t point : cut_off) keep[point] = reach.reached(point);
    }
    std::vector<Candidate> kept;
    for (std::size_t i = 0; i < candidates.size(); ++i)
      if (keep[i]) kept.push_back(candidates[i]);
    return kept;
  }

  // In order of sharpness, a candidate is taken unless a taken centre is closer than the spacing of both.
  Balls spread(const std::vector<Candidate>& candidates) const {
    std::vector<std::int32_t> order(candidates.size());
    std::iota(order.begin(), order.end(), 0);
    std::stable_sort(order.begin(), order.end(),
                     [&](std::int32_t a, std::int32_t b) { return candidates[a].sharpness > candidates[b].sharpness; });
    const double least = kBallSpacing * field_.radius();
    std::vector<Taken> by_size;  // spacings of [2^i, 2^(i + 1)) times the smallest
    std::vector<std::int32_t> taken;
    for (const std::int32_t c : order) {
      poll_stop();
      const double spacing = kBallSpacing * candidates[c].radius;
      if (std::any_of(by_size.begin(), by_size.end(),
                      [&](const Taken& some) { return some.blocks(candidates[c].at, spacing, candidates); }))
        continue;
      const auto size = static_cast<std::size_t>(std::max(0, std::ilogb(spacing / least)));
      while (by_size.size() <= size) by_size.emplace_back(std::ldexp(least, static_cast<int>(by_size.size()) + 1));
      by_size[size].add(c, candidates[c].at);
      taken.push_back(c);
    }
    std::sort(taken.begin(), taken.end());
    Balls balls;
    for (const std::int32_t c : taken) {
      balls.centres.push_back(candidates[c].at);
      balls.radii.push_back(candidates[c].radius);
    }
    return balls;
  }

  // Chosen candidates of similar size, in cells as wide as the largest spacing among them.
  class Taken {
   public:
    explicit Taken(double width) : width_(width) {}
    void add(std::int32_t candidate, Vec3 at) { cells_[place(at)].push_back(candidate); }
    bool blocks(Vec3 at, double spacing, const std::vector<Candidate>& candidates) const {
      const auto [i, j, k] = place(at);
      for (std::int64_t c = k - 1; c <= k + 1; ++c)
        for (std::int64_t b = j - 1; b <= j + 1; ++b)
          for (std::int64_t a = i - 1; a <= i + 1; ++a) {
            const auto cell = cells_.find({a, b, c});
            if (cell == cells_.end()) continue;
            for (const std::int32_t other : cell->second) {
              const double limit = std::min(spacing, kBallSpacing * candidates[other].radius);
              if (norm2(candidates[other].at - at) < limit * limit) return true;
            }
          }
      return false;
    }

   private:
    std::array<std::int64_t, 3> place(Vec3 x) const {
      return {static_cast<std::int64_t>(std::floor(x.x / width_)), static_cast<std::int64_t>(std::floor(x.y / width_)),
              static_cast<std::int64_t>(std::floor(x.z / width_))};
    }
    double width_;
    std::map<std::array<std::int64_t, 3>, std::vector<std::int32_t>> cells_;
  };

  const Surface& surface_;
  const NavigableField& field_;
  int threads_;
  ClearanceGrid grid_;
  mutable std::unordered_map<std::int32_t, bool> inside_;  // by region
};

}  // namespace

Balls spread_balls(const Surface& surface, const NavigableField& field, const BallSources& sources, double pitch,
                   int threads) {
  return Spreading(surface, field, pitch, threads).run(sources);
}

std::pair<std::vector<std::int32_t>, std::vector<double>> intrusions(const ConvexBody& hull, const Balls& balls,
                                                                     const std::vector<std::int32_t>* candidates,
                                                                     double least, bool first) {
  std::vector<std::int32_t> found;
  std::vector<double> depths;
  const Box& box = hull.box();
  const std::size_t count = candidates != nullptr ? candidates->size() : balls.centres.size();
  for (std::size_t i = 0; i < count; ++i) {
    poll_stop(i);
    const std::int32_t ball = candidates != nullptr ? (*candidates)[i] : static_cast<std::int32_t>(i);
    const Vec3 c = balls.centres[ball];
    const double radius = balls.radii[ball], enough = radius - least;
    if (!(enough > 0)) continue;
    if (!box.meets({c, c}, enough)) continue;
    const double distance = hull.distance(c, enough);
    if (!(distance < enough)) continue;
    found.push_back(ball), depths.push_back(radius - distance);
    if (first) break;
  }
  return {std::move(found), std::move(depths)};
}

}  // namespace rlacd
