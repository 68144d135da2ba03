#include "solid/triangulate.hpp"

#include <algorithm>
#include <cmath>
#include <numeric>

#include "core/elementary.hpp"
#include "core/stop.hpp"

namespace rlacd {

namespace {

constexpr std::size_t kFlips = 64;  // for each triangle; far more than any triangulation needs
constexpr std::size_t kNone = ~std::size_t{0};

using Loop = std::vector<std::int32_t>;

double distance2(PlanePoint a, PlanePoint b) { return (a[0] - b[0]) * (a[0] - b[0]) + (a[1] - b[1]) * (a[1] - b[1]); }

// A loop and its holes, joined by bridges to one ring of nodes.
class Ring {
 public:
  Ring(const std::vector<PlanePoint>& points, const Loop& outer, std::vector<Loop> holes) : points_(points) {
    start_ = added(outer);
    const auto leftmost = [&](const Loop& hole) {
      return *std::min_element(hole.begin(), hole.end(),
                               [&](std::int32_t a, std::int32_t b) { return points_[a] < points_[b]; });
    };
    for (Loop& hole : holes) std::rotate(hole.begin(), std::find(hole.begin(), hole.end(), leftmost(hole)), hole.end());
    std::sort(holes.begin(), holes.end(), [&](const Loop& a, const Loop& b) { return points_[a[0]] < points_[b[0]]; });
    for (const Loop& hole : holes) {
      poll_stop();
      const std::size_t from = bridge(points_[hole[0]], points_[hole[1]]);
      join(from, added(hole));
    }
  }

  // Clips ears until nothing is left.
  void triangulate(std::vector<Triangle>& triangles) {
    find_reflex();
    std::size_t at = start_, tried = 0;
    for (std::size_t left = nodes_.size(); left > 2;) {
      if (tried > left) {
        at = least_bad();
      } else if (!is_ear(at, 0)) {
        at = nodes_[at].next;
        ++tried;
        continue;
      }
      const auto [point, previous, next, is_gone] = nodes_[at];
      triangles.push_back({nodes_[previous].point, point, nodes_[next].point});
      nodes_[previous].next = next;
      nodes_[next].previous = previous;
      nodes_[at].is_gone = true;
      at = start_ = nodes_[next].next;  // the next but one: fewer slivers
      tried = 0;
      --left;
    }
  }

 private:
  struct Node {
    std::int32_t point;
    std::size_t previous, next;
    bool is_gone = false;
  };

  PlanePoint at(std::size_t node) const { return points_[nodes_[node].point]; }

  // Adds a loop as a ring of its own.
  std::size_t added(const Loop& loop) {
    const std::size_t first = nodes_.size(), count = loop.size();
    for (std::size_t i = 0; i < count; ++i)
      nodes_.push_back({loop[i], first + (i + count - 1) % count, first + (i + 1) % count});
    return first;
  }

  // Joins two rings by a bridge, there and back.
  void join(std::size_t a, std::size_t b) {
    const std::size_t a_back = nodes_.size(), b_back = a_back + 1;
    nodes_.push_back({nodes_[a].point, b_back, nodes_[a].next});
    nodes_.push_back({nodes_[b].point, nodes_[b].previous, a_back});
    nodes_[nodes_[a].next].previous = a_back;
    nodes_[nodes_[b].previous].next = b_back;
    nodes_[a].next = b;
    nodes_[b].previous = a;
  }

  // Whether a segment from a node to a point begins inside.
  bool begins_inside(std::size_t node, PlanePoint to) const {
    const PlanePoint before = at(nodes_[node].previous), own = at(node), after = at(nodes_[node].next);
    const double left_of_first = doubled_area(before, own, to), left_of_second = doubled_area(own, after, to);
    return doubled_area(before, own, after) > 0 ? left_of_first >= 0 && left_of_second >= 0
                                                : left_of_first > 0 || left_of_second > 0;
  }

