#include "solid/apart.hpp"

#include <algorithm>
#include <cmath>

#include "core/stop.hpp"

namespace rlacd {

namespace {

constexpr double kShortest = 0.1;  // of the reach: the least step along a segment, and the least room of a ball
constexpr int kClimbs = 6;
constexpr int kMostQueries = 150000;  // of distances, about 0.15 s; pairs not decided by then count as together

struct Ball {
  Vec3 centre;
  double radius;  // of free space around the centre
};

// The exterior of a solid at a reach, as far as it is known.
class Exterior {
 public:
  Exterior(const Surface& surface, double reach) : surface_(surface), reach_(reach) {
    for (const Bvh::Node& node : surface.bvh().nodes())
      for (const Box& box : node.box)
        if (!box.is_empty()) box_.extend(box);
    for (int i = -1; i <= 1; ++i)
      for (int j = -1; j <= 1; ++j)
        for (int k = -1; k <= 1; ++k)
          if (i != 0 || j != 0 || k != 0) rays_.push_back(normalized({1.0 * i, 1.0 * j, 1.0 * k}));
  }

  bool is_spent() const { return queries_ > kMostQueries; }

  // Whether the segment is found to meet it.
  bool is_met(Vec3 a, Vec3 b) {
    const Vec3 along = b - a;
    const double length = norm(along);
    if (length <= 2 * reach_) return false;  // each point of the segment is within T of one of its ends
    for (std::size_t i = 0; i < outer_.size(); ++i) {
      const double room = outer_[i].radius - reach_;
      if (norm2(closest_on_segment(a, along, outer_[i].centre) - outer_[i].centre) < room * room) {
        if (i > 0) std::swap(outer_[i], outer_[i / 2]);  // those that are of use come first
        return true;
      }
    }
    const Vec3 direction = (1 / length) * along;
    for (double t = reach_; t < length - reach_;) {
      const Vec3 x = a + t * direction;
      const double away = at(x).radius;
      if (away <= reach_) {
        t += std::max(reach_ - away, kShortest * reach_);
        continue;
      }
      const bool inside = is_inside(x, away);
      if (!inside && escapes({x, away})) return true;
      t += inside ? away : std::max((away - reach_) / 2, kShortest * reach_);
    }
    return false;
  }

 private:
  bool is_inside(Vec3 x, double away) {
    for (const Ball& ball : inner_)
      if (norm2(x - ball.centre) < ball.radius * ball.radius) return true;
    if (!surface_.holds(x)) return false;
    inner_.push_back({x, away});
    return true;
  }

  // Whether a path leads from the ball to infinity, first away from the surface and then straight. All balls of the
  // path end it alike.
  bool escapes(const Ball& start) {
    if (!has_room(start) || is_within(shut_, start.centre)) return false;
    std::vector<Ball> path{start};
    bool left = leaves(start, path);
    for (int climb = 0; climb < kClimbs && !left; ++climb) {
      const Ball from = path.back();
      const Vec3 uphill = normalized(from.centre - surface_.bvh().closest(from.centre, slot_).point);
      const Ball next = at(from.centre + (from.radius - reach_) * uphill);
      if (next.radius < 1.1 * from.radius) break;
      path.push_back(next);
      left = leaves(next, path);
    }
    std::vector<Ball>& known = left ? outer_ : shut_;
    known.insert(known.end(), path.begin(), path.end());
    return left;
  }

  // Whether a ray from the ball's centre stays in the exterior; its balls are added to the path.
  bool leaves(const Ball& from, std::vector<Ball>& path) {
    const std::size_t before = path.size();
    for (const Vec3& ray : rays_) {
      for (Ball ball = from; has_room(ball); path.push_back(ball)) {
        if (is_far(ball.centre)) return true;
        ball = at(ball.centre + (ball.radius - reach_) * ray);
      }
      path.resize(before);
    }
    return false;
  }

  bool has_room(const Ball& ball) const { return ball.radius > (1 + kShortest) * reach_; }
  bool is_within(const std::vector<Ball>& balls, Vec3 x) const {
    return std::any_of(balls.begin(), balls.end(), [&](const Ball& ball) {
      return norm2(ball.centre - x) < (ball.radius - reach_) * (ball.radius - reach_);
    });
  }

