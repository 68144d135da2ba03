// How much of a convex hull a solid fills.
//
// In:  a closed, oriented triangle mesh of any shape and a tree of boxes over it; a convex hull, whose corners and
//      facets may lie on the solid's.
// Out: the volume of what both hold: never less by more than rounding, larger by at most 3e-8 of the hull's volume.
// How: the flux of p / 3 through the surface of what both hold. Through a face of the solid it is that of the whole
//      face times the share of it within the hull. Through a facet of the hull it is the facet's distance from the
//      centre times the area of the solid's section, a sum over the faces that cross the facet's plane: each adds the
//      triangle between its segment within the facet and a corner of the facet. To these comes the triangle between
//      that corner and what is inside the solid along the side across: a sum over the crossings with the side's whole
//      line, each by how much of the side comes after it; or all or nothing, as the neighbour knows where no face
//      crosses the side. Every term changes continuously with the places of hull and solid, but for a face in a facet's
//      plane: the hull grows by a tiny share of itself, so that what touches it lies within. Nothing is traced or
//      decided from several crossings, so nothing can be contradictory. Where the solid overlaps itself, it counts as
//      often as it is there.

#include <optional>

#include "core/mesh_measures.hpp"
#include "core/stop.hpp"
#include "solid/against.hpp"

namespace rlacd {
namespace {

// The hull grows by this share about its centre: far above rounding even for thin ones, far below what matters.
constexpr double kGrowth = 1e-8;

struct Facet {
  Plane plane;  // that all the hull is below
  Corners corner;
  double doubled_area = 0;
  std::array<std::int32_t, 3> beyond = {-1, -1, -1};  // what side lies on the side across corner k: 3 facet + corner
  // Of the segments in which faces cross it: the doubled area of their triangles with the first corner, and their sum.
  double fans = 0;
  Vec3 drift;
  double doubled_inside = 0;  // the area inside the solid
  bool is_known = false;

  Vec3 at(int k) const { return corner[k % 3]; }
  // The doubled area of the segments' triangles with corner k.
  double fans_at(int k) const { return fans - dot(plane.normal, cross(corner[k] - corner[0], drift)); }
};

struct Segment {
  Vec3 from, to;
};

class Filled {
 public:
  Filled(const Mesh& solid, const Bvh& bvh, const Mesh& hull, Vec3 centre) : solid_(solid), bvh_(bvh), centre_(centre) {
    for (const Box& box : bvh.nodes()[0].box)
      if (!box.is_empty()) box_.extend(box);
    size_ = std::max(max_abs(box_.lower), max_abs(box_.upper));
    std::vector<Vec3> corners;
    for (const Vec3 p : hull.vertices) {
      corners.push_back(centre + (1 + kGrowth) * (p - centre));
      size_ = std::max(size_, max_abs(corners.back()));
    }
    std::vector<std::array<std::int32_t, 3>> sides;  // two corners of the hull, and 3 facet + corner
    for (const Triangle& face : hull.faces) {
      poll_stop();
      const Corners t = {corners[face[0]], corners[face[1]], corners[face[2]]};
      const Vec3 normal = normalized(long_normal(t));
      if (!(std::fabs(norm2(normal) - 1) < kRounding)) continue;  // without an area
      Facet facet;
      facet.plane = {normal, -kInfinity};
      facet.corner = t, facet.doubled_area = norm(long_normal(t));
      // The normal of a sliver may be any: its plane only must not cut anything off.
      for (const Vec3 p : corners) facet.plane.offset = std::max(facet.plane.offset, dot(normal, p));
      for (std::int32_t k = 0; k < 3; ++k) {
        const auto [low, high] = std::minmax(face[(k + 1) % 3], face[(k + 2) % 3]);
        sides.push_back({low, high, 3 * static_cast<std::int32_t>(facets_.size()) + k});
      }
      facets_.push_back(facet);
    }
    std::sort(sides.begin(), sides.end());
    for (std::size_t i = 1; i < sides.size(); ++i) {
      const auto &a = sides[i - 1], &b = sides[i];
      if (a[0] != b[0] || a[1] != b[1]) continue;
      facets_[a[2] / 3].beyond[a[2] % 3] = b[2];
      facets_[b[2] / 3].beyond[b[2] % 3] = a[2];
    }
  }

  double volume() {
    for (std::size_t i = 0; i < facets_.size(); ++i) crossing_.push_back(static_cast<std::int32_t>(i));
    visit(0, 0);
    measure_facets();
    for (const Facet& facet : facets_) sixfold_ += facet.plane.depth(centre_) * facet.doubled_inside;
    return sixfold_ / 6;
  }