  // A node that sees a point of a hole which has no other point to its left. Where the hole touches the ring, it is the
  // node whose inside holds the hole's next point.
  std::size_t bridge(PlanePoint h, PlanePoint after) const {
    std::size_t best = kNone, nearest = start_, node = start_;
    double x = -kInfinity;
    do {  // the edge met first by a ray to the left
      const PlanePoint p = at(node), q = at(nodes_[node].next);
      if (p == h && begins_inside(node, after)) return node;
      if (distance2(p, h) < distance2(at(nearest), h)) nearest = node;
      if (p[1] >= h[1] && h[1] >= q[1] && p[1] != q[1]) {
        const double met = p[0] + (h[1] - p[1]) / (q[1] - p[1]) * (q[0] - p[0]);
        if (met <= h[0] && met > x) {
          x = met;
          best = p[0] < q[0] ? node : nodes_[node].next;
        }
      }
      node = nodes_[node].next;
    } while (node != start_);
    if (best == kNone) return nearest;
    const PlanePoint corner = at(best), met = {x, h[1]};
    if (x == h[0]) return best;
    const double turn = corner[1] < h[1] ? 1 : -1;
    double least = kInfinity;
    const std::size_t stop = best;
    node = stop;
    do {  // of the nodes that could hide the edge's end, the one nearest the ray
      const PlanePoint p = at(node);
      if (p[0] >= corner[0] && p[0] < h[0] && turn * doubled_area(met, corner, p) >= 0 &&
          turn * doubled_area(corner, h, p) >= 0 && turn * doubled_area(h, met, p) >= 0 && begins_inside(node, h)) {
        const double slope = std::fabs(h[1] - p[1]) / (h[0] - p[0]);
        if (slope < least || (slope == least && p[0] > at(best)[0])) {
          least = slope;
          best = node;
        }
      }
      node = nodes_[node].next;
    } while (node != stop);
    return best;
  }

  // Only these can lie in an ear; clipping makes no more of them.
  void find_reflex() {
    for (std::size_t node = 0; node < nodes_.size(); ++node)
      if (doubled_area(at(nodes_[node].previous), at(node), at(nodes_[node].next)) <= 0) reflex_.push_back(node);
    std::sort(reflex_.begin(), reflex_.end(),
              [&](std::size_t a, std::size_t b) { return at(a)[0] != at(b)[0] ? at(a)[0] < at(b)[0] : a < b; });
  }

  // Whether the triangle at a node lies inside and holds no other node; it may be flat by `slack`.
  bool is_ear(std::size_t node, double slack) const {
    const PlanePoint a = at(nodes_[node].previous), b = at(node), c = at(nodes_[node].next);
    if (slack == 0 ? !(doubled_area(a, b, c) > 0) : !(doubled_area(a, b, c) >= -slack)) return false;
    const double low = std::min({a[1], b[1], c[1]}), high = std::max({a[1], b[1], c[1]});
    const double right = std::max({a[0], b[0], c[0]});
    for (auto other = std::lower_bound(reflex_.begin(), reflex_.end(), std::min({a[0], b[0], c[0]}),
                                       [&](std::size_t n, double x) { return at(n)[0] < x; });
         other != reflex_.end() && at(*other)[0] <= right; ++other) {
      const PlanePoint p = at(*other);
      if (nodes_[*other].is_gone || p[1] < low || p[1] > high || p == a || p == b || p == c) continue;
      if (doubled_area(a, b, p) >= slack && doubled_area(b, c, p) >= slack && doubled_area(c, a, p) >= slack)
        return false;
    }
    return true;
  }

  // The node to clip where there is no ear: a flat one, or the least folded.
  std::size_t least_bad() const {
    std::size_t best = start_, node = start_;
    double most = -kInfinity;
    do {
      const PlanePoint a = at(nodes_[node].previous), b = at(node), c = at(nodes_[node].next);
      const double slack = kRounding * std::max(distance2(a, b), distance2(b, c));
      if (is_ear(node, slack)) return node;
      if (const double area = doubled_area(a, b, c); area > most) most = area, best = node;
      node = nodes_[node].next;
    } while (node != start_);
    return best;
  }

  const std::vector<PlanePoint>& points_;
  std::vector<Node> nodes_;
  std::vector<std::size_t> reflex_;  // by their x
  std::size_t start_ = 0;
};

// Flips edges between triangles until the triangulation is Delaunay's.
class Flipper {
 public:
  Flipper(const std::vector<PlanePoint>& points, std::vector<Triangle>& triangles)
      : points_(points), triangles_(triangles), across_(3 * triangles.size(), kNone) {
    std::vector<std::size_t> halfedges(across_.size());
    std::iota(halfedges.begin(), halfedges.end(), 0);
    const auto ends = [&](std::size_t h) { return std::minmax(from(h), to(h)); };
    std::sort(halfedges.begin(), halfedges.end(), [&](std::size_t g, std::size_t h) {
      const auto [a, b] = ends(g);
      const auto [c, d] = ends(h);
      return a != c ? a < c : b != d ? b < d : g < h;
    });
    for (std::size_t i = 0; i + 1 < halfedges.size(); ++i) {
      const std::size_t g = halfedges[i], h = halfedges[i + 1];
      if (from(g) == to(h) && to(g) == from(h)) across_[g] = h, across_[h] = g, ++i;
    }
  }

