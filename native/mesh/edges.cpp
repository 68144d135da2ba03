#include "mesh/edges.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>
#include <tuple>

#include "base/invariant.hpp"
#include "base/stop.hpp"

namespace rlacd {

namespace {

constexpr std::size_t kBetweenPolls = 4096;

// The other halfedge along the same edge; empty if there are not always two, in opposite directions.
std::vector<std::uint32_t> mates_of(const std::vector<Triangle>& faces, std::size_t vertices) {
  Buckets<Run> runs = sorted_halfedges(faces, vertices);
  std::vector<std::uint32_t> mate(3 * faces.size());
  for (std::size_t v = 0; v < vertices; ++v) {
    const auto [begin, end] = runs.range(v);
    if ((end - begin) % 2 != 0) return {};
    for (const Run* r = begin; r != end; r += 2) {
      const bool is_pair = r[0].high == r[1].high && (r + 2 == end || r[2].high != r[0].high);
      const auto low = static_cast<std::int32_t>(v);
      const bool ascends[2] = {faces[r[0].halfedge / 3][r[0].halfedge % 3] == low,
                               faces[r[1].halfedge / 3][r[1].halfedge % 3] == low};
      if (!is_pair || ascends[0] == ascends[1]) return {};
      mate[r[0].halfedge] = r[1].halfedge;
      mate[r[1].halfedge] = r[0].halfedge;
    }
  }
  return mate;
}

std::uint32_t next_of(std::uint32_t halfedge) { return halfedge % 3 == 2 ? halfedge - 2 : halfedge + 1; }

// Whether the faces around each vertex form one fan.
bool are_fans(const std::vector<Triangle>& faces, const std::vector<std::uint32_t>& mate, std::size_t vertices) {
  std::vector<std::uint32_t> leaving(vertices, 0), some(vertices, 0);
  for (std::size_t f = 0; f < faces.size(); ++f)
    for (int c = 0; c < 3; ++c) {
      ++leaving[faces[f][c]];
      some[faces[f][c]] = static_cast<std::uint32_t>(3 * f + c);
    }
  for (std::size_t v = 0; v < vertices; ++v) {
    if (v % kBetweenPolls == 0) poll_stop();
    if (leaving[v] == 0) continue;
    std::uint32_t around = 0, at = some[v];
    do {
      ++around;
      at = next_of(mate[at]);
    } while (at != some[v]);
    if (around != leaving[v]) return false;
  }
  return true;
}

}  // namespace

Buckets<Run> sorted_halfedges(const std::vector<Triangle>& faces, std::size_t vertices) {
  Buckets<Run> runs(vertices);
  for (const Triangle& f : faces)
    for (int c = 0; c < 3; ++c) runs.count(std::min(f[c], f[c == 2 ? 0 : c + 1]));
  runs.allocate();
  for (std::size_t f = 0; f < faces.size(); ++f) {
    if (f % kBetweenPolls == 0) poll_stop();
    for (int c = 0; c < 3; ++c) {
      const std::int32_t a = faces[f][c], b = faces[f][c == 2 ? 0 : c + 1];
      runs.add(std::min(a, b), {std::max(a, b), static_cast<std::uint32_t>(3 * f + c)});
    }
  }
  for (std::size_t v = 0; v < vertices; ++v) {
    if (v % kBetweenPolls == 0) poll_stop();
    const auto [begin, end] = runs.range(v);
    std::sort(begin, end,
              [](const Run& a, const Run& b) { return a.high != b.high ? a.high < b.high : a.halfedge < b.halfedge; });
  }
  return runs;
}

Edges edges_of(const std::vector<Triangle>& faces, std::size_t vertices) {
  Buckets<Run> runs = sorted_halfedges(faces, vertices);
  Edges edges;
  edges.of_halfedge.resize(3 * faces.size());
  for (std::size_t v = 0; v < vertices; ++v) {
    const auto [begin, end] = runs.range(v);
    for (const Run* r = begin; r != end; ++r) {
      if (r == begin || r->high != r[-1].high) {
        edges.vertices.push_back({static_cast<std::int64_t>(v), r->high});
        edges.valence.push_back(0);
      }
      ++edges.valence.back();
      edges.of_halfedge[r->halfedge] = static_cast<std::int64_t>(edges.valence.size()) - 1;
    }
  }
  return edges;
}

Groups::Groups(std::size_t nodes) : parent_(nodes) { std::iota(parent_.begin(), parent_.end(), 0); }

std::int64_t Groups::root(std::int64_t node) {
  while (parent_[node] != node) node = parent_[node] = parent_[parent_[node]];
  return node;
}

void Groups::join(std::int64_t a, std::int64_t b) {
  a = root(a), b = root(b);
  parent_[std::max(a, b)] = std::min(a, b);
}

std::pair<std::int64_t, std::vector<std::int64_t>> Groups::labels() {
  std::vector<std::int64_t> label(parent_.size());
  std::int64_t count = 0;
  for (std::size_t i = 0; i < label.size(); ++i) {
    const std::int64_t first = root(static_cast<std::int64_t>(i));
    label[i] = first == static_cast<std::int64_t>(i) ? count++ : label[first];
  }
  return {count, std::move(label)};
}

ClosedBodies closed_bodies(const Mesh& mesh) {
  const std::vector<std::uint32_t> mate = mates_of(mesh.faces, mesh.vertices.size());
  ClosedBodies found;
  if (mate.empty()) return found;
  Groups groups(mesh.faces.size());
  for (std::size_t h = 0; h < mate.size(); ++h)
    if (mate[h] < h) groups.join(static_cast<std::int64_t>(h / 3), mate[h] / 3);
  std::tie(found.count, found.body) = groups.labels();
  found.has_no_pinch = are_fans(mesh.faces, mate, mesh.vertices.size());
  found.volume.resize(found.count);
  found.area.resize(found.count);
  found.box.resize(found.count);
  std::vector<Vec3> normals(mesh.faces.size()), apex(found.count);
  double height2 = std::numeric_limits<double>::infinity();
  for (std::size_t f = 0; f < mesh.faces.size(); ++f) {
    if (f % kBetweenPolls == 0) poll_stop();
    const auto [a, b, c] = mesh.faces[f];
    const Vec3 p = mesh.vertices[a], q = mesh.vertices[b], r = mesh.vertices[c];
    const Vec3 normal = cross(q - p, r - p);
    const double longest2 = std::max({norm2(q - p), norm2(r - q), norm2(p - r)});
    height2 = std::min(height2, longest2 > 0 ? norm2(normal) / longest2 : 0.0);
    normals[f] = normalized(normal);
    const std::int64_t body = found.body[f];
    if (found.box[body].is_empty()) apex[body] = p;
    found.volume[body] += dot(p - apex[body], cross(q - apex[body], r - apex[body])) / 6;
    found.area[body] += norm(normal) / 2;
    for (const Vec3 corner : {p, q, r}) found.box[body].extend(corner);
  }
  found.least_height = std::sqrt(height2);
  for (std::size_t h = 0; h < mate.size(); ++h)
    if (mate[h] < h) found.least_fold = std::min(found.least_fold, norm(normals[h / 3] + normals[mate[h] / 3]));
  return found;
}

Mesh separate_fans(const Mesh& mesh) {
  Mesh separate = mesh;
  const std::vector<std::uint32_t> mate = mates_of(mesh.faces, mesh.vertices.size());
  RLACD_ASSERT(mate.size() == 3 * mesh.faces.size());
  std::vector<char> is_seen(mate.size(), 0), has_fan(mesh.vertices.size(), 0);
  for (std::uint32_t h = 0; h < mate.size(); ++h) {
    if (h % kBetweenPolls == 0) poll_stop();
    if (is_seen[h]) continue;
    std::int32_t vertex = mesh.faces[h / 3][h % 3];
    if (has_fan[vertex]) {
      separate.vertices.push_back(mesh.vertices[vertex]);
      vertex = static_cast<std::int32_t>(separate.vertices.size()) - 1;
    } else {
      has_fan[vertex] = 1;
    }
    for (std::uint32_t at = h; !is_seen[at]; at = next_of(mate[at])) {
      is_seen[at] = 1;
      separate.faces[at / 3][at % 3] = vertex;
    }
  }
  return separate;
}

}  // namespace rlacd