 private:
  // Adds all below a node of the solid's tree. The facets that cross it are crossing_[first, ...).
  void visit(std::int32_t at, std::size_t first) {
    poll_stop();
    const Bvh::Node& node = bvh_.nodes()[at];
    const std::size_t last = crossing_.size();
    for (int side = 0; side < 2; ++side) {
      const Box& box = node.box[side];
      if (box.is_empty()) continue;
      const Vec3 middle = 0.5 * (box.lower + box.upper), half = 0.5 * (box.upper - box.lower);
      bool is_outside = false;
      for (std::size_t i = first; i < last && !is_outside; ++i) {
        const Plane& plane = facets_[crossing_[i]].plane;
        const double depth = plane.depth(middle),
                     reach = reach_along(plane.normal, half) + kRounding * size_;  // rounding may only make boxes meet
        is_outside = depth < -reach;
        if (depth < reach) crossing_.push_back(crossing_[i]);
      }
      if (!is_outside && node.child[side] >= 0) visit(node.child[side], last);
      for (std::int32_t k = 0; !is_outside && k < node.leaf_size[side]; ++k)
        add_face(solid_.faces[bvh_.face(~node.child[side] + k)], last);
      crossing_.resize(last);
    }
  }

  void add_face(const Triangle& face, std::size_t first) {
    const Corners t = corners_of(solid_, face);
    polygon_.assign({{0, 0}, {1, 0}, {0, 1}});  // shares of the second and the third corner
    bool is_within = true;
    for (std::size_t i = first; i < crossing_.size(); ++i) {
      Facet& facet = facets_[crossing_[i]];
      const std::array<double, 3> height = heights(facet.plane, t);
      if (std::max({height[0], height[1], height[2]}) <= 0) continue;
      if (const std::optional<Segment> segment = section(face, height)) add_segment(facet, *segment);
      const auto height_at = [&](const PlanePoint& p) {
        return height[0] + p[0] * (height[1] - height[0]) + p[1] * (height[2] - height[0]);
      };
      is_within = is_within && keep_below(polygon_, height_at);
    }
    if (!is_within) return;
    double share = 0;
    for (std::size_t k = 2; k < polygon_.size(); ++k) share += doubled_area(polygon_[0], polygon_[k - 1], polygon_[k]);
    sixfold_ += share * dot(t[0] - centre_, long_normal(t));
  }

  static std::array<double, 3> heights(const Plane& plane, const Corners& t) {
    return {-plane.depth(t[0]), -plane.depth(t[1]), -plane.depth(t[2])};
  }

  // Where a face crosses a plane above which its corners have these heights: the solid lies to the left, seen from
  // above. Both faces at an edge find the same bits.
  std::optional<Segment> section(const Triangle& face, const std::array<double, 3>& height) const {
    Segment segment;
    bool is_crossing = false;
    for (int k = 0; k < 3; ++k) {
      int from = k, to = (k + 1) % 3;
      if ((height[from] <= 0) == (height[to] <= 0)) continue;
      is_crossing = true;
      Vec3& end = height[from] <= 0 ? segment.to : segment.from;
      if (face[from] > face[to]) std::swap(from, to);
      end = on_the_way(solid_.vertices[face[from]], solid_.vertices[face[to]],
                       height[from] / (height[from] - height[to]));
    }
    return is_crossing ? std::optional(segment) : std::nullopt;
  }

  // What of it lies within the facet.
  static void add_segment(Facet& facet, const Segment& segment) {
    double enter = 0, leave = 1;
    for (int k = 0; k < 3; ++k) {
      const Vec3 inwards = cross(facet.plane.normal, facet.at(k + 1) - facet.at(k));
      const double from = dot(inwards, segment.from - facet.at(k)), to = dot(inwards, segment.to - facet.at(k));
      if (from < 0 && to < 0) return;
      if (from < 0) enter = std::max(enter, from / (from - to));
      if (to < 0) leave = std::min(leave, from / (from - to));
    }
    if (enter >= leave) return;
    const Vec3 p = on_the_way(segment.from, segment.to, enter), q = on_the_way(segment.from, segment.to, leave);
    facet.fans += dot(facet.plane.normal, cross(p - facet.corner[0], q - facet.corner[0]));
    facet.drift = facet.drift + (q - p);
  }

