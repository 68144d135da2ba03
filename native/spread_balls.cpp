#include "spread_balls.hpp"

#include <numeric>
#include <unordered_map>
#include <unordered_set>

#include "ball_reach.hpp"
#include "parallel.hpp"

namespace rlacd {
namespace {

constexpr double kSlack = 1e-9;  // absolute: the frame is 2 wide
constexpr int kPushes = 40;
constexpr double kTouch = 1e-9;
constexpr double kWindingAccuracy = 3;
constexpr std::size_t kChunk = 64;

struct Candidate {
  Vec3 at;
  double radius = 0;
  double sharpness = 0;
};

// What was nearest on the way to a candidate, and whether it still is: two directions that disagree make a crease,
// three that span space a corner.
class Witnesses {
 public:
  void see(Vec3 x, const NavigableField::Value& value) {
    const Seen seen = {x - value.value * value.uphill, value.uphill};
    for (int i = 0; i < std::min(count_, kMost); ++i)
      if (dot(seen_[i].uphill, seen.uphill) > kSame) {
        seen_[i] = seen;
        return;
      }
    seen_[count_++ % kMost] = seen;
  }
  // 0 on a smooth place, up to 2 in a crease, up to 4 in a corner.
  double sharpness(Vec3 x, double level, double slack) const {
    Vec3 near[kMost];
    int count = 0;
    for (int i = 0; i < std::min(count_, kMost); ++i)
      if (std::fabs(dot(x - seen_[i].origin, seen_[i].uphill) - level) <= slack) near[count++] = seen_[i].uphill;
    double crease = 0, corner = 0;
    for (int a = 0; a < count; ++a)
      for (int b = 0; b < a; ++b) {
        crease = std::max(crease, 1 - dot(near[a], near[b]));
        for (int c = 0; c < b; ++c)
          corner = std::max(corner, std::fabs(dot(cross(near[a], near[b]), near[c])) > kSpans ? 2.0 : 0.0);
      }
    return crease > 1 - kSame ? crease + corner : 0;
  }

 private:
  struct Seen {
    Vec3 origin;  // the value is the distance from the plane through here
    Vec3 uphill;
  };
  static constexpr int kMost = 6;
  static constexpr double kSame = 0.97, kSpans = 0.1;
  Seen seen_[kMost];
  int count_ = 0;
};

class Spreading {
 public:
  Spreading(const Surface& surface, const NavigableField& field, double pitch, int threads)
      : surface_(surface), field_(field), threads_(threads), grid_(clearance_grid(field, pitch, threads)) {}

  Balls run(const BallSources& sources) {
    std::vector<Candidate> candidates = on_boundary();
    candidates = reachable(std::move(candidates), sources);
    return spread(candidates);
  }

 private:
  // Candidates whose ball touches the hull, in the order of the cells they come from.
  std::vector<Candidate> on_boundary() const {
    const std::size_t count = grid_.boundary.size();
    std::vector<Candidate> all(count);
    parallel_for((count + kChunk - 1) / kChunk, threads_, [&](std::size_t chunk) {
      std::int32_t hint = -1;
      for (std::size_t i = chunk * kChunk; i < std::min(count, (chunk + 1) * kChunk); ++i)
        all[i] = from(grid_.boundary[i], hint);
    });
    all.erase(std::remove_if(all.begin(), all.end(), [](const Candidate& c) { return !(c.radius > 0); }), all.end());
    return all;
  }

  Candidate from(std::int32_t cell, std::int32_t& hint) const {
    const Vec3 centre = grid_.centre(cell);
    Candidate candidate;
    candidate.at = centre;
    Witnesses witnesses;
    NavigableField::Value value;
    value.slot = hint;
    const auto field = [this](Vec3 x, std::int32_t slot) { return field_.room(x, slot); };
    const bool found = settle(field, field_.level(), kSlack, kPushes, candidate.at, value,
                              [&](Vec3 x, const NavigableField::Value& v) { witnesses.see(x, v); });
    hint = value.slot;
    if (!found || max_abs(candidate.at - centre) > 2 * grid_.pitch) return candidate;
    // The ball keeps t from the surface and all of it out of the closed half-spaces.
    const double distance = std::sqrt(field_.surface().closest(candidate.at, hint).distance2);
    const double radius = std::min(distance - field_.tolerance(), field_.above_ground(candidate.at));
    if (field_.hull().distance(candidate.at, radius) >= radius - kTouch) return candidate;
    candidate.radius = radius;
    candidate.sharpness = witnesses.sharpness(candidate.at, field_.level(), 0.02 * field_.radius());
    return candidate;
  }

