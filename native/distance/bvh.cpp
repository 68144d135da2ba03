#include "distance/bvh.hpp"

#include <numeric>

#include "base/stop.hpp"

namespace rlacd {
namespace {

constexpr int kLeafSize = 4;
constexpr int kBins = 8;
// Deeper nodes are halved by count, so no tree is deeper than this plus log2 of the number of triangles: with the rest
// of the 31 bits, every traversal fits in a stack of fixed size.
constexpr int kDeepestHeuristicSplit = 48;
constexpr int kStack = 96;

double distance2_to_box(const Box& box, Vec3 p) {
  const double x = std::max(std::max(box.lower.x - p.x, p.x - box.upper.x), 0.0);
  const double y = std::max(std::max(box.lower.y - p.y, p.y - box.upper.y), 0.0);
  const double z = std::max(std::max(box.lower.z - p.z, p.z - box.upper.z), 0.0);
  return x * x + y * y + z * z;
}

// Lower and negated upper ends along the three axes: all are minima, so that they are extended at once.
struct Ends {
  double least[6];

  Ends() { std::fill(least, least + 6, std::numeric_limits<double>::infinity()); }
  explicit Ends(Vec3 p) : least{p.x, p.y, p.z, -p.x, -p.y, -p.z} {}
  void extend(const Ends& other) {
    for (int i = 0; i < 6; ++i) least[i] = other.least[i] < least[i] ? other.least[i] : least[i];
  }
  double lower(int axis) const { return least[axis]; }
  double upper(int axis) const { return -least[3 + axis]; }
  Vec3 extent() const { return {upper(0) - lower(0), upper(1) - lower(1), upper(2) - lower(2)}; }
  double half_area() const {
    const Vec3 e = extent();
    return e.x * e.y + e.y * e.z + e.z * e.x;
  }
  Box box() const { return {{lower(0), lower(1), lower(2)}, {upper(0), upper(1), upper(2)}}; }
};

struct Item {
  Ends ends;
  std::int32_t face;

  double centre(int axis) const { return 0.5 * (ends.lower(axis) + ends.upper(axis)); }
};

using Items = std::vector<Item>::iterator;

// Bounds of some items and of their centres.
struct Bounds {
  Ends box, centres;

