#include <doctest/doctest.h>

#include "convex/hull.hpp"
#include "convex/polytope.hpp"
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

TEST_CASE("a hull that grows by batches is the hull of all") {
  Random random(7);
  HullBuilder growing;
  std::vector<Vec3> all;
  for (int batch = 0; batch < 20; ++batch) {
    std::vector<Vec3> points;
    for (int n = 0; n < 30; ++n) points.push_back(random.point(1 + 0.1 * batch));
    growing.add(points);
    all = joined(std::move(all), points);
    CHECK(growing.volume() == doctest::Approx(mesh_volume(hull_mesh(all))));
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

TEST_CASE("three facets meet in every corner of a polytope in general position, which is hardly larger") {
  const ConvexBody body(hull_mesh(torus(0.7, 0.3).vertices));
  const auto polytope = in_general_position(body, 1e-7);
  REQUIRE(polytope);
  CHECK(2 * polytope->edges.size() == 3 * polytope->corners.size());
  CHECK(polytope->corners.size() + polytope->facets.size() == polytope->edges.size() + 2);
  for (const Vec3 corner : polytope->corners) CHECK(body.distance(corner) < 1e-5);
  for (const Vec3 p : body.mesh().vertices)
    for (const HalfSpace& facet : polytope->facets) CHECK(facet.depth(p) > 0);
}
