#include "solid/filled.hpp"

#include <optional>

#include "core/mesh_measures.hpp"
#include "core/stop.hpp"

namespace rlacd {
namespace {

// The hull grows by this share about its centre: far above rounding even for thin ones, far below what matters.
constexpr double kGrowth = 1e-8;

// Rounding may only make boxes meet: this share of the coordinates.
constexpr double kSlack = 1e-12;

struct Facet {
  Plane plane;                          // that all the hull is below
  Corners corner;                       // the line through the last two is followed backwards, out of the solid's box
  Vec3 inwards[3];                      // across the side from each corner to the next
  Vec3 along;                           // from the second corner to the third, over the square of their distance
  double doubled_area = 0, inside = 0;  // of the segments' triangles; how much of the last side is in the solid
};

struct Segment {
  Vec3 from, to;
};

class Filled {
 public:
  Filled(const Mesh& solid, const Bvh& bvh, const Mesh& hull, Vec3 centre)
      : solid_(solid), bvh_(bvh), centre_(centre), box_(box_of_faces(solid)) {
    std::vector<Vec3> corners;
    for (const Vec3 p : hull.vertices) corners.push_back(centre + (1 + kGrowth) * (p - centre));
    slack_ = kSlack * std::max({max_abs(box_.lower), max_abs(box_.upper), max_abs(centre)});
    for (const Triangle& face : hull.faces) {
      poll_stop();
      add_facet({corners[face[0]], corners[face[1]], corners[face[2]]}, corners);
    }
  }

  double volume() {
    for (std::size_t i = 0; i < facets_.size(); ++i) crossing_.push_back(static_cast<std::int32_t>(i));
    visit(0, 0);
    for (Facet& facet : facets_) {
      look_behind(facet);
      const Corners& t = facet.corner;
      const double area = facet.doubled_area + facet.inside * dot(facet.plane.normal, long_normal(t));
      sixfold_ += facet.plane.depth(centre_) * area;
    }
    return sixfold_ / 6;
  }

 private:
  void add_facet(Corners t, const std::vector<Vec3>& corners) {
    const Vec3 normal = normalized(long_normal(t));
    if (!(std::fabs(norm2(normal) - 1) < 1e-12)) return;  // without an area
    // Out of the solid's box on the shortest way.
    double least = std::numeric_limits<double>::infinity();
    Facet facet;
    for (int k = 0; k < 3; ++k, std::rotate(t.begin(), t.begin() + 1, t.end())) {
      const Vec3 back = normalized(t[1] - t[2]);
      double way = std::numeric_limits<double>::infinity();
      for (int axis = 0; axis < 3; ++axis)
        if (back[axis] != 0)
          way = std::min(way, ((back[axis] > 0 ? box_.upper : box_.lower)[axis] - t[1][axis]) / back[axis]);
      if (way < least) least = way, facet.corner = t;
    }
    // The normal of a sliver may be any: its plane only must not cut anything off.
    facet.plane = {normal, -std::numeric_limits<double>::infinity()};
    for (const Vec3 p : corners) facet.plane.offset = std::max(facet.plane.offset, dot(normal, p));
    for (int k = 0; k < 3; ++k)
      facet.inwards[k] = normalized(cross(normal, facet.corner[(k + 1) % 3] - facet.corner[k]));
    const Vec3 side = facet.corner[2] - facet.corner[1];
    facet.along = 1 / norm2(side) * side;
    facets_.push_back(facet);
  }

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
        const double depth = plane.depth(middle), reach = reach_along(plane.normal, half) + slack_;
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
    polygon_.assign({{0, 0}, {1, 0}, {0, 1}});  // shares of the second and the third corner
    bool is_within = true;
    for (std::size_t i = first; i < crossing_.size(); ++i) {
      Facet& facet = facets_[crossing_[i]];
      std::array<double, 3> height;
      for (int k = 0; k < 3; ++k) height[k] = -facet.plane.depth(solid_.vertices[face[k]]);
      if (const std::optional<Segment> segment = section(face, height)) add_segment(facet, *segment);
      if (!is_within) continue;
      const auto height_at = [&](const PlanePoint& p) {
        return height[0] + p[0] * (height[1] - height[0]) + p[1] * (height[2] - height[0]);
      };
      const Lies lies = split(polygon_, height_at, below_, above_);
      if (lies == Lies::kAcross) polygon_.swap(below_);
      is_within = lies != Lies::kAbove;
    }
    if (!is_within) return;
    double share = 0;
    for (std::size_t k = 2; k < polygon_.size(); ++k) share += doubled_area(polygon_[0], polygon_[k - 1], polygon_[k]);
    const Corners t = corners_of(solid_, face);
    sixfold_ += share * dot(t[0] - centre_, long_normal(t));
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