  void extend(const Item& item) {
    box.extend(item.ends);
    centres.extend(Ends({item.centre(0), item.centre(1), item.centre(2)}));
  }
  void extend(const Bounds& other) {
    box.extend(other.box);
    centres.extend(other.centres);
  }
};

Bounds bounds(Items first, Items last) {
  Bounds all;
  for (Items item = first; item != last; ++item) all.extend(*item);
  return all;
}

struct Halves {
  Items middle;
  Bounds bounds[2];
};

Halves halve(Items first, Items last, int axis) {
  const Items middle = first + (last - first) / 2;
  std::nth_element(first, middle, last, [axis](const Item& a, const Item& b) {
    const double at = a.centre(axis), bt = b.centre(axis);
    return at != bt ? at < bt : a.face < b.face;
  });
  return {middle, {bounds(first, middle), bounds(middle, last)}};
}

// One pass sorts the items into bins; the bounds of both halves are those of their bins.
Halves split(Items first, Items last, const Ends& centres, int depth) {
  const Vec3 extent = centres.extent();
  const int axis = extent.x >= extent.y && extent.x >= extent.z ? 0 : extent.y >= extent.z ? 1 : 2;
  // Below or above these numbers, the scale would vanish or overflow.
  const bool is_told_apart = extent[axis] > 0x1p-1000 && extent[axis] <= std::numeric_limits<double>::max();
  if (depth >= kDeepestHeuristicSplit || !is_told_apart) return halve(first, last, axis);

  const double scale = kBins / extent[axis], origin = centres.lower(axis);
  const auto bin_of = [=](const Item& item) {
    return std::min(kBins - 1, static_cast<int>((item.centre(axis) - origin) * scale));
  };
  Bounds bins[kBins];
  int counts[kBins] = {};
  for (Items item = first; item != last; ++item) {
    const int bin = bin_of(*item);
    bins[bin].extend(*item);
    ++counts[bin];
  }
  double cost_above[kBins] = {};  // of bins [i, kBins)
  Ends above, below;
  for (int i = kBins - 1, count = 0; i > 0; --i) {
    if (counts[i] > 0) above.extend(bins[i].box);
    count += counts[i];
    cost_above[i] = count > 0 ? count * above.half_area() : 0;
  }
  double least = std::numeric_limits<double>::infinity();
  int cut = 0;
  for (int i = 1, count = 0; i < kBins; ++i) {
    if (counts[i - 1] > 0) below.extend(bins[i - 1].box);
    count += counts[i - 1];
    if (count == 0 || count == last - first) continue;
    const double cost = count * below.half_area() + cost_above[i];
    if (cost < least) least = cost, cut = i;
  }
  if (cut == 0) return halve(first, last, axis);
  Halves halves;
  for (int i = 0; i < kBins; ++i)
    if (counts[i] > 0) halves.bounds[i < cut ? 0 : 1].extend(bins[i]);
  halves.middle = std::partition(first, last, [=](const Item& item) { return bin_of(item) < cut; });
  return halves;
}

}  // namespace

Bvh::Bvh(const Mesh& mesh) {
  std::vector<Item> items(mesh.faces.size());
  for (std::size_t f = 0; f < items.size(); ++f) {
    for (const std::int32_t corner : mesh.faces[f]) items[f].ends.extend(Ends(mesh.vertices[corner]));
    items[f].face = static_cast<std::int32_t>(f);
  }

  struct Range {
    Items first, last;
    std::int32_t node;
    int depth;
    Ends centres;
  };
  nodes_.reserve(items.size() / 2 + 1);
  nodes_.emplace_back();
  std::vector<Range> open = {{items.begin(), items.end(), 0, 0, bounds(items.begin(), items.end()).centres}};
  while (!open.empty()) {
    poll_stop();
    const Range range = open.back();
    open.pop_back();
    // A mesh of one triangle cannot be halved: its second child stays an empty leaf.
    const Halves halves = range.last - range.first > 1 ? split(range.first, range.last, range.centres, range.depth)
                                                       : Halves{range.last, {bounds(range.first, range.last), {}}};
    const Items ends[3] = {range.first, halves.middle, range.last};
    for (int side = 0; side < 2; ++side) {
      const auto count = static_cast<std::int32_t>(ends[side + 1] - ends[side]);
      Node& node = nodes_[range.node];
      node.box[side] = halves.bounds[side].box.box();
      if (count <= kLeafSize) {
        node.child[side] = ~static_cast<std::int32_t>(ends[side] - items.begin());
        node.leaf_size[side] = count;
      } else {
        node.child[side] = static_cast<std::int32_t>(nodes_.size());
        open.push_back({ends[side], ends[side + 1], node.child[side], range.depth + 1, halves.bounds[side].centres});
        nodes_.emplace_back();
      }
    }
  }

  triangles_.reserve(items.size());
  faces_.reserve(items.size());
  for (const Item& item : items) {
    const Triangle& face = mesh.faces[item.face];
    triangles_.emplace_back(mesh.vertices[face[0]], mesh.vertices[face[1]], mesh.vertices[face[2]]);
    faces_.push_back(item.face);
  }
}

Bvh::Hit Bvh::closest(Vec3 p, std::int32_t hint, double enough, double within) const {
  Hit best;
  best.distance2 = within * within;
  const double enough2 = enough * enough;
  const auto look_at = [&](std::int32_t slot) {
    const Vec3 q = closest_on_triangle(triangles_[slot], p);
    const double d2 = norm2(q - p);
    if (d2 < best.distance2) best = {q, d2, slot};
  };
  if (hint >= 0) look_at(hint);

  struct Visit {
    std::int32_t child, leaf_size;
    double distance2;
  };
  Visit stack[kStack];
  int top = 0;
  stack[top++] = {0, 0, 0.0};
  while (top > 0 && best.distance2 > enough2) {
    const Visit visit = stack[--top];
    if (visit.distance2 >= best.distance2) continue;
    if (visit.child < 0) {
      for (std::int32_t i = 0; i < visit.leaf_size; ++i) look_at(~visit.child + i);
      continue;
    }
    const Node& node = nodes_[visit.child];
    Visit next[2];
    for (int side = 0; side < 2; ++side)
      next[side] = {node.child[side], node.leaf_size[side], distance2_to_box(node.box[side], p)};
    const int nearer = next[1].distance2 < next[0].distance2 ? 1 : 0;
    if (next[1 - nearer].distance2 < best.distance2) stack[top++] = next[1 - nearer];
    if (next[nearer].distance2 < best.distance2) stack[top++] = next[nearer];
  }
  return best;
}

}  // namespace rlacd
