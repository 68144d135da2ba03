#include "surface/edges.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>

#include "core/elementary.hpp"
#include "core/invariant.hpp"
#include "core/stop.hpp"

namespace rlacd {

namespace {

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
    poll_stop(v);
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

// Faces closer in angle than this (radians) coincide to the precision of single-precision files.
constexpr double kSameAngle = 1e-4;

struct Spoke {
  std::int64_t halfedge;
  double angle;       // around the edge
  bool runs_forward;  // from the smaller vertex to the larger
};

Vec3 scaled_to_one(Vec3 a) { return a / std::max(norm(a), std::numeric_limits<double>::min()); }

// Angles of the faces around the edge from `low` to `high`. Any direction across the edge may be zero.
void measure_angles(const Mesh& mesh, std::int32_t low, std::int32_t high, std::vector<Spoke>& ring) {
  const Vec3 tail = mesh.vertices[low], axis = scaled_to_one(mesh.vertices[high] - tail);
  const Vec3 size = {std::fabs(axis.x), std::fabs(axis.y), std::fabs(axis.z)};
  Vec3 helper;
  helper[size.x <= size.y && size.x <= size.z ? 0 : size.y <= size.z ? 1 : 2] = 1;
  const Vec3 zero = scaled_to_one(cross(axis, helper)), quarter = cross(axis, zero);
  for (Spoke& spoke : ring) {
    const Triangle& face = mesh.faces[spoke.halfedge / 3];
    const Vec3 across = mesh.vertices[face[(spoke.halfedge + 2) % 3]] - tail;
    spoke.angle = angle_of(dot(across, quarter), dot(across, zero));
  }
}

// Puts coincident faces into the order that their windings require: their angles cannot tell which comes first, and a
// wrong guess would join the inside with the outside. If windings are consistent, both sides of a wedge are fronts, or
// both are backs.
void order_ties(std::vector<Spoke>& ring, bool all_tied) {
  const std::size_t count = ring.size();
  std::vector<double> gap(count, 0.0);  // to the next face
  if (!all_tied) {
    for (std::size_t i = 0; i + 1 < count; ++i) gap[i] = ring[i + 1].angle - ring[i].angle;
    gap[count - 1] = ring[0].angle + 2 * kPi - ring[count - 1].angle;
  }
  const auto is_tied = [&](std::size_t i) { return gap[i] < kSameAngle; };
  std::size_t turn = 0;
  while (turn < count && !is_tied(turn)) ++turn;
  if (turn == count) return;
  // Begin with a face whose position is certain, else after the widest wedge: no tie crosses it.
  turn = 0;
  while (turn < count && (is_tied(turn) || is_tied((turn + count - 1) % count))) ++turn;
  if (turn == count) turn = (std::max_element(gap.begin(), gap.end()) - gap.begin() + 1) % count;
  std::rotate(ring.begin(), ring.begin() + turn, ring.end());
  std::rotate(gap.begin(), gap.begin() + turn, gap.end());
  for (std::size_t i = 0, last = 0; i < count; ++i) {
    if (i > last) last = i;  // of the group of coincident faces that i is in
    while (last + 1 < count && is_tied(last)) ++last;
    // The wedge after a face shows its front if it runs forward; the next face shows its front to the same wedge if it
    // runs backward. With nothing to go by, fronts face out.
    const bool wanted = i > 0 && !ring[i - 1].runs_forward;
    const auto first = ring.begin() + i, end = ring.begin() + last + 1;
    const auto next = std::find_if(first, end, [&](const Spoke& spoke) { return spoke.runs_forward == wanted; });
    if (next != end) std::rotate(first, next, next + 1);
  }
}

}  // namespace

Buckets<Run> sorted_halfedges(const std::vector<Triangle>& faces, std::size_t vertices) {
  Buckets<Run> runs(vertices);
  for (const Triangle& f : faces)
    for (int c = 0; c < 3; ++c) runs.count(std::min(f[c], f[c == 2 ? 0 : c + 1]));
  runs.allocate();
  for (std::size_t f = 0; f < faces.size(); ++f) {
    poll_stop(f);
    for (int c = 0; c < 3; ++c) {
      const std::int32_t a = faces[f][c], b = faces[f][c == 2 ? 0 : c + 1];
      runs.add(std::min(a, b), {std::max(a, b), static_cast<std::uint32_t>(3 * f + c)});
    }
  }
  for (std::size_t v = 0; v < vertices; ++v) {
    poll_stop(v);
    const auto [begin, end] = runs.range(v);
    std::sort(begin, end,
              [](const Run& a, const Run& b) { return a.high != b.high ? a.high < b.high : a.halfedge < b.halfedge; });
  }
  return runs;
}

std::vector<std::uint32_t> mates_of(const std::vector<Triangle>& faces, std::size_t vertices) {
  Buckets<Run> runs = sorted_halfedges(faces, vertices);
  std::vector<std::uint32_t> mate(3 * faces.size());
  for (std::size_t v = 0; v < vertices; ++v) {
    const auto [begin, end] = runs.range(v);
    if ((end - begin) % 2 != 0) return {};
    for (const Run* r = begin; r != end; r += 2) {
      const bool is_pair = r[0].high == r[1].high && (r + 2 == end || r[2].high != r[0].high);
      if (!is_pair || ascends(faces, v, r[0]) == ascends(faces, v, r[1])) return {};
      mate[r[0].halfedge] = r[1].halfedge;
      mate[r[1].halfedge] = r[0].halfedge;
    }
  }
  return mate;
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

std::optional<ClosedBodies> closed_bodies(const Mesh& mesh) {
  const std::vector<std::uint32_t> mate = mates_of(mesh.faces, mesh.vertices.size());
  if (mate.empty()) return std::nullopt;
  Groups groups(mesh.faces.size());
  for (std::size_t h = 0; h < mate.size(); ++h)
    if (mate[h] < h) groups.join(static_cast<std::int64_t>(h / 3), mate[h] / 3);
  const auto [count, body_of] = groups.labels();
  ClosedBodies found{body_of, std::vector<double>(count), std::vector<double>(count), std::vector<Box>(count)};
  found.has_no_pinch = are_fans(mesh.faces, mate, mesh.vertices.size());
  std::vector<Vec3> normals(mesh.faces.size()), apex(count);
  double height2 = kInfinity;
  for (std::size_t f = 0; f < mesh.faces.size(); ++f) {
    poll_stop(f);
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

Wedges wedges_of(const Mesh& mesh, const std::vector<std::int64_t>& edge_of_halfedge, std::size_t edges,
                 const std::vector<bool>& trusted) {
  const auto halfedges = static_cast<std::int64_t>(edge_of_halfedge.size());
  Buckets<std::int64_t> around(edges);
  for (const std::int64_t edge : edge_of_halfedge) around.count(edge);
  around.allocate();
  for (std::int64_t h = 0; h < halfedges; ++h) around.add(edge_of_halfedge[h], h);

  Wedges wedges;
  wedges.halfedges.reserve(halfedges);
  wedges.sides.reserve(halfedges);
  std::vector<Spoke> ring;
  for (std::size_t edge = 0; edge < edges; ++edge) {
    poll_stop(edge);
    const auto [begin, end] = around.range(edge);
    ring.clear();
    bool all_trusted = !trusted.empty();
    for (const std::int64_t* h = begin; h != end; ++h) {
      const Triangle& face = mesh.faces[*h / 3];
      ring.push_back({*h, 0.0, face[*h % 3] < face[(*h + 1) % 3]});
      all_trusted = all_trusted && trusted[*h / 3];
    }
    if (ring.size() > 2) {
      const Triangle& face = mesh.faces[*begin / 3];
      const auto [low, high] = std::minmax(face[*begin % 3], face[(*begin + 1) % 3]);
      measure_angles(mesh, low, high, ring);
      std::stable_sort(ring.begin(), ring.end(), [](const Spoke& a, const Spoke& b) { return a.angle < b.angle; });
      order_ties(ring, all_trusted);
    }
    for (std::size_t i = 0; i < ring.size(); ++i) {
      const Spoke &a = ring[i], &b = ring[(i + 1) % ring.size()];
      wedges.halfedges.push_back({a.halfedge, b.halfedge});
      // Seen along the edge, a face that runs with it shows its front to what follows counter-clockwise.
      wedges.sides.push_back({2 * (a.halfedge / 3) + !a.runs_forward, 2 * (b.halfedge / 3) + b.runs_forward});
    }
  }
  return wedges;
}

}  // namespace rlacd