  static void add_segment(Facet& facet, const Segment& segment) {
    const Corners& t = facet.corner;
    double enter = 0, leave = 1;
    for (int k = 0; k < 3; ++k) {
      const double from = dot(facet.inwards[k], segment.from - t[k]), to = dot(facet.inwards[k], segment.to - t[k]);
      if (from < 0 && to < 0) leave = 0;
      if ((from < 0) != (to < 0))
        (from < 0 ? enter : leave) =
            from < 0 ? std::max(enter, from / (from - to)) : std::min(leave, from / (from - to));
    }
    if (enter < leave) {
      const Vec3 p = on_the_way(segment.from, segment.to, enter), q = on_the_way(segment.from, segment.to, leave);
      facet.doubled_area += dot(facet.plane.normal, cross(p - t[0], q - t[0]));
    }
    add_crossing(facet, segment, false);
  }

  // Where a segment crosses the line of the last side, behind its start or not: all after that is in the solid once
  // more or once less.
  static void add_crossing(Facet& facet, const Segment& segment, bool is_behind) {
    const Vec3 start = facet.corner[1];
    const double from = dot(facet.inwards[1], segment.from - start), to = dot(facet.inwards[1], segment.to - start);
    if ((from < 0) == (to < 0)) return;
    const double at = dot(facet.along, on_the_way(segment.from, segment.to, from / (from - to)) - start);
    if (at < 1 && (at < 0) == is_behind) facet.inside += (from < 0 ? -1 : 1) * (1 - std::max(at, 0.0));
  }

  // Adds the crossings behind the start of the last side.
  void look_behind(Facet& facet) const {
    const Plane &plane = facet.plane, side = {facet.inwards[1], dot(facet.inwards[1], facet.corner[1])};
    const Vec3 ahead = normalized(facet.along);
    const double start = dot(ahead, facet.corner[1]);
    const auto meets = [&](const Box& box) {
      if (box.is_empty()) return false;
      const Vec3 middle = 0.5 * (box.lower + box.upper), half = 0.5 * (box.upper - box.lower);
      return std::fabs(plane.depth(middle)) <= reach_along(plane.normal, half) + slack_ &&
             std::fabs(side.depth(middle)) <= reach_along(side.normal, half) + slack_ &&
             dot(ahead, middle) - start <= reach_along(ahead, half) + slack_;
    };
    bvh_.any_of(meets, [&](std::int32_t slot) {
      const Triangle& face = solid_.faces[bvh_.face(slot)];
      std::array<double, 3> height;
      for (int k = 0; k < 3; ++k) height[k] = -plane.depth(solid_.vertices[face[k]]);
      if (const std::optional<Segment> segment = section(face, height)) add_crossing(facet, *segment, true);
      return false;
    });
  }

  const Mesh& solid_;
  const Bvh& bvh_;
  const Vec3 centre_;
  const Box box_;
  double slack_;
  std::vector<Facet> facets_;
  std::vector<std::int32_t> crossing_;  // the nodes on the way from the root, one group after the other
  std::vector<PlanePoint> polygon_, below_, above_;
  double sixfold_ = 0;
};

}  // namespace

double filled(const Mesh& solid, const Surface& surface, const ConvexBody& hull) {
  const Mass mass = mesh_mass(hull.mesh());
  if (!(mass.volume > 0)) return 0;
  return std::clamp(Filled(solid, surface.bvh(), hull.mesh(), mass.centre).volume(), 0.0, mass.volume);
}

}  // namespace rlacd
