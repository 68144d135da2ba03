#include "surface/crossings.hpp"

#include "core/stop.hpp"

namespace rlacd {
namespace {

Corners corners_of(const TriangleFrame& t) { return {t.a, t.a + t.ab, t.a + t.ac}; }

// Whether the triangles overlap along the axis by no more than `slack`.
bool is_separating(Vec3 axis, const Corners& a, const Corners& b, double slack) {
  const auto [low_a, high_a] = std::minmax({dot(axis, a[0]), dot(axis, a[1]), dot(axis, a[2])});
  const auto [low_b, high_b] = std::minmax({dot(axis, b[0]), dot(axis, b[1]), dot(axis, b[2])});
  const double ignored = slack > 0 ? slack * norm(axis) : 0;
  return high_a < low_b + ignored || high_b < low_a + ignored;
}

bool do_touch(const Corners& a, const Corners& b, double slack = 0) {
  const Vec3 normal_a = long_normal(a), normal_b = long_normal(b);
  if (is_separating(normal_a, a, b, slack) || is_separating(normal_b, a, b, slack)) return false;
  for (int i = 0; i < 3; ++i) {
    const Vec3 edge = a[(i + 1) % 3] - a[i];
    if (is_separating(cross(normal_a, edge), a, b, slack)) return false;  // of triangles in one plane
    for (int j = 0; j < 3; ++j)
      if (is_separating(cross(edge, b[(j + 1) % 3] - b[j]), a, b, slack)) return false;
  }
  return true;
}

}  // namespace

Crossings crossings(const Mesh& mesh, const std::vector<std::int64_t>& body, std::int64_t most) {
  Crossings found;
  const Bvh bvh(mesh);
  std::vector<std::int64_t> touching(bvh.size());
  for (std::int32_t slot = 0; slot < static_cast<std::int32_t>(bvh.size()) && found.pairs <= most; ++slot) {
    poll_stop();
    const Corners own = corners_of(bvh.triangle(slot));
    const Box box = Box::of(own);
    bvh.any_of([&](const Box& other) { return other.meets(box); },
               [&](std::int32_t other) {
                 if (other <= slot || body[bvh.face(other)] == body[bvh.face(slot)]) return false;
                 if (!do_touch(own, corners_of(bvh.triangle(other)))) return false;
                 ++found.pairs;
                 ++touching[slot];
                 ++touching[other];
                 return false;
               });
  }
  for (const std::int64_t count : touching) found.corners += count * (count - 1) / 2;
  found.corners /= 3;
  return found;
}

std::vector<std::int32_t> crossing(const Bvh& surface, const Mesh& mesh, double slack) {
  std::vector<std::int32_t> found;
  for (std::size_t face = 0; face < mesh.faces.size(); ++face) {
    poll_stop();
    const Corners own = corners_of(mesh, mesh.faces[face]);
    const Box box = Box::of(own);
    if (surface.any_of([&](const Box& other) { return other.meets(box); },
                       [&](std::int32_t slot) { return do_touch(own, corners_of(surface.triangle(slot)), slack); }))
      found.push_back(static_cast<std::int32_t>(face));
  }
  return found;
}

}  // namespace rlacd