  void flip_all() {
    std::vector<std::size_t> waiting;
    for (std::size_t h = 0; h < across_.size(); ++h)
      if (across_[h] != kNone && h < across_[h]) waiting.push_back(h);
    for (std::size_t flips = 0; !waiting.empty() && flips < kFlips * triangles_.size();) {
      const std::size_t h = waiting.back();
      waiting.pop_back();
      if (across_[h] == kNone || !should_flip(h)) continue;
      ++flips;
      flip(h, waiting);
    }
  }

 private:
  static std::size_t after(std::size_t h) { return h % 3 == 2 ? h - 2 : h + 1; }
  std::int32_t& from(std::size_t h) { return triangles_[h / 3][h % 3]; }
  std::int32_t& to(std::size_t h) { return from(after(h)); }

  // Whether the angles opposite an edge add up to more than 180 degrees, and the other diagonal lies between them.
  bool should_flip(std::size_t h) {
    const PlanePoint a = points_[from(h)], b = points_[to(h)], c = points_[to(after(h))];
    const PlanePoint d = points_[to(after(across_[h]))];
    if (!(doubled_area(a, d, c) > 0 && doubled_area(d, b, c) > 0)) return false;
    const auto cosine = [](PlanePoint p, PlanePoint q, PlanePoint at) {
      return (p[0] - at[0]) * (q[0] - at[0]) + (p[1] - at[1]) * (q[1] - at[1]);
    };
    const double sine = doubled_area(c, a, b) * cosine(a, b, d) + cosine(a, b, c) * doubled_area(d, b, a);
    const double size = distance2(a, c) * distance2(b, c) * distance2(a, d) * distance2(b, d);
    return sine < -kRounding * std::sqrt(size);
  }

  void flip(std::size_t h, std::vector<std::size_t>& waiting) {
    const std::size_t g = across_[h], h1 = after(h), h2 = after(h1), g1 = after(g), g2 = after(g1);
    const std::int32_t c = to(h1), d = to(g1);
    const std::size_t ad = across_[g1], bc = across_[h1], ca = across_[h2], db = across_[g2];
    const std::int32_t a = from(h), b = to(h);
    triangles_[h / 3] = {a, d, c};  // edges: ad, dc, ca
    triangles_[g / 3] = {d, b, c};  // db, bc, cd
    const std::size_t t = h / 3 * 3, u = g / 3 * 3;
    const auto link = [&](std::size_t one, std::size_t other) {
      across_[one] = other;
      if (other != kNone) across_[other] = one, waiting.push_back(one);
    };
    link(t, ad);
    link(t + 2, ca);
    link(u, db);
    link(u + 1, bc);
    across_[t + 1] = u + 2;
    across_[u + 2] = t + 1;
  }