  std::vector<Candidate> reachable(std::vector<Candidate> candidates, const BallSources& sources) const {
    std::vector<Vec3> points;
    points.reserve(candidates.size() + sources.seeds.size());
    for (const Candidate& candidate : candidates) points.push_back(candidate.at);
    points.insert(points.end(), sources.seeds.begin(), sources.seeds.end());
    BallReach reach(field_, grid_, points);
    if (sources.outside) reach.start_outside();
    for (std::size_t i = candidates.size(); i < points.size(); ++i) reach.start_at(static_cast<std::int32_t>(i));

    // All points of a region are on one side of the surface. Only ways into regions outside it matter.
    std::unordered_map<std::int32_t, bool> is_outside;
    std::vector<std::int32_t> cut_off;
    std::vector<bool> keep(candidates.size());
    for (std::size_t i = 0; i < candidates.size(); ++i) {
      const auto point = static_cast<std::int32_t>(i);
      if (reach.reached(point)) {
        keep[i] = true;
        continue;
      }
      const auto [entry, is_new] = is_outside.try_emplace(reach.region(point));
      if (is_new) entry->second = surface_.winding().at(points[i], kWindingAccuracy) < 0.5;
      keep[i] = entry->second && !sources.reachable_only;
      if (entry->second && sources.reachable_only) cut_off.push_back(point);
    }
    if (!cut_off.empty()) {
      reach.look_closely(cut_off);
      for (const std::int32_t point : cut_off) keep[point] = reach.reached(point);
    }
    std::vector<Candidate> kept;
    for (std::size_t i = 0; i < candidates.size(); ++i)
      if (keep[i]) kept.push_back(candidates[i]);
    return kept;
  }

  // The sharpest first, a candidate is taken unless a centre is closer than the spacing of both.
  Balls spread(const std::vector<Candidate>& candidates) const {
    std::vector<std::int32_t> order(candidates.size());
    std::iota(order.begin(), order.end(), 0);
    std::stable_sort(order.begin(), order.end(),
                     [&](std::int32_t a, std::int32_t b) { return candidates[a].sharpness > candidates[b].sharpness; });
    const double least = kBallSpacing * field_.radius();
    std::vector<Taken> by_size;  // spacings of [2^i, 2^(i + 1)) times the least
    std::vector<std::int32_t> taken;
    for (const std::int32_t c : order) {
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
    balls.pitch = grid_.pitch;
    for (const std::int32_t c : taken) {
      balls.centres.push_back(candidates[c].at);
      balls.radii.push_back(candidates[c].radius);
    }
    return balls;
  }

  // Chosen candidates of about one size, in cells as wide as the largest spacing among them.
  class Taken {
   public:
    explicit Taken(double width) : width_(width) {}
    void add(std::int32_t candidate, Vec3 at) { cells_[key(place(at))].push_back(candidate); }
    bool blocks(Vec3 at, double spacing, const std::vector<Candidate>& candidates) const {
      const auto [i, j, k] = place(at);
      for (std::int64_t c = k - 1; c <= k + 1; ++c)
        for (std::int64_t b = j - 1; b <= j + 1; ++b)
          for (std::int64_t a = i - 1; a <= i + 1; ++a) {
            const auto cell = cells_.find(key({a, b, c}));
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
    static std::uint64_t key(std::array<std::int64_t, 3> place) {
      constexpr std::int64_t kOffset = 1 << 20;
      std::uint64_t joined = 0;
      for (const std::int64_t p : place) joined = joined << 21 | static_cast<std::uint64_t>(p + kOffset);
      return joined;
    }
    double width_;
    std::unordered_map<std::uint64_t, std::vector<std::int32_t>> cells_;
  };

  const Surface& surface_;
  const NavigableField& field_;
  int threads_;
  ClearanceGrid grid_;
};

}  // namespace

Balls spread_balls(const Surface& surface, const NavigableField& field, const BallSources& sources, double pitch,
                   int threads) {
  return Spreading(surface, field, pitch, threads).run(sources);
}

}  // namespace rlacd
