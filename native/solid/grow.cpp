// A convex polytope grown from a hull through a solid, until the solid's surface stops it on all sides.
//
// In:  a closed solid and a tree over it, a convex hull of a part of it, a depth t.
// Out: half-spaces n . x <= d that hold the hull. If the solid's surface comes no deeper than t into the hull, it comes
//      no deeper into their intersection.
// How: faces are taken in the order of their distance from the hull, measured along the hull's facets. A face that
//      comes deeper than t into the intersection so far adds a half-space: under its own plane if the hull reaches
//      beyond that by no more than t, so that a bar keeps its sides and ends; otherwise under the plane of the hull's
//      facet that separates it best.

#include <queue>
#include <tuple>

#include "core/stop.hpp"
#include "solid/against.hpp"

namespace rlacd {

namespace {

constexpr double kTouching = 1e-6;  // a face no farther than this from the hull is at no distance

class Growth {
 public:
  Growth(const Mesh& solid, const Bvh& bvh, const ConvexBody& hull, double depth)
      : solid_(solid), bvh_(bvh), corners_(hull.mesh().vertices), planes_(hull.planes()), depth_(depth) {}

  std::vector<HalfSpace> run() {
    open_children(0);
    while (!open_.empty()) {
      poll_stop();
      const Item item = open_.top();
      open_.pop();
      if (item.node >= 0) {
        if (is_in(item.box)) open_children(item.node);
      } else {
        meet(item);
      }
    }
    return std::move(found_);
  }

 private:
  struct Item {
    double distance;
    std::int32_t node;  // -1 for a face
    Box box;            // of the node
    std::int32_t face = -1;
    double area = 0;
    Vec3 normal{};
    double beyond = 0;  // how far the hull reaches beyond the face's plane
    bool is_natural = false;

    std::tuple<double, bool, bool, double, std::int32_t> order() const {
      return {distance, node < 0, !is_natural, -area, node < 0 ? face : node};
    }
    bool operator<(const Item& other) const { return order() > other.order(); }
  };

  void open_children(std::int32_t number) {
    const Bvh::Node& node = bvh_.nodes()[number];
    for (int side = 0; side < 2; ++side) {
      if (node.child[side] >= 0) {
        const Box& box = node.box[side];
        const Vec3 middle = 0.5 * (box.lower + box.upper), half = box.upper - middle;
        const auto least = [&](Vec3 n) { return dot(n, middle) - reach_along(n, half); };
        if (is_in(box)) open_.push({distance(least), node.child[side], box});
        continue;
      }
      for (std::int32_t i = 0; i < node.leaf_size[side]; ++i) open_face(bvh_.face(~node.child[side] + i));
    }
  }

  void open_face(std::int32_t face) {
    const auto [a, b, c] = corners_of(solid_, solid_.faces[face]);
    const Vec3 product = cross(b - a, c - a);
    const double area = norm(product);
    if (!(area > 0)) return;
    const Vec3 n = (1 / area) * product;
    double beyond = 0;
    for (const Vec3 p : corners_) beyond = std::max(beyond, dot(n, p - a));
    const auto least = [&, a = a, b = b, c = c](Vec3 m) { return std::min({dot(m, a), dot(m, b), dot(m, c)}); };
    open_.push({distance(least), -1, {}, face, area, n, beyond, beyond <= depth_});
  }

  // How far something is beyond the facet of the hull that it is farthest beyond, given its least height.
  template <class Height>
  double distance(const Height& height) const {
    double most = 0;
    for (std::int32_t i = 0; i < static_cast<std::int32_t>(planes_.size()); ++i)
      most = std::max(most, height(planes_.normal(i)) - planes_.offset(i));
    return most > kTouching ? most : 0;
  }

  // Whether some of a box may be deep in the intersection.
  bool is_in(const Box& box) const {
    const Vec3 middle = 0.5 * (box.lower + box.upper), half = box.upper - middle;
    return std::none_of(found_.begin(), found_.end(), [&](const HalfSpace& space) {
      return dot(space.normal, middle) - reach_along(space.normal, half) >= space.offset - depth_;
    });
  }

  void meet(const Item& item) {
    const auto [a, b, c] = corners_of(solid_, solid_.faces[item.face]);
    Polygon polygon = {a, b, c};
    for (const HalfSpace& space : found_) {
      const double offset = space.offset - depth_;
      if (!keep_below(polygon, [&](Vec3 p) { return dot(space.normal, p) - offset; })) return;
    }
    if (item.is_natural) {
      found_.push_back({item.normal, dot(item.normal, a) + item.beyond});
      return;
    }
    double most = -kInfinity;
    std::int32_t best = 0;
    for (std::int32_t i = 0; i < static_cast<std::int32_t>(planes_.size()); ++i) {
      double least = kInfinity;
      for (const Vec3 p : polygon) least = std::min(least, dot(planes_.normal(i), p));
      if (least - planes_.offset(i) > most) {
        most = least - planes_.offset(i);
        best = i;
      }
    }
    found_.push_back({planes_.normal(best), planes_.offset(best) + std::max(0.0, most)});
  }

  const Mesh& solid_;
  const Bvh& bvh_;
  const std::vector<Vec3>& corners_;
  const ConvexPlanes& planes_;
  const double depth_;
  std::priority_queue<Item> open_;
  std::vector<HalfSpace> found_;
};

}  // namespace

std::vector<HalfSpace> Against::grown(const ConvexBody& hull, double depth) const {
  return Growth(solid_, surface_.bvh(), hull, depth).run();
}

}  // namespace rlacd
