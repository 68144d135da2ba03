#include "surface/weld.hpp"

#include <algorithm>
#include <functional>
#include <unordered_map>

#include "core/stop.hpp"
#include "surface/edges.hpp"

namespace rlacd {

namespace {

struct Hash {
  std::size_t operator()(Vec3 p) const {
    std::size_t hash = 0;
    for (const double x : {p.x, p.y, p.z})  // -0.0 has the hash of 0.0
      hash = (hash ^ std::hash<double>()(x) ^ hash >> 29) * static_cast<std::size_t>(0x9e3779b97f4a7c15u);
    return hash;
  }
};

enum Worth : char { kDropped, kFace, kFilm };

// Whether a face with these corners is an even permutation of them in ascending order.
bool is_even(const Triangle& f) { return (f[0] < f[1]) + (f[1] < f[2]) + (f[2] < f[0]) == 2; }

// The corners of a face in ascending order.
Triangle sorted(Triangle f) {
  std::sort(f.begin(), f.end());
  return f;
}

// What distinguishes faces with the same lowest corner.
struct Rest {
  std::int32_t middle, high, face;
  bool has_same_corners(const Rest& o) const { return middle == o.middle && high == o.high; }
  bool operator<(const Rest& o) const {
    return middle != o.middle ? middle < o.middle : high != o.high ? high < o.high : face < o.face;
  }
};

// Calls visit(begin, end) with the Rest of all faces that have the same three corners, if they are several, in
// ascending order of the faces. Only faces of which is_counted(sorted corners) are looked at.
template <class IsCounted, class Visit>
void for_each_doubled(const std::vector<Triangle>& faces, std::size_t vertices, const IsCounted& is_counted,
                      const Visit& visit) {
  Buckets<Rest> by_low(vertices);
  for (std::size_t f = 0; f < faces.size(); ++f) {
    poll_stop(f);
    if (const Triangle s = sorted(faces[f]); is_counted(s)) by_low.count(s[0]);
  }
  by_low.allocate();
  for (std::size_t f = 0; f < faces.size(); ++f)
    if (const Triangle s = sorted(faces[f]); is_counted(s))
      by_low.add(s[0], {s[1], s[2], static_cast<std::int32_t>(f)});
  for (std::size_t v = 0; v < vertices; ++v) {
    poll_stop(v);
    const auto [begin, end] = by_low.range(v);
    if (end - begin < 2) continue;
    std::sort(begin, end);
    for (Rest *same = begin, *next; same < end; same = next) {
      for (next = same + 1; next < end && next->has_same_corners(*same);) ++next;
      if (next - same > 1) visit(same, next);
    }
  }
}

// Of the faces with the same three different corners, the first that is wound like most of them; it is a film if as
// many are wound in either way.
std::vector<char> worth_keeping(const std::vector<Triangle>& faces, std::size_t vertices) {
  const auto has_three = [](const Triangle& s) { return s[0] != s[1] && s[1] != s[2]; };
  std::vector<char> keep(faces.size(), kDropped);
  for (std::size_t f = 0; f < faces.size(); ++f)
    if (has_three(sorted(faces[f]))) keep[f] = kFace;
  for_each_doubled(faces, vertices, has_three, [&](const Rest* begin, const Rest* end) {
    int net = 0;
    for (const Rest* r = begin; r < end; ++r) net += is_even(faces[r->face]) ? 1 : -1;
    const Rest* kept = begin;
    while (net != 0 && is_even(faces[kept->face]) != (net > 0)) ++kept;
    for (const Rest* r = begin; r < end; ++r) keep[r->face] = kDropped;
    keep[kept->face] = net == 0 ? kFilm : kFace;
  });
  return keep;
}

}  // namespace

std::vector<std::int32_t> first_in_place(const std::vector<Vec3>& points) {
  std::unordered_map<Vec3, std::int32_t, Hash> known;
  known.reserve(points.size());
  std::vector<std::int32_t> first(points.size());
  for (std::size_t i = 0; i < points.size(); ++i) {
    poll_stop(i);
    first[i] = known.try_emplace(points[i], static_cast<std::int32_t>(i)).first->second;
  }
  return first;
}

Welded weld(const Mesh& mesh) {
  const std::vector<std::int32_t> first = first_in_place(mesh.vertices);
  std::vector<std::int32_t> number(mesh.vertices.size(), -1);
  for (const Triangle& face : mesh.faces)
    for (const std::int32_t corner : face) number[first[corner]] = 0;
  Welded result;
  Mesh& welded = result.mesh;
  for (std::size_t v = 0; v < number.size(); ++v) {
    if (number[v] < 0) continue;
    const Vec3 p = mesh.vertices[v];
    number[v] = static_cast<std::int32_t>(welded.vertices.size());
    welded.vertices.push_back({p.x + 0.0, p.y + 0.0, p.z + 0.0});
  }
  std::vector<Triangle> faces(mesh.faces.size());
  for (std::size_t f = 0; f < faces.size(); ++f)
    for (int c = 0; c < 3; ++c) faces[f][c] = number[first[mesh.faces[f][c]]];
  const std::vector<char> keep = worth_keeping(faces, welded.vertices.size());
  welded.faces.reserve(faces.size());
  for (std::size_t f = 0; f < faces.size(); ++f)
    if (keep[f] != kDropped) {
      welded.faces.push_back(faces[f]);
      result.is_film.push_back(keep[f] == kFilm);
    }
  return result;
}

std::vector<char> first_of_doubled(const std::vector<Triangle>& faces, std::size_t vertices) {
  std::vector<char> is_first(faces.size(), 1);
  for_each_doubled(
      faces, vertices, [](const Triangle&) { return true; },
      [&](const Rest* begin, const Rest* end) {
        for (const Rest* r = begin + 1; r < end; ++r) is_first[r->face] = 0;
      });
  return is_first;
}

}  // namespace rlacd