  const std::vector<PlanePoint>& points_;
  std::vector<Triangle>& triangles_;
  std::vector<std::size_t> across_;  // the same edge's halfedge in the other triangle
};

// The loops' edges as loops of places that do not go through each other where they share a vertex: the next edge is the
// one nearest the inside.
std::vector<Loop> untangled(const std::vector<std::vector<PlanePoint>>& loops, const std::vector<PlanePoint>& points,
                            const std::vector<std::int32_t>& vertices) {
  std::vector<std::int32_t> next(points.size()), previous(points.size()), by_vertex(points.size());
  for (std::size_t first = 0, l = 0; l < loops.size(); first += loops[l++].size())
    for (std::size_t i = 0, count = loops[l].size(); i < count; ++i)
      previous[next[first + i] = static_cast<std::int32_t>(first + (i + 1) % count)] =
          static_cast<std::int32_t>(first + i);
  std::iota(by_vertex.begin(), by_vertex.end(), 0);
  std::stable_sort(by_vertex.begin(), by_vertex.end(),
                   [&](std::int32_t a, std::int32_t b) { return vertices[a] < vertices[b]; });
  const std::vector<std::int32_t> after = next;
  for (auto first = by_vertex.begin(), last = first; first != by_vertex.end(); first = last) {
    last = std::find_if(first, by_vertex.end(), [&](std::int32_t p) { return vertices[p] != vertices[*first]; });
    std::vector<std::int32_t> left(first, last);
    for (auto own = first; last - first > 1 && own != last; ++own) {
      const PlanePoint at = points[*own], back = points[previous[*own]];
      const auto angle = [&](std::int32_t p) {
        const PlanePoint to = points[after[p]];
        const double bx = back[0] - at[0], by = back[1] - at[1], ex = to[0] - at[0], ey = to[1] - at[1];
        const double turn = angle_of(ex * by - ey * bx, ex * bx + ey * by);
        return turn > 0 ? turn : turn + 2 * kPi;
      };
      const auto best = std::min_element(left.begin(), left.end(),
                                         [&](std::int32_t a, std::int32_t b) { return angle(a) < angle(b); });
      next[previous[*own]] = *best;
      left.erase(best);
    }
  }
  std::vector<Loop> found;
  std::vector<char> is_seen(points.size(), 0);
  for (std::size_t start = 0; start < points.size(); ++start) {
    Loop loop;
    for (auto p = static_cast<std::int32_t>(start); !is_seen[p]; p = next[p]) is_seen[p] = 1, loop.push_back(p);
    if (loop.size() > 2) found.push_back(std::move(loop));
  }
  return found;
}

double doubled_area_of(const std::vector<PlanePoint>& points, const Loop& loop) {
  double sum = 0;
  for (std::size_t i = 1; i + 1 < loop.size(); ++i)
    sum += doubled_area(points[loop[0]], points[loop[i]], points[loop[i + 1]]);
  return sum;
}

// Whether a loop goes around the middle of another's longest edge: two loops may share corners.
bool goes_around(const std::vector<PlanePoint>& points, const Loop& loop, const Loop& other) {
  PlanePoint middle{};
  double longest = -1;
  for (std::size_t i = 0; i < other.size(); ++i) {
    const PlanePoint a = points[other[i]], b = points[other[(i + 1) % other.size()]];
    if (distance2(a, b) > longest) longest = distance2(a, b), middle = {(a[0] + b[0]) / 2, (a[1] + b[1]) / 2};
  }
  bool inside = false;
  for (std::size_t i = 0; i < loop.size(); ++i) {
    const PlanePoint p = points[loop[i]], q = points[loop[(i + 1) % loop.size()]];
    if ((p[1] > middle[1]) != (q[1] > middle[1]) &&
        p[0] + (middle[1] - p[1]) / (q[1] - p[1]) * (q[0] - p[0]) > middle[0])
      inside = !inside;
  }
  return inside;
}

}  // namespace

std::vector<Triangle> triangulate(const std::vector<std::vector<PlanePoint>>& loops,
                                  const std::vector<std::int32_t>& vertices) {
  std::vector<PlanePoint> points;
  struct Outer {
    Loop loop;
    double area;
    std::vector<Loop> holes;
    bool is_upside_down = false;
  };
  std::vector<Outer> outers;
  std::vector<Loop> holes;
  for (const std::vector<PlanePoint>& loop : loops) points.insert(points.end(), loop.begin(), loop.end());
  std::vector<Loop> all_loops = untangled(loops, points, vertices);
  for (Loop& own : all_loops) {
    const double area = doubled_area_of(points, own);
    if (area > 0 || all_loops.size() == 1)
      outers.push_back({std::move(own), std::fabs(area), {}, area < 0});
    else
      holes.push_back(std::move(own));
  }
  std::stable_sort(outers.begin(), outers.end(), [](const Outer& a, const Outer& b) { return a.area < b.area; });
  const std::size_t proper = outers.size();
  for (Loop& hole : holes) {
    const auto own = std::find_if(outers.begin(), outers.begin() + static_cast<std::ptrdiff_t>(proper),
                                  [&](const Outer& outer) { return goes_around(points, outer.loop, hole); });
    if (own != outers.begin() + static_cast<std::ptrdiff_t>(proper))
      own->holes.push_back(std::move(hole));
    else
      outers.push_back({std::move(hole), 0, {}, true});
  }
  std::vector<Triangle> all;
  for (Outer& outer : outers) {
    if (outer.is_upside_down) std::reverse(outer.loop.begin(), outer.loop.end());
    std::vector<Triangle> triangles;
    Ring(points, outer.loop, std::move(outer.holes)).triangulate(triangles);
    Flipper(points, triangles).flip_all();
    for (Triangle& t : triangles) {
      if (outer.is_upside_down) std::swap(t[1], t[2]);
      all.push_back(t);
    }
  }
  return all;
}

}  // namespace rlacd
