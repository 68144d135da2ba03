#include "base/point_bodies.hpp"

#include <cstring>
#include <numeric>

#include "base/stop.hpp"

namespace rlacd {

namespace {

constexpr std::size_t kBetweenPolls = 4096;

std::uint64_t hash_of(Vec3 p) {
  std::uint64_t hash = 0;
  for (const double x : {p.x, p.y, p.z}) {
    const double plain = x + 0.0;  // -0.0 is equal to 0.0
    std::uint64_t bits;
    std::memcpy(&bits, &plain, sizeof bits);
    hash = (hash ^ (bits >> 29) ^ bits) * 0x9e3779b97f4a7c15u;
    hash ^= hash >> 32;
  }
  return hash;
}

// For each point, the first point at the same place, by hashing with open addressing.
std::vector<std::int32_t> first_in_place(const std::vector<Vec3>& points) {
  std::size_t size = 16;
  while (size < 2 * points.size()) size *= 2;
  std::vector<std::int32_t> table(size, -1), first(points.size());
  for (std::size_t i = 0; i < points.size(); ++i) {
    if (i % kBetweenPolls == 0) poll_stop();
    const Vec3 p = points[i];
    std::size_t slot = hash_of(p) & (size - 1);
    for (; table[slot] >= 0; slot = (slot + 1) & (size - 1)) {
      const Vec3 q = points[table[slot]];
      if (p.x == q.x && p.y == q.y && p.z == q.z) break;
    }
    if (table[slot] < 0) table[slot] = static_cast<std::int32_t>(i);
    first[i] = table[slot];
  }
  return first;
}

}  // namespace

std::vector<std::int32_t> point_bodies(const Mesh& mesh) {
  const std::vector<std::int32_t> first = first_in_place(mesh.vertices);
  std::vector<std::int32_t> parent(mesh.vertices.size());
  std::iota(parent.begin(), parent.end(), 0);
  const auto root = [&parent](std::int32_t v) {
    while (parent[v] != v) v = parent[v] = parent[parent[v]];
    return v;
  };
  for (const Triangle& face : mesh.faces)
    for (const std::int32_t corner : {face[1], face[2]}) {
      const std::int32_t a = root(first[face[0]]), b = root(first[corner]);
      parent[std::max(a, b)] = std::min(a, b);
    }
  std::vector<std::int32_t> number(mesh.vertices.size(), -1), body(mesh.vertices.size(), -1);
  std::int32_t count = 0;
  for (const Triangle& face : mesh.faces) {
    std::int32_t& own = number[root(first[face[0]])];
    if (own < 0) own = count++;
    for (const std::int32_t corner : face) body[corner] = own;
  }
  return body;
}

}  // namespace rlacd
