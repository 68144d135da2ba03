// Cuts a closed mesh (OFF, triangles, on standard input) by the plane through the middle of its box that is normal to
// the x axis, and prints the volumes of the pieces and of their convex hulls.
#include <iostream>
#include <string>

#include "solid/pieces.hpp"

int main() {
  std::string off;
  std::size_t vertices = 0, faces = 0, edges = 0;
  std::cin >> off >> vertices >> faces >> edges;
  rlacd::Mesh mesh{std::vector<rlacd::Vec3>(vertices), std::vector<rlacd::Triangle>(faces)};
  for (rlacd::Vec3& v : mesh.vertices) std::cin >> v.x >> v.y >> v.z;
  for (rlacd::Triangle& f : mesh.faces) std::cin >> edges >> f[0] >> f[1] >> f[2];
  if (!std::cin || off != "OFF") return std::cerr << "this is no OFF file\n", 1;

  const rlacd::Box box = rlacd::Box::of(mesh.vertices);
  for (const auto& side : rlacd::cut(mesh, {1, 0, 0}, (box.lower.x + box.upper.x) / 2, 0)) {
    if (!side) continue;
    const auto pieces = rlacd::connected_pieces(side->mesh, 0).value_or(std::vector{*side});
    for (const rlacd::Piece& piece : pieces)
      std::cout << "volume " << piece.volume << ", of its hull " << piece.hull_volume << '\n';
  }
}
