#include "mesh/wedges.hpp"

#include <algorithm>

#include "base/stop.hpp"

namespace rlacd {
namespace {

// Faces closer in angle than this (radians) coincide to the precision of single-precision files.
constexpr double kSameAngle = 1e-4;
constexpr std::size_t kBetweenPolls = 4096;

struct Spoke {
  std::int64_t halfedge;
  double angle;       // around the edge
  bool runs_forward;  // from the smaller vertex to the larger
};

Vec3 scaled_to_one(Vec3 a) {
  const double length = std::max(norm(a), std::numeric_limits<double>::min());
  return {a.x / length, a.y / length, a.z / length};
}

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
    spoke.angle = std::atan2(dot(across, quarter), dot(across, zero));
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
    if (edge % kBetweenPolls == 0) poll_stop();
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
