#include "mesh/point_bodies.hpp"

#include <numeric>

#include "mesh/weld.hpp"

namespace rlacd {

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
