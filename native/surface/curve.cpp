#include "surface/curve.hpp"

#include <algorithm>
#include <numeric>

#include "core/stop.hpp"

namespace rlacd {

namespace {

// Spreads 10 bits to every third of 30.
std::uint32_t spread(std::uint32_t v) {
  v = 0xFF0000FFu & (v * 0x00010001u);
  v = 0x0F00F00Fu & (v * 0x00000101u);
  v = 0xC30C30C3u & (v * 0x00000011u);
  v = 0x49249249u & (v * 0x00000005u);
  return v;
}

std::uint32_t place_on_curve(Vec3 p, const Box& box) {
  std::uint32_t place = 0;
  for (int axis = 0; axis < 3; ++axis) {
    const double extent = box.upper[axis] - box.lower[axis];
    const double share = extent > 0 ? (p[axis] - box.lower[axis]) / extent : 0;
    const double cell = std::min(1023.0, std::max(0.0, 1024.0 * share));
    place |= spread(static_cast<std::uint32_t>(cell)) << (2 - axis);
  }
  return place;
}

// The order of points, all in a box, along the curve; points of one cell stay in their order.
std::vector<std::int32_t> order_along_a_curve(const std::vector<Vec3>& points, const Box& box) {
  poll_stop();
  std::vector<std::uint32_t> place(points.size());
  for (std::size_t i = 0; i < place.size(); ++i) place[i] = place_on_curve(points[i], box);
  std::vector<std::int32_t> order(points.size());
  std::iota(order.begin(), order.end(), 0);
  poll_stop();
  std::stable_sort(order.begin(), order.end(), [&](std::int32_t a, std::int32_t b) { return place[a] < place[b]; });
  return order;
}

// The order of the middles of faces.
std::vector<std::int32_t> order_of_faces(const Mesh& mesh) {
  std::vector<Vec3> middles;
  middles.reserve(mesh.faces.size());
  for (const auto& [a, b, c] : mesh.faces)
    middles.push_back((mesh.vertices[a] + mesh.vertices[b] + mesh.vertices[c]) / 3);
  return order_along_a_curve(middles, Box::of(mesh.vertices));
}

}  // namespace

Mesh along_a_curve(const Mesh& mesh) {
  Mesh sorted;
  sorted.vertices.reserve(mesh.vertices.size());
  Renumbered numbered(mesh.vertices, sorted.vertices);
  for (const std::int32_t v : order_along_a_curve(mesh.vertices, Box::of(mesh.vertices))) numbered(v);
  sorted.faces.reserve(mesh.faces.size());
  for (const std::int32_t f : order_of_faces(mesh)) sorted.faces.push_back(numbered(mesh.faces[f]));
  return sorted;
}

}  // namespace rlacd
