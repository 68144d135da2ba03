// Solids whose volumes and surfaces are known, and random numbers that are the same on every system.
#pragma once

#include <random>

#include "core/geometry.hpp"
#include "surface/edges.hpp"

namespace rlacd {

class Random {
 public:
  explicit Random(unsigned seed) : bits_(seed) {}
  double operator()(double low, double high) {
    return low + (high - low) * (static_cast<double>(bits_()) / 4294967296.0);
  }
  Vec3 point(double reach) { return {(*this)(-reach, reach), (*this)(-reach, reach), (*this)(-reach, reach)}; }
  Vec3 grid_point(int reach) {  // of whole coordinates
    const auto draw = [&] { return std::floor((*this)(-reach, reach + 1)); };
    return {draw(), draw(), draw()};
  }

 private:
  std::mt19937 bits_;
};

inline Mesh box(Vec3 half, Vec3 centre = {}) {
  Mesh mesh;
  for (int i = 0; i < 8; ++i)
    mesh.vertices.push_back(centre +
                            Vec3{i & 1 ? half.x : -half.x, i & 2 ? half.y : -half.y, i & 4 ? half.z : -half.z});
  mesh.faces = {{0, 2, 1}, {1, 2, 3}, {4, 5, 6}, {5, 7, 6}, {0, 1, 4}, {1, 5, 4},
                {2, 6, 3}, {3, 6, 7}, {0, 4, 2}, {2, 4, 6}, {1, 3, 5}, {3, 7, 5}};
  return mesh;
}

// Around the z axis.
inline Mesh torus(double major, double minor, int around = 24, int across = 12) {
  Mesh mesh;
  for (int i = 0; i < around; ++i)
    for (int j = 0; j < across; ++j) {
      const double u = 2 * kPi * i / around, v = 2 * kPi * j / across, r = major + minor * std::cos(v);
      mesh.vertices.push_back({r * std::cos(u), r * std::sin(u), minor * std::sin(v)});
      const int a = i * across + j, b = i * across + (j + 1) % across;
      const int c = (i + 1) % around * across + j, d = (i + 1) % around * across + (j + 1) % across;
      mesh.faces.push_back({a, c, b});
      mesh.faces.push_back({b, c, d});
    }
  return mesh;
}

// Every edge is run along once in each direction.
inline bool is_closed(const Mesh& mesh) {
  return !mesh.faces.empty() && mates_of(mesh.faces, mesh.vertices.size()).size() == 3 * mesh.faces.size();
}

}  // namespace rlacd
