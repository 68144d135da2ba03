#include "surface/bvh.hpp"

#include "core/parallel.hpp"
#include "core/stop.hpp"

namespace rlacd {
namespace {

constexpr int kLeafSize = 4;
constexpr int kBins = 8;
// Deeper nodes are halved by count, so no tree is deeper than this plus log2 of the number of triangles, and one made
// by the shape of another than one more: with the rest of the 31 bits, every traversal fits in a stack of fixed size.
constexpr int kDeepestHeuristicSplit = 48;
constexpr std::ptrdiff_t kAlone = 20'000;  // trees over no more triangles are made in one thread

// Lower and negated upper ends along the three axes: all are minima, so that they are extended at once.
struct Ends {
  double least[6];

  Ends() { std::fill(least, least + 6, kInfinity); }
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
  const int axis = longest_axis(extent);
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
  double least = kInfinity;
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

std::vector<Item> items_of(const Mesh& mesh) {
  std::vector<Item> items(mesh.faces.size());
  for (std::size_t i = 0; i < items.size(); ++i) {
    for (const std::int32_t corner : mesh.faces[i]) items[i].ends.extend(Ends(mesh.vertices[corner]));
    items[i].face = static_cast<std::int32_t>(i);
  }
  return items;
}

// Items that a node is yet to be made over.
struct Range {
  Items first, last;
  std::int32_t node;
  int depth;
  Ends centres;
};

// Sets the boxes and leaves of a node; calls open_child(side, range) for each child that is no leaf, before which
// range.node is unknown. The item at `begin` has the first slot.
template <class OpenChild>
void fill(Bvh::Node& node, const Range& range, Items begin, const OpenChild& open_child) {
  // A mesh of one triangle cannot be halved: its second child stays an empty leaf.
  const Halves halves = range.last - range.first > 1 ? split(range.first, range.last, range.centres, range.depth)
                                                     : Halves{range.last, {bounds(range.first, range.last), {}}};
  const Items ends[3] = {range.first, halves.middle, range.last};
  for (int side = 0; side < 2; ++side) {
    const auto count = static_cast<std::int32_t>(ends[side + 1] - ends[side]);
    node.box[side] = halves.bounds[side].box.box();
    if (count <= kLeafSize) {
      node.child[side] = ~static_cast<std::int32_t>(ends[side] - begin);
      node.leaf_size[side] = count;
    } else {
      open_child(side, Range{ends[side], ends[side + 1], -1, range.depth + 1, halves.bounds[side].centres});
    }
  }
}

// The nodes over some items, the first of them the root, which are sorted into the order of its leaves.
std::vector<Bvh::Node> nodes_over(Range root, Items begin) {
  std::vector<Bvh::Node> nodes(1);
  nodes.reserve(static_cast<std::size_t>(root.last - root.first) / 2 + 1);
  root.node = 0;
  std::vector<Range> open = {root};
  while (!open.empty()) {
    poll_stop();
    const Range range = open.back();
    open.pop_back();
    Bvh::Node node;
    fill(node, range, begin, [&](int side, Range child) {
      child.node = node.child[side] = static_cast<std::int32_t>(nodes.size());
      nodes.emplace_back();
      open.push_back(child);
    });
    nodes[range.node] = node;
  }
  return nodes;
}

// Appends the nodes of a tree over some items, which are sorted into the order of its leaves.
// The topmost nodes are made level by level, the trees below them side by side.
void grow(std::vector<Bvh::Node>& nodes, std::vector<Item>& items, int threads) {
  const auto root = static_cast<std::int32_t>(nodes.size());
  nodes.emplace_back();
  std::vector<Range> level = {{items.begin(), items.end(), root, 0, bounds(items.begin(), items.end()).centres}}, small;
  struct Made {
    Bvh::Node node;
    std::vector<std::pair<int, Range>> children;
  };
  while (!level.empty()) {
    std::vector<Range> large;
    for (const Range& range : level) (range.last - range.first > kAlone ? large : small).push_back(range);
    std::vector<Made> made(large.size());
    parallel_for(large.size(), threads, [&](std::size_t i) {
      fill(made[i].node, large[i], items.begin(),
           [&](int side, const Range& child) { made[i].children.emplace_back(side, child); });
    });
    level.clear();
    for (std::size_t i = 0; i < large.size(); ++i) {
      for (auto& [side, child] : made[i].children) {
        child.node = made[i].node.child[side] = static_cast<std::int32_t>(nodes.size());
        nodes.emplace_back();
        level.push_back(child);
      }
      nodes[large[i].node] = made[i].node;
    }
  }
  std::vector<std::vector<Bvh::Node>> trees(small.size());
  parallel_for(small.size(), threads, [&](std::size_t i) { trees[i] = nodes_over(small[i], items.begin()); });
  std::size_t count = nodes.size();
  for (const std::vector<Bvh::Node>& tree : trees) count += tree.size() - 1;
  nodes.reserve(count);
  for (std::size_t i = 0; i < small.size(); ++i) {
    // The root of each has a place among the topmost nodes; the others follow.
    const auto shift = static_cast<std::int32_t>(nodes.size()) - 1;
    for (Bvh::Node& node : trees[i])
      for (std::int32_t& child : node.child)
        if (child >= 0) child += shift;
    nodes[small[i].node] = trees[i][0];
    nodes.insert(nodes.end(), trees[i].begin() + 1, trees[i].end());
  }
}

}  // namespace

Bvh::Bvh(const Mesh& mesh, int threads) {
  std::vector<Item> items = items_of(mesh);
  grow(nodes_, items, threads);
  triangles_.reserve(items.size());
  faces_.reserve(items.size());
  for (const Item& item : items) {
    const auto [a, b, c] = corners_of(mesh, mesh.faces[item.face]);
    triangles_.emplace_back(a, b, c);
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
      next[side] = {node.child[side], node.leaf_size[side], node.box[side].distance2(p)};
    const int nearer = next[1].distance2 < next[0].distance2 ? 1 : 0;
    if (next[1 - nearer].distance2 < best.distance2) stack[top++] = next[1 - nearer];
    if (next[nearer].distance2 < best.distance2) stack[top++] = next[nearer];
  }
  return best;
}

Bvh::Hit Bvh::closest_near(Vec3 p, std::int32_t near) const {
  constexpr double kSlack = 1e-7;  // of the triangle's longest edge
  if (near >= 0) {
    const Hit hit = closest(p, -1, 0, distance(near, p) + kSlack * std::sqrt(triangle(near).longest2));
    if (hit.slot >= 0) return hit;
  }
  return closest(p);
}

std::pair<std::vector<std::int64_t>, std::vector<std::int32_t>> points_within(const std::vector<Vec3>& points,
                                                                              const std::vector<Vec3>& centres,
                                                                              const std::vector<double>& radii,
                                                                              std::size_t most) {
  Mesh mesh{points, {}};
  for (std::int32_t i = 0; i < static_cast<std::int32_t>(points.size()); ++i) mesh.faces.push_back({i, i, i});
  const Bvh tree(mesh);
  std::vector<std::int64_t> counts(centres.size());
  std::vector<std::int32_t> found;
  for (std::size_t i = 0; i < centres.size() && found.size() <= most; ++i) {
    poll_stop(i);
    const std::size_t before = found.size();
    const double enough = radii[i] * radii[i];
    tree.any_of([&](const Box& box) { return box.distance2(centres[i]) <= enough; },
                [&](std::int32_t slot) {
                  if (norm2(tree.triangle(slot).a - centres[i]) <= enough) found.push_back(tree.face(slot));
                  return false;
                });
    std::sort(found.begin() + static_cast<std::ptrdiff_t>(before), found.end());
    counts[i] = static_cast<std::int64_t>(found.size() - before);
  }
  return {std::move(counts), std::move(found)};
}

}  // namespace rlacd