  // The largest ball around a point without surface inside.
  Ball at(Vec3 x) {
    const Bvh::Hit hit = surface_.bvh().closest(x, slot_);
    slot_ = hit.slot;
    ++queries_;
    return {x, std::sqrt(hit.distance2)};
  }

  // Farther from the box around the surface than the reach: such points are joined to infinity.
  bool is_far(Vec3 x) const { return box_.distance2(x) > reach_ * reach_; }

  const Surface& surface_;
  const double reach_;
  Box box_;
  std::vector<Vec3> rays_;
  std::vector<Ball> outer_, inner_, shut_;  // exterior, inside the solid, and not found to be exterior
  std::int32_t slot_ = -1;                  // of the triangle found last, which is often near
  int queries_ = 0;
};

// Which pairs of points are apart, each decided when it is first asked for.
class ApartGraph {
 public:
  ApartGraph(const Surface& surface, const std::vector<Vec3>& points, double reach)
      : exterior_(surface, reach), points_(points), known_(points.size() * points.size(), kUnknown) {}

  std::int32_t size() const { return static_cast<std::int32_t>(points_.size()); }
  Vec3 point(std::int32_t i) const { return points_[i]; }

  bool are_apart(std::int32_t i, std::int32_t j) {
    char& known = known_[static_cast<std::size_t>(std::min(i, j)) * points_.size() + std::max(i, j)];
    if (known == kUnknown) {
      if (exterior_.is_spent()) return false;
      poll_stop();
      known = i != j && exterior_.is_met(points_[i], points_[j]) ? kApart : kTogether;
    }
    return known == kApart;
  }

 private:
  enum : char { kUnknown, kApart, kTogether };
  Exterior exterior_;
  const std::vector<Vec3>& points_;
  std::vector<char> known_;
};

using Clique = std::vector<std::int32_t>;

// Adds, while there is one, the point nearest to the clique that is apart from all of it.
Clique packed(ApartGraph& graph, std::int32_t start) {
  Clique clique;
  std::vector<std::int32_t> live;
  std::vector<double> near(graph.size(), kInfinity);
  for (std::int32_t i = 0; i < graph.size(); ++i) live.push_back(i);
  for (std::int32_t next = start; next >= 0;) {
    clique.push_back(next);
    std::vector<std::int32_t> left;
    std::int32_t nearest = -1;
    for (const std::int32_t i : live) {
      if (!graph.are_apart(next, i)) continue;
      near[i] = std::min(near[i], norm2(graph.point(i) - graph.point(next)));
      left.push_back(i);
      if (nearest < 0 || near[i] < near[nearest]) nearest = i;
    }
    live = std::move(left);
    next = nearest;
  }
  return clique;
}

// Exchanges one point for two, once; returns whether that was possible.
bool grow(ApartGraph& graph, Clique& clique) {
  std::vector<std::vector<std::int32_t>> against(clique.size());  // points that only this one is in the way of
  for (std::int32_t i = 0; i < graph.size(); ++i) {
    std::size_t in_the_way = clique.size();
    int count = 0;
    for (std::size_t k = 0; k < clique.size() && count < 2; ++k) {
      if (graph.are_apart(clique[k], i)) continue;
      in_the_way = k;
      ++count;
    }
    if (count == 0) {
      clique.push_back(i);
      return true;
    }
    if (count > 1 || clique[in_the_way] == i) continue;
    for (const std::int32_t other : against[in_the_way]) {
      if (!graph.are_apart(other, i)) continue;
      clique[in_the_way] = i;
      clique.push_back(other);
      return true;
    }
    against[in_the_way].push_back(i);
  }
  return false;
}

}  // namespace

std::vector<std::int32_t> apart_points(const Surface& surface, const std::vector<Vec3>& points, double reach,
                                       std::size_t enough) {
  if (points.empty()) return {};
  ApartGraph graph(surface, points, reach);
  Clique clique = packed(graph, 0);
  while (clique.size() < enough && grow(graph, clique)) {
  }
  return clique;
}

}  // namespace rlacd
