#include <doctest/doctest.h>

#include "convex/hull.hpp"
#include "core/mesh_measures.hpp"
#include "shapes.hpp"

using namespace rlacd;

TEST_CASE("a hull is closed, and no point is outside, whatever is coplanar or double") {
  Random random(6);
  for (int i = 0; i < 300; ++i) {
    std::vector<Vec3> points;
    const int reach = i % 3 == 0 ? 1 : i % 3 == 1 ? 4 : 1 << 16;  // whole numbers: the test is exact in doubles
    for (int n = 0; n < 5 + i; ++n) points.push_back(random.grid_point(reach));
    const Mesh hull = hull_mesh(points);
    if (hull.faces.empty()) {
      CHECK(convex_hull(points).rank < 3);
      continue;
    }
    CHECK(is_closed(hull));
    CHECK(hull.faces.size() == 2 * hull.vertices.size() - 4);
    for (const Triangle& face : hull.faces)
      for (const Vec3 p : points) REQUIRE(dot(long_normal(hull, face), p - hull.vertices[face[0]]) <= 0);
  }
}

TEST_CASE("both sides of a plane share a hull") {
  Random random(8);
  std::vector<Vec3> points;
  for (int n = 0; n < 200; ++n) points.push_back(random.point(1));
  const Mesh hull = hull_mesh(points);
  for (int i = 0; i < 50; ++i) {
    const Vec3 normal = normalized(random.point(1));
    const double offset = random(-0.8, 0.8);
    const Mesh below = hull_below(hull, {normal, offset}), above = hull_below(hull, {-normal, -offset});
    CHECK(mesh_volume(below) + mesh_volume(above) == doctest::Approx(mesh_volume(hull)));
  }
}