  // The area of a facet inside the solid is that of its segments' triangles with a corner, and of the triangle that
  // this corner makes with what is inside along the side across. Where the solid does not cross that side, all or
  // nothing of it is, and of the neighbour's; else facets do not rely on each other: in faces that are almost in their
  // planes they may find crossings in different places.
  void measure_facets() {
    std::vector<std::int32_t> known;
    const auto settle = [&](std::int32_t at, double inside) {
      Facet& facet = facets_[at / 3];
      facet.doubled_inside = facet.fans_at(at % 3) + inside * facet.doubled_area;
      facet.is_known = true;
      known.push_back(at / 3);
    };
    for (std::size_t i = 0; i < facets_.size(); ++i) {
      if (!facets_[i].is_known) {
        const int k = across_shortest(facets_[i]);
        settle(3 * static_cast<std::int32_t>(i) + k, inside_of(facets_[i], k));
      }
      while (!known.empty()) {
        const Facet& facet = facets_[known.back()];
        known.pop_back();
        const Corners& t = facet.corner;
        const double longest = norm(t[(longest_side(t) + 1) % 3] - t[longest_side(t)]);
        const double rounding = kLastBits * size_ * longest / facet.doubled_area;
        for (int k = 0; k < 3; ++k) {
          if (facet.beyond[k] < 0 || facets_[facet.beyond[k] / 3].is_known) continue;
          const double inside = (facet.doubled_inside - facet.fans_at(k)) / facet.doubled_area;
          if (std::fabs(inside - std::round(inside)) + rounding < kHair) settle(facet.beyond[k], std::round(inside));
        }
      }
    }
  }

  // The corner across which the line through the side leaves the solid's box soonest.
  int across_shortest(const Facet& facet) const {
    int shortest = 0;
    double least = kInfinity;
    for (int k = 0; k < 3; ++k) {
      const Vec3 start = facet.at(k + 1), back = normalized(start - facet.at(k + 2));
      double way = kInfinity;
      for (int axis = 0; axis < 3; ++axis)
        if (back[axis] != 0)
          way = std::min(way, ((back[axis] > 0 ? box_.upper : box_.lower)[axis] - start[axis]) / back[axis]);
      if (way < least) least = way, shortest = k;
    }
    return shortest;
  }

  // How much of the side across a corner is inside the solid: the sum over its line's crossings with the
  // solid, from outside, each by how much of the side comes after it.
  double inside_of(const Facet& facet, int k) const {
    const Vec3 start = facet.at(k + 1), end = facet.at(k + 2), ahead = normalized(end - start);
    const Vec3 across = cross(facet.plane.normal, ahead);
    const Plane& plane = facet.plane;
    const auto reaches = [&](const Vec3& n, const Box& box, double depth) {
      return depth <= reach_along(n, 0.5 * (box.upper - box.lower)) + kRounding * size_;
    };
    const auto meets = [&](const Box& box) {
      poll_stop();
      if (box.is_empty()) return false;
      const Vec3 middle = 0.5 * (box.lower + box.upper);
      return reaches(plane.normal, box, std::fabs(plane.depth(middle))) &&
             reaches(across, box, std::fabs(dot(across, middle - start))) &&
             reaches(ahead, box, dot(ahead, middle - end));
    };
    double inside = 0;
    bvh_.any_of(meets, [&](std::int32_t slot) {
      const Triangle& face = solid_.faces[bvh_.face(slot)];
      const std::optional<Segment> segment = section(face, heights(plane, corners_of(solid_, face)));
      if (!segment) return false;
      const double from = dot(across, segment->from - start), to = dot(across, segment->to - start);
      if ((from < 0) == (to < 0)) return false;
      const Vec3 crossing = on_the_way(segment->from, segment->to, from / (from - to));
      const double after = dot(ahead, end - crossing) / norm(end - start);
      inside += (from < 0 ? -1 : 1) * std::clamp(after, 0.0, 1.0);
      return false;
    });
    return inside;
  }

  const Mesh& solid_;
  const Bvh& bvh_;
  const Vec3 centre_;
  Box box_;      // of the solid
  double size_;  // the largest coordinate
  std::vector<Facet> facets_;
  std::vector<std::int32_t> crossing_;  // the nodes on the way from the root, one group after the other
  std::vector<PlanePoint> polygon_;
  double sixfold_ = 0;
};

}  // namespace

double Against::filled(const ConvexBody& hull) const {
  const Mass mass = mesh_mass(hull.mesh());
  if (!(mass.volume > 0)) return 0;
  return std::clamp(Filled(solid_, surface_.bvh(), hull.mesh(), mass.centre).volume(), 0.0, mass.volume);
}

}  // namespace rlacd
