// A tree of boxes over triangles that answers "which point of the surface is closest?".
//
// In:  a triangle mesh of any quality: open, self-intersecting, with degenerate triangles.
// Out: closest points, exact up to rounding.
// How: top-down build, each node split where the surface-area heuristic is least over eight bins along the longest axis
//      of its centroids (halved by count if that fails or the tree gets deep); a node holds the boxes of both its
//      children, and a query visits the nearer child first and prunes by the best distance so far.
#pragma once

#include <limits>
#include <utility>
#include <vector>

#include "core/geometry.hpp"

namespace rlacd {

// A triangle with the products that every query would otherwise recompute.
struct TriangleFrame {
  Vec3 a, ab, ac;
  double ab_ab, ab_ac, ac_ac;
  double longest2;  // square of the longest edge
  bool slender;     // barycentric coordinates would lose too many digits to cancellation

  TriangleFrame(Vec3 a_, Vec3 b, Vec3 c) : a(a_), ab(b - a_), ac(c - a_) {
    ab_ab = norm2(ab);
    ab_ac = dot(ab, ac);
    ac_ac = norm2(ac);
    longest2 = std::max({ab_ab, ac_ac, norm2(c - b)});
    slender = !(norm2(cross(ab, ac)) > 1e-4 * longest2 * longest2);
  }
};

inline Vec3 closest_on_segment(Vec3 start, Vec3 along, Vec3 p) {
  const double length2 = norm2(along);
  const double t = length2 > 0 ? std::clamp(dot(p - start, along) / length2, 0.0, 1.0) : 0.0;
  return start + t * along;
}

// Edges are exact whatever the shape. The face is considered only while its normal is accurate to 1e-8; below that the
// triangle is narrower than 1e-8 of its length, and the edges are that close to all of it.
inline Vec3 closest_on_slender_triangle(const TriangleFrame& t, Vec3 p) {
  Vec3 best = closest_on_segment(t.a, t.ab, p);
  for (const Vec3 q : {closest_on_segment(t.a, t.ac, p), closest_on_segment(t.a + t.ab, t.ac - t.ab, p)})
    if (norm2(q - p) < norm2(best - p)) best = q;
  const Vec3 normal = cross(t.ab, t.ac), ap = p - t.a;
  const double normal2 = norm2(normal);
  if (!(normal2 > 1e-16 * t.longest2 * t.longest2)) return best;
  const double v = dot(cross(ap, t.ac), normal) / normal2, w = dot(cross(t.ab, ap), normal) / normal2;
  if (v < 0 || w < 0 || v + w > 1) return best;
  const Vec3 q = t.a + v * t.ab + w * t.ac;
  return norm2(q - p) < norm2(best - p) ? q : best;
}

// Finds the corner, edge or face whose Voronoi region contains p (Ericson, Real-Time Collision Detection, 2005, 5.1.5).
// The answer always lies on the triangle, so the distance to it is never too small; it is too large by at most about
// 1e-8 of the longest edge.
inline Vec3 closest_on_triangle(const TriangleFrame& t, Vec3 p) {
  if (t.slender) return closest_on_slender_triangle(t, p);
  const Vec3 ap = p - t.a;
  const double ab_ap = dot(t.ab, ap), ac_ap = dot(t.ac, ap);
  if (ab_ap <= 0 && ac_ap <= 0) return t.a;
  const double ab_bp = ab_ap - t.ab_ab, ac_bp = ac_ap - t.ab_ac;
  if (ab_bp >= 0 && ac_bp <= ab_bp) return t.a + t.ab;
  const double ab_cp = ab_ap - t.ab_ac, ac_cp = ac_ap - t.ac_ac;
  if (ac_cp >= 0 && ab_cp <= ac_cp) return t.a + t.ac;
  const double towards_c = ab_ap * ac_bp - ab_bp * ac_ap;
  if (towards_c <= 0 && ab_ap >= 0 && ab_bp <= 0) return t.a + (ab_ap / (ab_ap - ab_bp)) * t.ab;
  const double towards_b = ab_cp * ac_ap - ab_ap * ac_cp;
  if (towards_b <= 0 && ac_ap >= 0 && ac_cp <= 0) return t.a + (ac_ap / (ac_ap - ac_cp)) * t.ac;
  const double towards_a = ab_bp * ac_cp - ab_cp * ac_bp;
  const double from_b = ac_bp - ab_bp, from_c = ab_cp - ac_cp;
  if (towards_a <= 0 && from_b >= 0 && from_c >= 0) return t.a + t.ab + (from_b / (from_b + from_c)) * (t.ac - t.ab);
  const double scale = 1 / (towards_a + towards_b + towards_c);
  return t.a + (towards_b * scale) * t.ab + (towards_c * scale) * t.ac;
}

inline double distance_to_triangle(const TriangleFrame& t, Vec3 p) { return norm(closest_on_triangle(t, p) - p); }

class Bvh {
 public:
  explicit Bvh(const Mesh& mesh, int threads = 1);  // which do not change the tree

  // Triangles are stored in the order of the leaves; a *slot* is a position in that order.
  struct Hit {
    Vec3 point;
    double distance2 = kInfinity;
    std::int32_t slot = -1;
  };

  // The closest point to p. A hint (the slot of a triangle expected to be near) only makes the query faster. The search
  // ends at the first triangle within `enough`: the distance is then at most `enough`, not the least. If no triangle is
  // nearer than `within`, the slot is -1.
  Hit closest(Vec3 p, std::int32_t hint = -1, double enough = 0, double within = kInfinity) const;

  // The same closest point, found sooner if the triangle of a slot (-1: none is known) is near: its distance bounds the
  // search, with an allowance for rounding, so that the triangle found is the same without it.
  Hit closest_near(Vec3 p, std::int32_t near) const;

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
  // No tree is deeper than what `bvh.cpp` allows, so that every traversal fits in a stack of this size.
  static constexpr int kStack = 96;
  // Calls visit(slot) for the triangles in boxes that pass, until it returns true; returns whether it did.
  template <class Passes, class Visit>
  bool any_of(const Passes& passes, const Visit& visit) const {
    std::int32_t stack[kStack];
    int top = 0;
    stack[top++] = 0;
    while (top > 0) {
      const Node& node = nodes_[stack[--top]];
      for (int side = 0; side < 2; ++side) {
        if (!passes(node.box[side])) continue;
        if (node.child[side] >= 0) stack[top++] = node.child[side];
        for (std::int32_t i = 0; i < node.leaf_size[side]; ++i)
          if (visit(~node.child[side] + i)) return true;
      }
    }
    return false;
  }
  const TriangleFrame& triangle(std::int32_t slot) const { return triangles_[slot]; }

 private:
  std::vector<Node> nodes_;
  std::vector<TriangleFrame> triangles_;
  std::vector<std::int32_t> faces_;
};

// How many points are at most radii away from each centre; their indices, one centre after the other, ascending. Ends
// once more than `most` are found.
std::pair<std::vector<std::int64_t>, std::vector<std::int32_t>> points_within(const std::vector<Vec3>& points,
                                                                              const std::vector<Vec3>& centres,
                                                                              const std::vector<double>& radii,
                                                                              std::size_t most);

}  // namespace rlacd
