#include <doctest/doctest.h>

#include "shapes.hpp"
#include "surface/surface.hpp"

using namespace rlacd;

TEST_CASE("the distance to a box is that of the formula") {
  const Vec3 h = {1, 0.5, 0.25};
  const Bvh bvh(box(h));
  Random random(3);
  for (int i = 0; i < 10000; ++i) {
    const Vec3 p = random.point(1.5), out = {std::fabs(p.x) - h.x, std::fabs(p.y) - h.y, std::fabs(p.z) - h.z};
    const double depth = -std::max({out.x, out.y, out.z});
    const Vec3 beyond = {std::max(out.x, 0.0), std::max(out.y, 0.0), std::max(out.z, 0.0)};
    const Bvh::Hit hit = bvh.closest(p);
    REQUIRE(std::sqrt(hit.distance2) == doctest::Approx(depth > 0 ? depth : norm(beyond)));
    REQUIRE(norm(hit.point - p) == doctest::Approx(std::sqrt(hit.distance2)));
  }
}

TEST_CASE("a tree made by several threads finds the nearest of all triangles") {
  const Mesh mesh = torus(0.7, 0.3, 80, 40);
  const Bvh bvh(mesh, 4);
  Random random(4);
  for (int i = 0; i < 200; ++i) {
    const Vec3 p = random.point(1.5);
    double nearest = std::numeric_limits<double>::infinity();
    for (const Triangle& face : mesh.faces) {
      const Corners t = corners_of(mesh, face);
      nearest = std::min(nearest, distance_to_triangle({t[0], t[1], t[2]}, p));
    }
    REQUIRE(std::sqrt(bvh.closest(p).distance2) == nearest);
  }
}

TEST_CASE("the winding number counts the bodies around a point") {
  Mesh mesh = torus(0.7, 0.3, 96, 48);
  append(mesh, box({0.4, 0.4, 0.4}, {0.7, 0, 0}));
  const Surface surface(mesh);
  Random random(5);
  for (int i = 0; i < 2000; ++i) {
    const Vec3 p = random.point(1.2);
    const double to_ring = std::hypot(std::hypot(p.x, p.y) - 0.7, p.z);
    if (std::fabs(to_ring - 0.3) < 0.01) continue;  // the mesh is not round
    const int bodies = (to_ring < 0.3) + (max_abs(p - Vec3{0.7, 0, 0}) < 0.4);
    REQUIRE(surface.winding().of_closed(p) == bodies);
    REQUIRE(surface.winding().at(p, 3) == doctest::Approx(bodies).epsilon(0.05));
  }
}
